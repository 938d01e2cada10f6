#pragma once

#include <cstdint>
#include <string>

#include "data/latent.h"
#include "io/assets/asset_header.h"
#include "io/assets/weights_reference.h"

namespace stipple {

/// The stored parts of a latent: io knows arrays, not networks.
struct LatentAsset {
  Latent latent;
  WeightsReference weights;
  std::string settings_json = "{}";  ///< free for the caller (how the latent was made)
  AssetExtras extras;                ///< of the file that it was read from
};

constexpr uint64_t kMaxLatentTokens = 65536;
constexpr uint32_t kMaxLatentWidth = 1024;

/// `.stipple.safetensors`, version 1, kind "latent". Errors: kIo, kFormat, kUnsupported (newer
/// major version, other kind); kInvalidArgument for an asset that is not whole.
void writeLatentAsset(const LatentAsset& asset, const std::string& path);
LatentAsset readLatentAsset(const std::string& path);

}  // namespace stipple
