#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "data/clouds/splat_cloud.h"
#include "io/assets/asset_header.h"

namespace stipple {

/// The stored parts of a cloud with its merge tree: io knows arrays, not algorithms.
struct HierarchyAsset {
  SplatCloud leaves;                 ///< [N] the cloud itself, bit for bit
  SplatCloud nodes;                  ///< [N-1] inner nodes in the order in which they are split
  std::vector<uint32_t> parents;     ///< [2N-1] inner nodes, then leaves; 2^32-1: the root
  std::vector<float> errors;         ///< [N-1]
  std::string settings_json = "{}";  ///< free for the caller (how the tree was made)
  AssetExtras extras;                ///< of the file that it was read from
};

/// `.stipple.safetensors`, version 1, kind "hierarchy". Errors: kIo, kFormat, kUnsupported (newer
/// major version, other kind).
void writeHierarchyAsset(const HierarchyAsset& asset, const std::string& path);
HierarchyAsset readHierarchyAsset(const std::string& path);

}  // namespace stipple
