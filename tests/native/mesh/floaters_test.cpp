#include "mesh/floaters.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <random>

#include "base/error.h"
#include "base/parallel.h"

namespace stipple {
namespace {

void add(SplatCloud& cloud, double x, double y, double z, float size, float opacity) {
  for (const double v : {x, y, z}) cloud.positions.push_back(static_cast<float>(v));
  for (const float v : {1.0f, 0.0f, 0.0f, 0.0f}) cloud.rotations.push_back(v);
  for (const float v : {size, size, size * 0.3f}) cloud.scales.push_back(v);
  cloud.opacities.push_back(opacity);
  for (int k = 0; k < 3; ++k) cloud.sh.push_back(0.5f);
}

/// A sphere's surface of `body` splats, then 20 faint ones on it, 5 blobs, and 3 groups of 6 specks
/// away from it.
SplatCloud capture(size_t body) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> u(0, 1);
  SplatCloud cloud;
  const auto onSphere = [&](float size, float opacity) {
    const double x = normal(random), y = normal(random), z = normal(random);
    const double r = std::sqrt(x * x + y * y + z * z);
    add(cloud, x / r, y / r, z / r, size, opacity);
  };
  for (size_t i = 0; i < body; ++i) {
    onSphere(static_cast<float>(0.02 * std::exp(0.4 * normal(random))),
             static_cast<float>(0.1 + 0.9 * u(random)));
  }
  for (int i = 0; i < 20; ++i) onSphere(0.02f, 0.01f);
  for (int i = 0; i < 5; ++i) onSphere(1.5f, 0.5f);
  for (int group = 0; group < 3; ++group) {
    for (int i = 0; i < 6; ++i) add(cloud, 4 + group, 0.01 * i, 2, 0.02f, 0.9f);
  }
  return cloud;
}

TEST(Floaters, AreFoundByEachRuleAndCounted) {
  constexpr size_t kBody = 5000;
  const SplatCloud cloud = capture(kBody);
  FloaterReport report;
  const std::vector<uint8_t> mask = withoutFloaters(cloud, {}, report, nullptr);
  EXPECT_EQ(report.faint, 20u);
  EXPECT_EQ(report.large, 5u);
  EXPECT_EQ(report.isolated, 18u);
  EXPECT_EQ(report.kept, kBody);
  EXPECT_EQ(report.group_count, 4u);
  for (size_t i = 0; i < cloud.size(); ++i) EXPECT_EQ(mask[i], i < kBody ? 1 : 0) << i;
}

TEST(Floaters, RulesCanBeSwitchedOffAndSet) {
  const SplatCloud cloud = capture(1000);
  FloaterReport report;
  FloaterOptions none;
  none.by_opacity = none.by_size = none.by_connectivity = false;
  withoutFloaters(cloud, none, report, nullptr);
  EXPECT_EQ(report.kept, cloud.size());
  FloaterOptions faint = none;
  faint.by_opacity = true;
  faint.min_opacity = 1;
  withoutFloaters(cloud, faint, report, nullptr);
  EXPECT_EQ(report.kept, 0u);
  FloaterOptions large = none;
  large.by_size = true;
  large.max_size = 1.4;
  withoutFloaters(cloud, large, report, nullptr);
  EXPECT_EQ(report.large, 5u);
  EXPECT_EQ(report.max_size, 1.4);
  FloaterOptions groups = none;
  groups.by_connectivity = true;
  groups.radius = 0.3;
  groups.min_group_count = 7;
  withoutFloaters(cloud, groups, report, nullptr);
  EXPECT_EQ(report.isolated, 18u);
  groups.min_group_count = 6;
  withoutFloaters(cloud, groups, report, nullptr);
  EXPECT_EQ(report.isolated, 0u);
}

TEST(Floaters, KeepTheLargestGroupHoweverSmall) {
  SplatCloud cloud;
  for (int i = 0; i < 4; ++i) add(cloud, 0.01 * i, 0, 0, 0.01f, 1);
  add(cloud, 50, 0, 0, 0.01f, 1);
  FloaterReport report;
  FloaterOptions options;
  options.radius = 0.1;
  const std::vector<uint8_t> mask = withoutFloaters(cloud, options, report, nullptr);
  EXPECT_EQ(mask, (std::vector<uint8_t>{1, 1, 1, 1, 0}));
}

TEST(Floaters, LeaveEqualSplatsAndSplatsAtOnePlaceAlone) {
  SplatCloud cloud;
  for (int i = 0; i < 100; ++i) add(cloud, 1, 2, 3, 0.01f, 0.5f);
  FloaterReport report;
  const std::vector<uint8_t> mask = withoutFloaters(cloud, {}, report, nullptr);
  EXPECT_EQ(std::accumulate(mask.begin(), mask.end(), 0), 100);
  EXPECT_TRUE(withoutFloaters(SplatCloud{}, {}, report, nullptr).empty());
  EXPECT_EQ(report.kept, 0u);
}

TEST(Floaters, RefuseOptionsOutOfRange) {
  const SplatCloud cloud = capture(50);
  FloaterReport report;
  FloaterOptions options;
  options.min_opacity = 1.5;
  EXPECT_THROW(withoutFloaters(cloud, options, report, nullptr), Error);
  options = {};
  options.radius = -1;
  EXPECT_THROW(withoutFloaters(cloud, options, report, nullptr), Error);
  options = {};
  options.max_size = std::nan("");
  EXPECT_THROW(withoutFloaters(cloud, options, report, nullptr), Error);
}

TEST(Floaters, AreTheSameForAnyNumberOfThreads) {
  const SplatCloud cloud = capture(3000);
  std::vector<uint8_t> one, two;
  FloaterReport report;
  withThreads(1, [&] { one = withoutFloaters(cloud, {}, report, nullptr); });
  withThreads(2, [&] { two = withoutFloaters(cloud, {}, report, nullptr); });
  EXPECT_EQ(one, two);
}

}  // namespace
}  // namespace stipple
