#include "io/packed_picture.h"

#include <algorithm>
#include <atomic>
#include <utility>

#include "base/parallel.h"

namespace stipple {

namespace {

constexpr float kFull = 65535.0f;
constexpr size_t kValuesPerTask = size_t{1} << 18;

}  // namespace

PackedPicture::Values PackedPicture::pack(const std::vector<float>& values) {
  Values packed;
  packed.shares.resize(values.size());
  std::atomic<bool> all_shares{true};
  parallelFor(values.size(), kValuesPerTask, [&](size_t begin, size_t end) {
    // No early end, so that the compiler makes vector code.
    bool shares = true;
    for (size_t i = begin; i < end; ++i) {
      shares = shares & (values[i] >= 0.0f) & (values[i] <= 1.0f);
      const float inside = std::min(1.0f, std::max(0.0f, values[i]));
      packed.shares[i] = static_cast<uint16_t>(static_cast<int32_t>(inside * kFull + 0.5f));
    }
    if (!shares) all_shares = false;
  });
  if (!all_shares) packed = {{}, values};
  return packed;
}

std::vector<float> PackedPicture::unpack(const Values& values) {
  if (values.shares.empty()) return values.floats;
  std::vector<float> unpacked(values.shares.size());
  parallelFor(unpacked.size(), kValuesPerTask, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      unpacked[i] = static_cast<float>(int32_t{values.shares[i]}) / kFull;
    }
  });
  return unpacked;
}

PackedPicture::PackedPicture(const ViewPicture& picture)
    : width_(picture.width),
      height_(picture.height),
      colour_(pack(picture.colour)),
      alpha_(pack(picture.alpha)),
      weights_(pack(picture.weights)),
      depth_(picture.depth),
      normals_(picture.normals) {}

ViewPicture PackedPicture::unpacked() const {
  ViewPicture picture;
  picture.width = width_;
  picture.height = height_;
  picture.colour = unpack(colour_);
  picture.alpha = unpack(alpha_);
  picture.weights = unpack(weights_);
  picture.depth = depth_;
  picture.normals = normals_;
  return picture;
}

uint64_t PackedPicture::bytes() const {
  uint64_t shares = 0, floats = depth_.size() + normals_.size();
  for (const Values* values : {&colour_, &alpha_, &weights_}) {
    shares += values->shares.size();
    floats += values->floats.size();
  }
  return sizeof(*this) + shares * sizeof(uint16_t) + floats * sizeof(float);
}

std::shared_ptr<const PackedPicture> PictureCache::find(size_t number) const {
  const std::lock_guard lock(mutex_);
  const auto found = pictures_.find(number);
  return found == pictures_.end() ? nullptr : found->second;
}

void PictureCache::offer(size_t number, std::shared_ptr<const PackedPicture> picture) {
  const uint64_t size = picture->bytes();
  const std::lock_guard lock(mutex_);
  if (size > max_bytes_ - bytes_) return;
  if (pictures_.emplace(number, std::move(picture)).second) bytes_ += size;
}

uint64_t PictureCache::bytes() const {
  const std::lock_guard lock(mutex_);
  return bytes_;
}

}  // namespace stipple
