#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "math/vec.h"

namespace stipple {

/// A surface as points, or the points with the triangles that they are samples of.
struct ComparedSurface {
  std::span<const float> points;        ///< [N,3] metres, N > 0
  std::span<const float> normals;       ///< [N,3] or empty; the length 0..1 says how sure it is
  std::span<const float> positions;     ///< [V,3] vertices, or empty: points alone
  std::span<const uint32_t> triangles;  ///< [F,3] of them, F > 0 where there are any
  bool is_oriented = true;              ///< false: a normal and its reverse are the same
};

/// How far two surfaces are from each other.
struct SurfaceDifference {
  double distance = 0;  ///< symmetric Chamfer: the mean of both means of distances, metres
  double squared = 0;   ///< the mean of both means of squared distances, square metres
  double normals =
      0;  ///< mean squared difference of unit normals at nearest places, 0 to 4, of both ways
  bool has_normals = false;  ///< false where either surface knows none: then `normals` is 0
};

/// From the points of each to the nearest place of the other: of its triangles where it has some,
/// else of its points. Threads and determinism: parallel; same result for any number of threads.
/// Cost: O((N + M) log).
SurfaceDifference surfaceDifference(const ComparedSurface& one, const ComparedSurface& other);

}  // namespace stipple
