#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "data/point_set.h"
#include "io/asset_header.h"

namespace stipple {

/// The stored parts of a surface model: io knows arrays, not algorithms.
struct SurfaceAsset {
  std::array<double, 3> root_origin = {0, 0, 0};
  double root_side = 1.0;
  std::vector<std::vector<uint64_t>> cells;           ///< per level
  std::vector<std::vector<float>> log_probabilities;  ///< per level [cells, 8]
  PointSet surface;
  std::string settings_json = "{}";  ///< free for the caller (how the model was made)
  AssetExtras extras;                ///< of the file that it was read from
};

/// `.stipple.safetensors`, version 1, kind "surface". Errors: kIo, kFormat, kUnsupported (newer
/// major version).
void writeSurfaceAsset(const SurfaceAsset& asset, const std::string& path);
SurfaceAsset readSurfaceAsset(const std::string& path);

}  // namespace stipple
