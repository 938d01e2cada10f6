#include "motion/motion_cloud.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"

namespace stipple {
namespace {

using testing::HasSubstr;

float drawn(uint64_t stream, size_t i, float from, float to) {
  return from + (to - from) * unitFloat(keyedBits(stream, RandomUse::kThinning, i));
}

MotionCloud someCloud(size_t count, uint32_t frames = 300) {
  MotionCloud moving;
  moving.splats.resize(count);
  for (size_t i = 0; i < 3 * count; ++i) {
    moving.splats.positions[i] = drawn(1, i, -2, 2);
    moving.splats.scales[i] = drawn(2, i, 0.01f, 0.1f);
  }
  for (size_t i = 0; i < 4 * count; ++i) {
    moving.splats.rotations[i] = drawn(3, i, 0.1f, 1);
    moving.phases.push_back(drawn(4, i, -9, 9));
    moving.spins.push_back(drawn(5, i, -1, 1));
  }
  normaliseRotations(moving.splats);
  for (size_t wave = 0; wave < kMotionWaves; ++wave) {
    for (size_t i = 0; i < 3 * count; ++i) {
      moving.waves[wave].push_back(drawn(10 + wave, i, -0.3f, 0.3f));
    }
  }
  for (size_t i = 0; i < count; ++i) {
    moving.splats.opacities[i] = drawn(6, i, 0, 1);
    moving.centres.push_back(drawn(7, i, 0, 1));
    moving.lifespans.push_back(drawn(8, i, 0.05f, 1.1f));
    moving.lifespans.push_back(drawn(9, i, 0.05f, 1.1f));
  }
  moving.clip.frame_count = frames;
  return moving;
}

MovingSplat<double> rowOf(const MotionCloud& moving, size_t row) {
  MovingSplat<double> splat;
  for (size_t i = 0; i < 3; ++i) splat.position[i] = moving.splats.positions[3 * row + i];
  for (size_t i = 0; i < 4; ++i) {
    splat.rotation[i] = moving.splats.rotations[4 * row + i];
    splat.phases[i] = moving.phases[4 * row + i];
    splat.spin[i] = moving.spins[4 * row + i];
  }
  for (size_t wave = 0; wave < kMotionWaves; ++wave) {
    for (size_t i = 0; i < 3; ++i) splat.waves[wave][i] = moving.waves[wave][3 * row + i];
  }
  for (size_t i = 0; i < 2; ++i) splat.lifespans[i] = moving.lifespans[2 * row + i];
  splat.opacity = moving.splats.opacities[row];
  splat.centre = moving.centres[row];
  return splat;
}

/// Columns of derivatives.
struct Gradients {
  explicit Gradients(size_t count) : numbers(kFloats * count, -7.0f) {
    float* next = numbers.data();
    const auto room = [&](size_t width) {
      float* column = next;
      next += width * count;
      return column;
    };
    columns.positions = room(3);
    columns.rotations = room(4);
    columns.opacities = room(1);
    for (auto& wave : columns.waves) wave = room(3);
    columns.phases = room(4);
    columns.spins = room(4);
    columns.lifespans = room(2);
  }
  static constexpr size_t kFloats = 3 + 4 + 1 + 3 * kMotionWaves + 4 + 4 + 2;
  std::vector<float> numbers;
  MotionColumns<float> columns;
};

// Sums of nine products of numbers up to 2.7, angles within a turn in float32 (4e-7 off, from
// offsets times 4 and phases of 9) times coefficients of 0.3.
constexpr double kPlaceTolerance = 8e-6;
// Ratios of offsets to lifespans up to 20 are 6e-8 off each, relative; what is left above 1e-4 of
// the opacity has squares up to 9.
constexpr double kShareTolerance = 4e-6;

TEST(MotionKernel, EveryInstructionSetGivesTheMomentsOfDouble) {
  for (const size_t count : {size_t{1}, size_t{7}, size_t{16}, size_t{33}, size_t{1000}}) {
    const MotionCloud moving = someCloud(count);
    for (const MotionKernel& kernel : motionKernels()) {
      for (const TimeWindow& window : {moving.clip.window(), TimeWindow()}) {
        for (const float time : {0.0f, 0.37f, 299.0f / 300}) {
          SplatCloud cloud = moving.splats;
          kernel.moments(moving.columns(), window, time, 0, count,
                         {cloud.positions.data(), cloud.rotations.data(), cloud.opacities.data()});
          for (size_t row = 0; row < count; ++row) {
            const SplatMoment<double> exact =
                momentOf(rowOf(moving, row), window, static_cast<double>(time));
            for (size_t i = 0; i < 3; ++i) {
              ASSERT_NEAR(cloud.positions[3 * row + i], exact.position[i], kPlaceTolerance)
                  << kernel.target;
            }
            for (size_t i = 0; i < 4; ++i) {
              // Where the quaternion passes near 0 its direction has fewer digits: cubes of
              // offsets here keep its length above 0.05.
              ASSERT_NEAR(cloud.rotations[4 * row + i], exact.rotation[i], kPlaceTolerance)
                  << kernel.target;
            }
            ASSERT_NEAR(cloud.opacities[row], exact.opacity, kShareTolerance) << kernel.target;
          }
        }
      }
    }
  }
}

TEST(MotionKernel, EveryInstructionSetGivesTheDerivativesOfDouble) {
  for (const size_t count : {size_t{1}, size_t{15}, size_t{200}}) {
    const MotionCloud moving = someCloud(count);
    std::vector<float> by_positions, by_rotations, by_opacities;
    for (size_t i = 0; i < 4 * count; ++i) by_rotations.push_back(drawn(31, i, -1, 1));
    for (size_t i = 0; i < 3 * count; ++i) by_positions.push_back(drawn(32, i, -1, 1));
    for (size_t i = 0; i < count; ++i) by_opacities.push_back(drawn(33, i, -1, 1));
    const TimeWindow window = moving.clip.window();
    for (const MotionKernel& kernel : motionKernels()) {
      Gradients by(count);
      kernel.gradients(moving.columns(), window, 0.37f, 0, count,
                       {by_positions.data(), by_rotations.data(), by_opacities.data()}, by.columns);
      for (size_t row = 0; row < count; ++row) {
        SplatMoment<double> given;
        for (size_t i = 0; i < 3; ++i) given.position[i] = by_positions[3 * row + i];
        for (size_t i = 0; i < 4; ++i) given.rotation[i] = by_rotations[4 * row + i];
        given.opacity = by_opacities[row];
        const MovingSplat<double> exact =
            momentGradient(rowOf(moving, row), window, 0.37000000476837158, given);
        const auto near = [&](float value, double wanted, const char* name) {
          ASSERT_NEAR(value, wanted, kPlaceTolerance * (1 + std::abs(wanted)))
              << name << ' ' << kernel.target << ' ' << row;
        };
        for (size_t i = 0; i < 3; ++i)
          near(by.columns.positions[3 * row + i], exact.position[i], "x");
        for (size_t i = 0; i < 4; ++i) {
          near(by.columns.rotations[4 * row + i], exact.rotation[i], "rotation");
          near(by.columns.spins[4 * row + i], exact.spin[i], "spin");
          near(by.columns.phases[4 * row + i], exact.phases[i], "phase");
        }
        for (size_t wave = 0; wave < kMotionWaves; ++wave) {
          for (size_t i = 0; i < 3; ++i) {
            near(by.columns.waves[wave][3 * row + i], exact.waves[wave][i], "wave");
          }
        }
        near(by.columns.opacities[row], exact.opacity, "opacity");
        for (size_t i = 0; i < 2; ++i) {
          near(by.columns.lifespans[2 * row + i], exact.lifespans[i], "lifespan");
        }
      }
    }
  }
}

TEST(MotionKernel, ARowDoesNotDependOnWhereItsRangeBegins) {
  const MotionCloud moving = someCloud(70);
  for (const MotionKernel& kernel : motionKernels()) {
    SplatCloud whole = moving.splats, pieces = moving.splats;
    const auto make = [&](SplatCloud& cloud, size_t begin, size_t end) {
      kernel.moments(moving.columns(), moving.clip.window(), 0.2f, begin, end,
                     {cloud.positions.data(), cloud.rotations.data(), cloud.opacities.data()});
    };
    make(whole, 0, 70);
    make(pieces, 0, 3);
    make(pieces, 3, 44);
    make(pieces, 44, 70);
    EXPECT_EQ(whole.positions, pieces.positions) << kernel.target;
    EXPECT_EQ(whole.rotations, pieces.rotations) << kernel.target;
    EXPECT_EQ(whole.opacities, pieces.opacities) << kernel.target;
  }
}

TEST(MotionCloud, HasTheSameBitsForAnyNumberOfThreads) {
  const MotionCloud moving = someCloud(30000);
  SplatCloud one, many;
  withThreads(1, [&] { one = splatsAt(moving, 3.3); });
  withThreads(2, [&] { many = splatsAt(moving, 3.3); });
  EXPECT_EQ(one.positions, many.positions);
  EXPECT_EQ(one.rotations, many.rotations);
  EXPECT_EQ(one.opacities, many.opacities);
  EXPECT_EQ(one.scales, moving.splats.scales);
  validate(many, "the moment");
}

TEST(MotionCloud, TimesBeyondTheClipAreItsEnds) {
  MotionCloud moving = someCloud(40, 60);
  moving.clip.begin = 2;
  moving.clip.frames_per_second = 30;
  EXPECT_DOUBLE_EQ(moving.clip.end(), 2 + 59.0 / 30);
  EXPECT_DOUBLE_EQ(moving.clip.partOf(3), 0.5);
  EXPECT_EQ(splatsAt(moving, 1).positions, splatsAt(moving, 2).positions);
  EXPECT_EQ(splatsAt(moving, 9).positions, splatsAt(moving, moving.clip.end()).positions);
  EXPECT_NE(splatsAt(moving, 2).positions, splatsAt(moving, 2 + 0.5 / 30).positions);
}

TEST(MotionCloud, RefusesWhatIsOutsideOfItsBounds) {
  const auto messageOf = [](const MotionCloud& moving) -> std::string {
    try {
      validate(moving, "the motion");
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(messageOf(someCloud(5)), "");
  MotionCloud moving = someCloud(5);
  moving.waves[3][2] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(messageOf(moving), HasSubstr("waves"));
  moving = someCloud(5);
  moving.lifespans[1] = 0;
  EXPECT_THAT(messageOf(moving), HasSubstr("the motion has 0 among its lifespans; 1e-06 to 1.1"));
  moving = someCloud(5);
  moving.centres.pop_back();
  EXPECT_THAT(messageOf(moving), HasSubstr("has 4 numbers of centres; 5 are needed"));
  moving = someCloud(5);
  moving.clip.frame_count = 0;
  EXPECT_THAT(messageOf(moving), HasSubstr("a clip of 0 frames"));
  moving = someCloud(5);
  moving.splats.opacities[0] = 2;
  EXPECT_THAT(messageOf(moving), HasSubstr("the motion"));
}

}  // namespace
}  // namespace stipple
