#pragma once

#include <cstdint>
#include <string>

#include "data/clouds/splat_cloud.h"
#include "data/tensor_table.h"
#include "io/assets/asset_header.h"
#include "io/assets/octree_tensors.h"

namespace stipple {

/// The stored parts of a learned field: io knows arrays, not algorithms.
struct FieldAsset : OctreeTensors {
  int field_level = 8;         ///< of the octree that the field was made for
  uint32_t gaussians = 4;      ///< K
  int sh_degree = 0;           ///< 0..kMaxShDegree
  uint64_t least_anchors = 1;  ///< budgets of its training
  uint64_t most_anchors = 1;
  bool contracted = false;  ///< the outer half of the root is all around
  bool jitter = true;       ///< anchors are anywhere in their leaf; else in its middle
  bool nested = false;      ///< anchors are drawn in the progressive order; else as is asked for
  uint64_t seed = 0;        ///< nested: of the draws that it learned with
  ColourSpace colour_space = ColourSpace::kDisplay;
  Antialias antialias = Antialias::kMip;
  TensorTable tensors;               ///< "field.*"
  std::string settings_json = "{}";  ///< free for the caller (how the field was made)
  AssetExtras extras;                ///< of the file that it was read from
};

/// `.stipple.safetensors`, version 1, kind "field". Errors: kIo, kFormat, kUnsupported (newer major
/// version, other kind).
void writeFieldAsset(const FieldAsset& asset, const std::string& path);
FieldAsset readFieldAsset(const std::string& path);

}  // namespace stipple
