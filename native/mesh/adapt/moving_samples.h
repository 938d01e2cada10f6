#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "math/vec.h"

namespace stipple {

/// A place on a mesh that follows its vertices.
struct SurfaceSample {
  uint32_t triangle = 0;
  std::array<double, 3> weights{};  ///< of the triangle's corners, sum 1

  Vec3d at(std::span<const uint32_t> triangles, std::span<const Vec3d> positions) const {
    const uint32_t* corner = &triangles[size_t{triangle} * 3];
    return weights[0] * positions[corner[0]] + weights[1] * positions[corner[1]] +
           weights[2] * positions[corner[2]];
  }
};

/// Samples evenly spread over the area of a mesh: one for each equal share of it, anywhere in it.
/// In: triangles [F,3]; count > 0. Out: [count], in the order of the triangles; empty where the
/// mesh has no area. Threads and determinism: parallel; same result for any number of threads.
std::vector<SurfaceSample> spreadSamples(std::span<const uint32_t> triangles,
                                         std::span<const Vec3d> positions, size_t count,
                                         uint64_t seed);

/// Twice the area vector of a triangle: across it, counterclockwise corners seen against it.
Vec3d areaVector(std::span<const uint32_t> triangles, std::span<const Vec3d> positions,
                 uint32_t triangle);

/// Derivatives of a triangle's unit normal, times `by_normal`, by its three corners. In: floor,
/// twice an area: smaller triangles than that turn as easily as it does, since one without area
/// would turn infinitely fast.
std::array<Vec3d, 3> normalGradient(std::span<const uint32_t> triangles,
                                    std::span<const Vec3d> positions, uint32_t triangle,
                                    const Vec3d& by_normal, double floor);

}  // namespace stipple
