#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <vector>

#include "data/views/view_source.h"

namespace stipple {

/// Numbers of a picture in as few bytes as keep them: 1 where all are whole 255ths, as those of
/// 8-bit files are; 2, off by at most 1/131070, where all lie in 0..1; else 4.
class PackedNumbers {
 public:
  PackedNumbers() = default;
  explicit PackedNumbers(const std::vector<float>& values) { pack(values); }
  void pack(const std::vector<float>& values);
  size_t size() const { return bytes_.size() / width_; }
  uint64_t byteCount() const { return bytes_.size(); }
  /// Out: values [size()].
  void unpack(std::vector<float>& values) const;

 private:
  size_t width_ = 1;  ///< bytes of a number
  std::vector<uint8_t> bytes_;
};

/// A picture in little room: colours, alpha and weights as PackedNumbers, components of normals as
/// 16 bits (off by at most 1/65534), depths as they are.
class PackedPicture {
 public:
  explicit PackedPicture(const ViewPicture& picture);
  uint32_t width() const { return width_; }
  uint32_t height() const { return height_; }
  const PackedNumbers& colour() const { return colour_; }
  const PackedNumbers& alpha() const { return alpha_; }
  const PackedNumbers& weights() const { return weights_; }
  ViewPicture unpacked() const;
  uint64_t bytes() const;

 private:
  uint32_t width_ = 0;
  uint32_t height_ = 0;
  PackedNumbers colour_, alpha_, weights_;
  std::vector<float> depth_;
  std::vector<int16_t> normals_;
};

/// Pictures by number, up to a size. Those that came first stay: who goes through all pictures in
/// rounds of changing order finds most that way, as what was used last is wanted last again.
/// Every member may be called by any thread.
class PictureCache {
 public:
  explicit PictureCache(uint64_t max_bytes) : max_bytes_(max_bytes) {}
  /// Null where it is not kept.
  std::shared_ptr<const PackedPicture> find(size_t number) const;
  /// Keeps the picture where there is room.
  void offer(size_t number, std::shared_ptr<const PackedPicture> picture);
  uint64_t bytes() const;

 private:
  mutable std::mutex mutex_;
  uint64_t max_bytes_;
  uint64_t bytes_ = 0;
  std::unordered_map<size_t, std::shared_ptr<const PackedPicture>> pictures_;
};

}  // namespace stipple
