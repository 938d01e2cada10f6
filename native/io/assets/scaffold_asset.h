#pragma once

#include <cstdint>
#include <string>

#include "data/clouds/splat_cloud.h"
#include "data/tensor_table.h"
#include "io/assets/asset_header.h"

namespace stipple {

/// The stored parts of anchors with features: io knows arrays, not algorithms.
struct ScaffoldAsset {
  uint32_t gaussians = 1;  ///< K
  int sh_degree = 0;       ///< 0..kMaxShDegree
  ColourSpace colour_space = ColourSpace::kDisplay;
  Antialias antialias = Antialias::kClassic;
  uint32_t coarsening_percent = 0;   ///< how splats of fewer anchors grow: 0 to 100
  TensorTable tensors;               ///< "scaffold.*", the first P rows a budget
  std::string settings_json = "{}";  ///< free for the caller (how it was made)
  AssetExtras extras;                ///< of the file that it was read from
};

/// `.stipple.safetensors`, version 1, kind "scaffold". Errors: kIo, kFormat, kUnsupported (newer
/// major version, other kind).
void writeScaffoldAsset(const ScaffoldAsset& asset, const std::string& path);
ScaffoldAsset readScaffoldAsset(const std::string& path);

}  // namespace stipple
