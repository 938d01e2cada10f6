#pragma once

#include <array>
#include <cstddef>

#include "data/clouds/splat_cloud.h"

namespace stipple {

/// Harmonics above degree 0 of the highest degree.
constexpr size_t kMaxShColumns = 24;

/// Splats as Blender keeps them: an array for each attribute, each harmonic one of its own.
/// Float: const float for splats that are given, float for room to put them; null: not wanted.
template <class Float>
struct CloudColumns {
  Float* positions = nullptr;                ///< [N,3]
  Float* rotations = nullptr;                ///< [N,4]
  Float* scales = nullptr;                   ///< [N,3]
  Float* base = nullptr;                     ///< [N,4] harmonics of degree 0, opacity
  std::array<Float*, kMaxShColumns> rest{};  ///< [N,3] each; as many as the degree has
};

/// The cloud of columns that are all there. Values are copied as they are, whatever they are.
SplatCloud cloudFromColumns(const CloudColumns<const float>& columns, size_t count, int sh_degree);

/// Copies what is wanted of a cloud; harmonics that the cloud does not have are zeros.
void readColumns(const SplatCloud& cloud, const CloudColumns<float>& columns);

}  // namespace stipple
