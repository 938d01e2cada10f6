#include "mesh/view_harmonics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "math/colour.h"
#include "mesh/shown_harmonics.h"

namespace stipple {
namespace {

constexpr float kUp[3] = {0, 0, 1};
constexpr float kGrey[3] = {0.2f, 0.2f, 0.2f};

/// Even over the sphere: a Fibonacci lattice.
std::vector<float> lattice(size_t count) {
  std::vector<float> directions;
  for (size_t i = 0; i < count; ++i) {
    const double z = 1 - 2 * (static_cast<double>(i) + 0.5) / static_cast<double>(count);
    const double angle = static_cast<double>(i) * std::numbers::pi * (3 - std::sqrt(5.0));
    const double radius = std::sqrt(1 - z * z);
    directions.push_back(static_cast<float>(radius * std::cos(angle)));
    directions.push_back(static_cast<float>(radius * std::sin(angle)));
    directions.push_back(static_cast<float>(z));
  }
  return directions;
}

/// What must come to grey so that it shows a display value.
float addedTo(double display) {
  return static_cast<float>(srgbToLinear(display) - static_cast<double>(kGrey[0]));
}

std::vector<float> fitted(const ViewHarmonics& harmonics, const std::vector<float>& added) {
  std::vector<float> coefficients(harmonics.coefficientCount() * 3);
  harmonics.fit(kUp, kGrey, added, coefficients);
  return coefficients;
}

TEST(ViewHarmonics, AreFlatWhereNothingChangesWithTheView) {
  const std::vector<float> directions = lattice(24);
  for (int degree = 1; degree <= kMaxViewDegree; ++degree) {
    const ViewHarmonics harmonics(directions, degree);
    const std::vector<float> seen = fitted(harmonics, std::vector<float>(directions.size(), 0.0f));
    ASSERT_EQ(seen.size(), static_cast<size_t>((degree + 1) * (degree + 1) * 3));
    // A constant fits without a rest, so nothing holds it back. Sums of 25 products in float32.
    EXPECT_NEAR(shownAlong(seen.data(), degree, Vec3d(0, 0, -1), 1), linearToSrgb(0.2), 2e-6);
    for (size_t k = 3; k < seen.size(); ++k) EXPECT_NEAR(seen[k], 0.0f, 2e-6f) << k;
  }
}

TEST(ViewHarmonics, FollowAShineBetweenTheDirectionsThatTellIt) {
  // A lobe around a mirrored light, a third of a hemisphere wide: much of it lies in low degrees.
  const Vec3d mirrored = Vec3d(0.5, 0.2, -0.8).normalized();
  const auto lobe = [&](const Vec3d& d) {
    return 0.35 + 0.5 * std::exp(4 * (d.dot(mirrored) - 1));
  };
  const std::vector<float> directions = lattice(36), between = lattice(101);
  std::vector<float> added(directions.size());
  double mean_error[kMaxViewDegree + 1] = {};
  for (size_t i = 0; i < directions.size(); i += 3) {
    const Vec3d d(directions[i], directions[i + 1], directions[i + 2]);
    for (size_t c = 0; c < 3; ++c) added[i + c] = addedTo(lobe(d));
  }
  const float along[3] = {static_cast<float>(srgbToLinear(lobe(Vec3d(0, 0, -1)))),
                          static_cast<float>(srgbToLinear(lobe(Vec3d(0, 0, -1)))),
                          static_cast<float>(srgbToLinear(lobe(Vec3d(0, 0, -1))))};
  for (float& value : added) value += kGrey[0] - along[0];
  for (int degree = 0; degree <= kMaxViewDegree; ++degree) {
    std::vector<float> seen(static_cast<size_t>((degree + 1) * (degree + 1) * 3));
    if (degree > 0) ViewHarmonics(directions, degree).fit(kUp, along, added, seen);
    if (degree == 0) seen[0] = static_cast<float>((lobe(Vec3d(0, 0, -1)) - 0.5) / 0.28209479);
    double sum = 0, count = 0;
    for (size_t i = 0; i < between.size(); i += 3) {
      const Vec3d d(between[i], between[i + 1], between[i + 2]);
      if (d.z() > -0.3) continue;  // grazing or from behind
      sum += std::abs(shownAlong(seen.data(), degree, d, 0) - lobe(d));
      count += 1;
    }
    mean_error[degree] = sum / count;
  }
  // A smooth function leaves less with each degree; wrong signs or weights would leave more.
  EXPECT_LT(mean_error[1], 0.8 * mean_error[0]);
  EXPECT_LT(mean_error[2], 0.8 * mean_error[1]);
  EXPECT_LT(mean_error[3], 0.8 * mean_error[2]);
}

TEST(ViewHarmonics, AskDirectionsFromBehindLittle) {
  const std::vector<float> directions = lattice(36);
  std::vector<float> added(directions.size(), 0.0f);
  for (size_t i = 0; i < directions.size(); i += 3) {
    if (directions[i + 2] < 0.1f) continue;
    for (size_t c = 0; c < 3; ++c) added[i + c] = addedTo(0.98);
  }
  const double from_front = linearToSrgb(0.2);  // 0.48; 0.98 from behind
  const std::vector<float> seen = fitted(ViewHarmonics(directions, 3), added);
  for (size_t i = 0; i < directions.size(); i += 3) {
    if (directions[i + 2] > -0.5f) continue;
    const Vec3d d(directions[i], directions[i + 1], directions[i + 2]);
    // A tenth of the step is what a polynomial of the third degree makes of it.
    EXPECT_NEAR(shownAlong(seen.data(), 3, d, 0), from_front, 0.05);
  }
}

TEST(ViewHarmonics, StayFiniteForZeroNormalsOneDirectionAndBrightLight) {
  const std::vector<float> one = {0, 0, -1};
  const ViewHarmonics harmonics(one, 3);
  const float nothing[3] = {0, 0, 0};
  std::vector<float> seen(48);
  const std::vector<float> added = {1e30f, -1e30f, 0};
  harmonics.fit(nothing, kGrey, added, seen);
  for (const float value : seen) EXPECT_TRUE(std::isfinite(value));
  harmonics.fit(kUp, kGrey, added, seen);
  for (const float value : seen) EXPECT_TRUE(std::isfinite(value));
}

}  // namespace
}  // namespace stipple
