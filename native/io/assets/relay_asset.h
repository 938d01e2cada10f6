#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "data/clouds/splat_cloud.h"
#include "data/tensor_table.h"
#include "io/assets/asset_header.h"

namespace stipple {

/// What is stored of a long clip beside its key frames: io knows arrays, not algorithms.
struct RelayAssetHead {
  double begin = 0;  ///< seconds
  double frames_per_second = 1;
  uint32_t frame_count = 1;
  uint32_t first_key = 0;  ///< the frame of the first key frame
  uint32_t spacing = 1;    ///< frames from one key frame to the next
  uint32_t blend = 0;      ///< 0 learned, 1 linear, 2 none, 3 plateau
  uint32_t gaussians = 1;
  int sh_degree = 0;
  ColourSpace colour_space = ColourSpace::kDisplay;
  Antialias antialias = Antialias::kClassic;
  std::vector<uint64_t> anchor_counts;  ///< [keys]
  std::array<double, 6> bounds{};       ///< of all anchors: lowest 3, highest 3
  std::string settings_json = "{}";     ///< free for the caller (how it was made)
  AssetExtras extras;  ///< of the file that it was read from, but for tensors of key frames
};

/// `.stipple.safetensors`, version 1, kind "relay". In: key: tensors of a key frame, the same each
/// time that it is asked for; one key frame at a time is kept.
/// Errors: kIo; kInvalidArgument for heads that do not fit the key frames; those of key.
void writeRelayAsset(const RelayAssetHead& head,
                     const std::function<TensorTable(uint32_t number)>& key,
                     const std::string& path);

/// An asset whose key frames are read when they are wanted. Errors: kIo, kFormat, kUnsupported.
class RelayAsset {
 public:
  explicit RelayAsset(const std::string& path);
  ~RelayAsset();

  const RelayAssetHead& head() const { return head_; }
  /// Of the key frame, names without its prefix.
  TensorTable key(uint32_t number) const;

 private:
  std::unique_ptr<const SafeTensorsReader> file_;
  RelayAssetHead head_;
};

}  // namespace stipple
