#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "motion/lifespan.h"
#include "motion/motion_cloud.h"

// Hard cases of splats that move, with traps on. Each is judged by the same formulas in double.

namespace stipple {
namespace {

struct HardMotion {
  const char* name;
  MovingSplat<double> splat;
  uint32_t frames;
  double window_frames = kWindowFrames;
};

std::vector<HardMotion> hardMotions() {
  MovingSplat<double> plain;
  plain.position = {1, 2, 3};
  plain.lifespans = {0.2, 0.2};
  plain.spin = {0.1, 0.2, -0.3, 0.4};
  for (auto& wave : plain.waves) wave = {0.1, -0.2, 0.3};
  plain.centre = 0.4;
  std::vector<HardMotion> list = {{"plain", plain, 300}};

  list.push_back({"clip of one frame", plain, 1});
  list.back().splat.centre = 0;
  list.push_back({"clip of two frames", plain, 2});
  list.push_back({"clip as long as its window", plain, 50});
  list.push_back({"window longer than the clip", plain, 60, 1e6});
  list.push_back({"no window", plain, 300, 0});
  for (const double centre : {0.0, 1e-7, 299.0 / 300, 1.0}) {
    list.push_back({"centre at an end", plain, 300});
    list.back().splat.centre = centre;
  }
  list.push_back({"scale at its cap", plain, 300});
  list.back().splat.lifespans = {lifespanOf(80.0, lifespanUnit(300)),
                                 lifespanOf(1e30, lifespanUnit(300))};
  list.push_back({"scale at its floor", plain, 300});
  list.back().splat.lifespans = {lifespanOf(-80.0, lifespanUnit(300)),
                                 lifespanOf(-1e30, lifespanUnit(300))};
  // At an offset of exactly 0.5 the quaternion is 0.
  list.push_back({"quaternion through 0", plain, 300, 0});
  list.back().splat.centre = 0;
  list.back().splat.spin = {-2, 0, 0, 0};
  list.push_back({"tiny quaternion", plain, 300});
  list.back().splat.rotation = {1e-6, 0, 0, 1e-6};
  list.back().splat.spin = {0, 0, 0, 0};
  list.push_back({"fast turn", plain, 300});
  list.back().splat.spin = {1e6, -1e6, 0, 1e6};
  list.push_back({"phases of a thousand turns", plain, 300});
  list.back().splat.phases = {6283.1853, -6283.1853, 1e4, -1e4};
  list.push_back({"wide path", plain, 300});
  for (auto& wave : list.back().splat.waves) wave = {1e6, -1e6, 1e6};
  list.push_back({"invisible", plain, 300});
  list.back().splat.opacity = 0;
  return list;
}

/// Seventeen copies, more than a vector of any processor.
MotionCloud cloudOf(const HardMotion& hard) {
  constexpr size_t kCopies = 17;
  MotionCloud moving;
  moving.clip.frame_count = hard.frames;
  moving.clip.window_frames = hard.window_frames;
  moving.splats.resize(kCopies);
  const auto put = [](const auto& values, std::vector<float>& column) {
    for (const double value : values) column.push_back(static_cast<float>(value));
  };
  moving.splats.positions.clear();
  moving.splats.rotations.clear();
  for (size_t i = 0; i < kCopies; ++i) {
    put(hard.splat.position, moving.splats.positions);
    put(hard.splat.rotation, moving.splats.rotations);
    moving.splats.opacities[i] = static_cast<float>(hard.splat.opacity);
    for (size_t wave = 0; wave < kMotionWaves; ++wave) {
      put(hard.splat.waves[wave], moving.waves[wave]);
    }
    put(hard.splat.phases, moving.phases);
    put(hard.splat.spin, moving.spins);
    put(hard.splat.lifespans, moving.lifespans);
    moving.centres.push_back(static_cast<float>(hard.splat.centre));
  }
  return moving;
}

std::vector<double> timesOf(uint32_t frames) {
  return {0, 0.25, 0.5, 0.4, static_cast<double>(frames - 1) / frames};
}

template <class Judge>
void judgeEach(const Judge& judge) {
  for (const HardMotion& hard : hardMotions()) {
    const MotionCloud moving = cloudOf(hard);
    // Rounded as the columns are, so that kernels and the reference are asked the same.
    MovingSplat<double> splat = hard.splat;
    const auto round = [](auto& values) {
      for (double& value : values) value = static_cast<double>(static_cast<float>(value));
    };
    round(splat.position);
    round(splat.rotation);
    for (auto& wave : splat.waves) round(wave);
    round(splat.phases);
    round(splat.spin);
    round(splat.lifespans);
    splat.centre = static_cast<double>(static_cast<float>(splat.centre));
    for (const double time : timesOf(hard.frames)) {
      const auto part = static_cast<float>(time);
      judge(hard, moving, splat, part);
    }
  }
}

TEST(Motion, HardCasesAreThoseOfDouble) {
  const MotionKernel kernel = chosenMotionKernel();
  judgeEach([&](const HardMotion& hard, const MotionCloud& moving, const MovingSplat<double>& splat,
                float part) {
    SCOPED_TRACE(std::string(hard.name) + " at " + std::to_string(part));
    SplatCloud cloud = moving.splats;
    const TimeWindow window = moving.clip.window();
    kernel.moments(moving.columns(), window, part, 0, moving.size(),
                   {cloud.positions.data(), cloud.rotations.data(), cloud.opacities.data()});
    const SplatMoment<double> exact = momentOf(splat, window, static_cast<double>(part));
    double span = 0;
    for (const auto& wave : splat.waves) {
      for (const double value : wave) span += std::abs(value);
    }
    double phase = 0;
    for (const double value : splat.phases) phase = std::max(phase, std::abs(value));
    // Angles are off by float32's step of the largest phase and of four offsets, times the path.
    const double place_tolerance = 1e-6 + span * 1e-7 * (8 + phase);
    for (size_t row : {size_t{0}, moving.size() - 1}) {
      double length = 0;
      for (size_t i = 0; i < 3; ++i) {
        EXPECT_NEAR(cloud.positions[3 * row + i], exact.position[i], place_tolerance);
      }
      for (size_t i = 0; i < 4; ++i) {
        const double value = cloud.rotations[4 * row + i];
        length += value * value;
        EXPECT_NEAR(value, exact.rotation[i], 4e-6);
      }
      EXPECT_NEAR(length, 1, 1e-6);
      EXPECT_NEAR(cloud.opacities[row], exact.opacity, 4e-6);
    }
  });
}

TEST(Motion, HardCasesHaveFiniteDerivatives) {
  const MotionKernel kernel = chosenMotionKernel();
  judgeEach([&](const HardMotion& hard, const MotionCloud& moving, const MovingSplat<double>& splat,
                float part) {
    SCOPED_TRACE(std::string(hard.name) + " at " + std::to_string(part));
    const size_t count = moving.size();
    const std::vector<float> ones(4 * count, 1.0f);
    MotionCloud by = moving;
    MotionColumns<float> out;
    out.positions = by.splats.positions.data();
    out.rotations = by.splats.rotations.data();
    out.opacities = by.splats.opacities.data();
    for (size_t wave = 0; wave < kMotionWaves; ++wave) out.waves[wave] = by.waves[wave].data();
    out.phases = by.phases.data();
    out.spins = by.spins.data();
    out.lifespans = by.lifespans.data();
    kernel.gradients(moving.columns(), moving.clip.window(), part, 0, count,
                     {ones.data(), ones.data(), ones.data()}, out);
    for (const auto* column : {&by.splats.positions, &by.splats.rotations, &by.splats.opacities,
                               &by.phases, &by.spins, &by.lifespans, &by.waves[0], &by.waves[7]}) {
      for (const float value : *column) EXPECT_TRUE(std::isfinite(value));
    }
    // The raw value of a temporal scale, whatever it is.
    for (const float raw : {-1e30f, -80.0f, 0.0f, 80.0f, 1e30f}) {
      const float slope = rawLifespanGradient(raw, lifespanUnit(hard.frames), by.lifespans[0]);
      EXPECT_TRUE(std::isfinite(slope));
    }
    const SplatMoment<double> one = {{1, 1, 1}, {1, 1, 1, 1}, 1};
    const MovingSplat<double> exact =
        momentGradient(splat, moving.clip.window(), static_cast<double>(part), one);
    EXPECT_NEAR(by.splats.opacities[0], exact.opacity, 4e-6);
    // What is left of two numbers of size 1 is divided by the length of the quaternion.
    double length;
    turnedRotation(splat, stretchedOffset(moving.clip.window(), double{part}, splat.centre),
                   length);
    for (size_t i = 0; i < 4; ++i) {
      EXPECT_NEAR(by.splats.rotations[i], exact.rotation[i], 1e-6 * (1 + 1 / length));
    }
  });
}

}  // namespace
}  // namespace stipple
