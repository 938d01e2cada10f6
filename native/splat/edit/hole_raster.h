#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "math/vec.h"

namespace stipple {

/// Cells of the ground around a hole.
struct HoleRaster {
  enum class Cell : uint8_t {
    kEmpty,  ///< nothing was ever there
    kSolid,  ///< ground is there
    kThing,  ///< ground is there, and something stands on it
    kHole,   ///< ground is missing
  };

  double u0 = 0, v0 = 0;  ///< the corner
  double side = 1;        ///< of a cell, metres
  size_t width = 0, height = 0;
  std::vector<Cell> cells;  ///< [height,width]

  size_t size() const { return width * height; }
  /// The cell of a place inside.
  size_t cellAt(double u, double v) const;
  bool has(double u, double v) const;
  size_t count(Cell kind) const;
};

/// What lies in each cell of a raster. [height,width]
struct HoleCounts {
  std::vector<float> left;           ///< splats of the ground that are left
  std::vector<float> removed;        ///< removed ones of the ground
  std::vector<float> above;          ///< removed ones at any height
  std::vector<float> things;         ///< splats that are left close above the ground
  std::vector<float> left_cover;     ///< 0..1: how much of the cell the ground that is left covers
  std::vector<float> removed_cover;  ///< the same of the removed ground
};

/// Says which cells are missing. Where there are splats that are left and removed ones, the larger
/// number decides, cells nearby counting less; where nothing is left, a removed splat at any
/// height, and being surrounded: what stood there has hidden the ground.
void labelCells(HoleRaster& raster, const HoleCounts& counts);

}  // namespace stipple
