#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <vector>

#include "data/view_source.h"

namespace stipple {

/// A picture in about half the room: values of 0..1 as 16 bits. Values of 8 and 16 bits of a file
/// come back as they were, others within 1 / 131070.
class PackedPicture {
 public:
  explicit PackedPicture(const ViewPicture& picture);
  ViewPicture unpacked() const;
  uint64_t bytes() const;

 private:
  /// One array, as 16 bits where every value is from 0 to 1.
  struct Values {
    std::vector<uint16_t> shares;
    std::vector<float> floats;
  };
  static Values pack(const std::vector<float>& values);
  static std::vector<float> unpack(const Values& values);

  uint32_t width_ = 0;
  uint32_t height_ = 0;
  Values colour_, alpha_, weights_;
  std::vector<float> depth_, normals_;
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
