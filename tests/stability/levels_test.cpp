#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>

#include "base/error.h"
#include "decode/tree/hierarchy_decoder.h"
#include "level_cases.h"
#include "page.h"
#include "splat/cpu/rays/ray_tiles.h"
#include "splat/render/accurate_render.h"

// Hard cases at every level and knob of accuracy, with traps on: no NaN, no alpha outside 0..1, no
// colour outside the hull of the splats' colours, and each picture in single precision is judged
// by the same in double.

namespace stipple {
namespace {

using testing::HardCase;
using testing::hardCases;

struct Kind {
  const char* name;
  RenderAccuracy accuracy;
  int degree;
  double share = 1;
};

std::vector<Kind> kinds() {
  std::vector<Kind> list;
  RenderAccuracy tiled, rays, crossing;
  rays.order = RayOrder::kResponse;
  rays.projection = RayProjection::kRay;
  crossing.order = RayOrder::kResponse;
  RenderAccuracy unlimited = rays;
  unlimited.limits = unlimitedRays().limits;
  list.push_back({"draft", tiled, 1, 0.25});
  list.push_back({"preview", tiled, 2, 0.5});
  list.push_back({"final", tiled, kMaxShDegree});
  list.push_back({"order pixel", crossing, kMaxShDegree});
  list.push_back({"rays", rays, kMaxShDegree});
  list.push_back({"reference", unlimited, kMaxShDegree});
  return list;
}

/// The share of a level, as whoever renders makes it.
SplatCloud merged(const SplatCloud& cloud, double share) {
  if (share >= 1) return cloud;
  const auto leaves = std::make_shared<const SplatCloud>(cloud);
  const HierarchyDecoder decoder(leaves,
                                 std::make_shared<const MergeTree>(buildMergeTree(cloud, {}, {})));
  DecodeRequest request;
  request.budget = static_cast<uint64_t>(std::ceil(share * static_cast<double>(cloud.size())));
  return decoder.decode(request);
}

RenderResult drawn(const SplatCloud& cloud, const Camera& camera, const Kind& kind,
                   LowPass low_pass, Precision precision) {
  RenderOptions options;
  options.low_pass = low_pass;
  options.sh_degree_limit = kind.degree;
  RenderAccuracy accuracy = kind.accuracy;
  accuracy.precision = precision;
  SplatInstance instance;
  instance.cloud = &cloud;
  RenderWorkspace workspace;
  RenderResult result;
  renderAccurate({&instance, 1}, camera, options, accuracy, workspace, result);
  return result;
}

/// Colours of the case are between 0 and this: 0.5 + 1.7 / (2 sqrt(pi)).
constexpr float kLargestColour = 0.98f;
/// Sums of ten thousand weights in float32.
constexpr float kRounding = 1e-5f;

void expectInHull(const RenderResult& picture) {
  for (size_t i = 0; i < picture.colour.size(); i += 4) {
    const float alpha = picture.colour[i + 3];
    ASSERT_GE(alpha, 0.0f);
    ASSERT_LE(alpha, 1.0f);
    for (size_t c = 0; c < 3; ++c) {
      ASSERT_GE(picture.colour[i + c], 0.0f);
      ASSERT_LE(picture.colour[i + c], kLargestColour * alpha + kRounding);
    }
  }
  for (const float depth : picture.depth) ASSERT_TRUE(std::isfinite(depth));
}

double worstDifference(const RenderResult& a, const RenderResult& b) {
  double worst = 0;
  for (size_t i = 0; i < a.colour.size(); ++i) {
    worst = std::max(worst,
                     std::abs(static_cast<double>(a.colour[i]) - static_cast<double>(b.colour[i])));
  }
  return worst;
}

TEST(LevelStability, EveryHardCaseStaysInTheHullAndNearDouble) {
  std::string table;
  for (const HardCase& hard : hardCases()) {
    SCOPED_TRACE(hard.name);
    const SplatCloud cloud = hard.cloud();
    table += "| " + hard.name + " | " + hard.naive + " | " + hard.ours + " |";
    for (const Kind& kind : kinds()) {
      SCOPED_TRACE(kind.name);
      const SplatCloud shown = merged(cloud, kind.share);
      double worst = 0;
      for (const LowPass low_pass : {LowPass::kClassic, LowPass::kMip, LowPass::kNone}) {
        const RenderResult single = drawn(shown, hard.camera, kind, low_pass, Precision::kFloat);
        const RenderResult exact = drawn(shown, hard.camera, kind, low_pass, Precision::kDouble);
        expectInHull(single);
        expectInHull(exact);
        worst = std::max(worst, worstDifference(single, exact));
      }
      // What every renderer promises of single precision.
      EXPECT_LT(worst, 1e-4);
      table.append(" ").append(testing::shortNumber(worst)).append(" |");
    }
    table += "\n";
  }
  testing::StabilityPage::ofThisRun().levels = table;
}

TEST(LevelStability, WhatIsNotANumberIsRefusedAtEveryLevel) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  const Camera camera = testing::frontCamera(16, 12, 10, 3);
  for (const Kind& kind : kinds()) {
    for (const Precision precision : {Precision::kFloat, Precision::kDouble}) {
      for (const float bad : {nan, infinity}) {
        for (int where = 0; where < 5; ++where) {
          SplatCloud cloud = testing::oneSplat(0.3f, 0.5f);
          std::vector<float>* arrays[] = {&cloud.positions, &cloud.rotations, &cloud.scales,
                                          &cloud.opacities, &cloud.sh};
          arrays[where]->back() = bad;
          EXPECT_THROW(drawn(cloud, camera, kind, LowPass::kClassic, precision), Error);
        }
      }
      SplatCloud cloud = testing::oneSplat(0.3f, 0.5f);
      cloud.rotations = {0, 0, 0, 0};
      EXPECT_THROW(drawn(cloud, camera, kind, LowPass::kClassic, precision), Error);
    }
  }
}

}  // namespace
}  // namespace stipple
