#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "data/sparse_volume.h"

namespace stipple {

/// A volume as it looks along one axis of its grid, from its lower side and at its own resolution:
/// each column of voxels is one pixel, blended front to back as a renderer of volumes does.
struct VolumeSide {
  double pixel_size = 0;  ///< metres
  double origin[2] = {};  ///< metres, of the centre of pixel (0, 0)
  /// Blocks of 8 x 8 pixels that have voxels, ascending; others are empty.
  std::vector<std::array<int32_t, 2>> blocks;  ///< [B] in blocks
  std::vector<float> pixels;                   ///< [B,8,8,4] premultiplied scene linear, alpha

  /// Between pixel centres straight; in: metres across. Out: value [4].
  void at(double across, double up, double* value) const;
};

/// Along x, y and z; the other two axes follow in the order x, y, z, x.
/// Cost: O(voxels). Same bits for any number of threads.
std::array<VolumeSide, 3> sidesOf(const SparseVolume& volume);

/// Differences of a volume's sides from those of a finer one, four channels per pixel of the finer
/// and 8 around it, in display values: what `setErrors` takes.
std::vector<float> sideDifferences(const std::array<VolumeSide, 3>& sides,
                                   const std::array<VolumeSide, 3>& finer);

}  // namespace stipple
