#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "base/error.h"
#include "motion/surface_binding.h"

// Splats bound to meshes that are deformed badly, with traps on: what comes out is a cloud that
// every other part takes, and shapes stay within the bounds of stretch.

namespace stipple {
namespace {

struct Cage {
  std::vector<float> positions;
  std::vector<uint32_t> triangles;
};

/// A box of the unit cube, two triangles a side.
Cage unitBox() {
  Cage cage;
  for (int corner = 0; corner < 8; ++corner) {
    for (int axis = 0; axis < 3; ++axis) {
      cage.positions.push_back(static_cast<float>((corner >> axis) & 1));
    }
  }
  cage.triangles = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                    2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
  return cage;
}

SplatCloud splatsInside() {
  SplatCloud cloud;
  cloud.sh_degree = 1;
  constexpr int kSide = 5;
  cloud.resize(kSide * kSide * kSide);
  for (int i = 0; i < kSide * kSide * kSide; ++i) {
    const auto row = static_cast<size_t>(i);
    const int steps[3] = {i % kSide, i / kSide % kSide, i / kSide / kSide};
    for (size_t axis = 0; axis < 3; ++axis) {
      cloud.positions[3 * row + axis] = static_cast<float>(steps[axis]) / (kSide - 1);
      // Balls, discs and points.
      cloud.scales[3 * row + axis] = i % 3 == 0 ? 0.05f : axis == 2 || i % 3 == 2 ? 0.0f : 0.1f;
    }
    cloud.rotations[4 * row] = 1;
    cloud.opacities[row] = 0.5f;
  }
  for (size_t i = 0; i < cloud.sh.size(); ++i) cloud.sh[i] = 0.25f * static_cast<float>(i % 5);
  return cloud;
}

struct BadDeformation {
  const char* name;
  std::function<void(float*)> move;
};

std::vector<BadDeformation> badDeformations() {
  return {
      {"at rest", [](float*) {}},
      {"all in one point", [](float* p) { p[0] = p[1] = p[2] = 1; }},
      {"all on a line", [](float* p) { p[1] = p[2] = 0; }},
      {"flattened", [](float* p) { p[2] = 0; }},
      {"turned inside out", [](float* p) { p[0] = -p[0]; }},
      {"folded over itself", [](float* p) { p[2] = p[0] > 0.5f ? 2 - p[2] : p[2] - 3; }},
      {"twisted by half a turn",
       [](float* p) {
         if (p[2] > 0.5f) p[0] = 1 - p[0], p[1] = 1 - p[1];
       }},
      {"a million times as large", [](float* p) { p[0] *= 1e6f, p[1] *= 1e6f, p[2] *= 1e6f; }},
      {"a millionth as large", [](float* p) { p[0] *= 1e-6f, p[1] *= 1e-6f, p[2] *= 1e-6f; }},
      {"far away", [](float* p) { p[0] += 1e6f, p[1] -= 1e6f; }},
      {"one corner pulled away",
       [](float* p) {
         if (p[0] * p[1] * p[2] > 0) p[0] = 1e4f;
       }},
  };
}

TEST(Binding, SplatsOfBadDeformationsAreStillSplats) {
  const Cage cage = unitBox();
  const SplatCloud cloud = splatsInside();
  for (const BindingReach reach : {BindingReach::kSurface, BindingReach::kAround}) {
    const SurfaceBinding binding =
        bindToSurface(cloud.positions, cage.positions, cage.triangles, reach);
    validate(binding, cloud.size(), "the binding");
    for (const BadDeformation& bad : badDeformations()) {
      SCOPED_TRACE(bad.name);
      std::vector<float> deformed = cage.positions;
      for (size_t i = 0; i < deformed.size(); i += 3) bad.move(&deformed[i]);
      const SplatCloud carried = carriedSplats(cloud, binding, deformed);
      EXPECT_NO_THROW(validate(carried, bad.name));
      for (size_t row = 0; row < cloud.size(); ++row) {
        float before = 0, after = 0;
        for (size_t axis = 0; axis < 3; ++axis) {
          before = std::max(before, cloud.scales[3 * row + axis]);
          after = std::max(after, carried.scales[3 * row + axis]);
        }
        constexpr auto kBound = static_cast<float>(kLargestStretch);
        EXPECT_LE(after, 1.0001f * kBound * before);
        EXPECT_GE(after, 0.9999f / kBound * before);
      }
    }
  }
}

TEST(Binding, MeshesOfAnySizeCarryAlike) {
  const Cage cage = unitBox();
  const SplatCloud cloud = splatsInside();
  for (const float size : {1e-6f, 1.0f, 1e6f}) {
    SCOPED_TRACE(size);
    Cage sized = cage;
    for (float& value : sized.positions) value *= size;
    SplatCloud splats = cloud;
    for (float& value : splats.positions) value *= size;
    for (float& value : splats.scales) value *= size;
    const SurfaceBinding binding =
        bindToSurface(splats.positions, sized.positions, sized.triangles, BindingReach::kAround);
    // A quarter turn about z.
    std::vector<float> deformed = sized.positions;
    for (size_t i = 0; i < deformed.size(); i += 3) {
      const float x = deformed[i];
      deformed[i] = -deformed[i + 1];
      deformed[i + 1] = x;
    }
    const SplatCloud carried = carriedSplats(splats, binding, deformed);
    for (size_t row = 0; row < cloud.size(); ++row) {
      EXPECT_NEAR(carried.positions[3 * row], -splats.positions[3 * row + 1], 2e-6f * size);
      EXPECT_NEAR(carried.positions[3 * row + 1], splats.positions[3 * row], 2e-6f * size);
      EXPECT_NEAR(carried.scales[3 * row], splats.scales[3 * row], 2e-6f * size);
    }
  }
}

TEST(Binding, MeshesWithoutAreaAreRefused) {
  const SplatCloud cloud = splatsInside();
  Cage cage = unitBox();
  for (size_t i = 0; i < cage.positions.size(); i += 3)
    cage.positions[i] = cage.positions[i + 1] = 0;
  for (const BindingReach reach : {BindingReach::kSurface, BindingReach::kAround}) {
    EXPECT_THROW(bindToSurface(cloud.positions, cage.positions, cage.triangles, reach), Error);
  }
}

}  // namespace
}  // namespace stipple
