#pragma once

#include <string>

#include "data/meshes/point_set.h"
#include "io/assets/asset_header.h"
#include "io/assets/octree_tensors.h"

namespace stipple {

/// The stored parts of a surface model: io knows arrays, not algorithms.
struct SurfaceAsset : OctreeTensors {
  PointSet surface;
  std::string settings_json = "{}";  ///< free for the caller (how the model was made)
  AssetExtras extras;                ///< of the file that it was read from
};

/// `.stipple.safetensors`, version 1, kind "surface". Errors: kIo, kFormat, kUnsupported (newer
/// major version).
void writeSurfaceAsset(const SurfaceAsset& asset, const std::string& path);
SurfaceAsset readSurfaceAsset(const std::string& path);

}  // namespace stipple
