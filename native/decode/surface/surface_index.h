#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "data/meshes/point_set.h"
#include "density/octree_density.h"

namespace stipple {

/// Surface samples in Morton order, in the units of the root cube (lengths over its side), so that
/// the numbers keep their precision wherever the object stands.
struct SurfaceIndex {
  static constexpr int kCodeLevel = kMaxLeafLevel;

  RootCube root;
  int leaf_level = 0;
  std::vector<uint64_t> codes;   ///< [S] ascending, at kCodeLevel
  std::vector<float> positions;  ///< [S,3] in the unit cube
  std::vector<float> normals;    ///< [S,3]
  std::vector<float> colours;    ///< [S,3] scene linear
  std::vector<float> opacities;  ///< [S]
  std::vector<float> areas;      ///< [S] unit cube squared
  std::vector<float> harmonics;  ///< [S,harmonic_stride] of display values, from degree 1 on
  size_t harmonic_stride = 0;
  int harmonic_degree = 0;
  /// [S] area of surface per unit of probability: P splats stand sqrt(spread / P) apart here.
  std::vector<float> spreads;
  double area = 0;  ///< of all samples
  /// 1 where normals point out of a body, −1 where into it, 0 for sheets that enclose nothing.
  float outward = 0;

  size_t size() const { return opacities.size(); }
};

SurfaceIndex makeSurfaceIndex(const PointSet& surface, const RootCube& root, int leaf_level);

/// Morton code at `level` of a place in the unit cube (clamped into it).
uint64_t unitCubeCode(const float* position, int level);

}  // namespace stipple
