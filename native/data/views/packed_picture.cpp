#include "data/views/packed_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <utility>

#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 15;

/// Whole 255ths as division gives them, for finding them again bit for bit.
const std::array<float, 256>& eighthBitSteps() {
  static const std::array<float, 256> steps = [] {
    std::array<float, 256> made{};
    for (size_t i = 0; i < made.size(); ++i) made[i] = static_cast<float>(i) / 255.0f;
    return made;
  }();
  return steps;
}

bool inUnitRange(float value) {
  return value >= 0.0f && value <= 1.0f;
}

/// Bytes that numbers [begin, end) need.
size_t widthOf(const std::vector<float>& values, size_t begin, size_t end) {
  size_t width = 1;
  for (size_t i = begin; i < end; ++i) {
    if (!inUnitRange(values[i])) return 4;
    const auto step = static_cast<size_t>(values[i] * 255.0f + 0.5f);
    if (eighthBitSteps()[step] != values[i]) width = 2;
  }
  return width;
}

constexpr float kFullNormal = 32767.0f;

int16_t packedComponent(float value) {
  return static_cast<int16_t>(std::lround(std::clamp(value, -1.0f, 1.0f) * kFullNormal));
}

}  // namespace

void PackedNumbers::pack(const std::vector<float>& values) {
  std::vector<size_t> widths(rangeCount(values.size(), kGrain), 1);
  parallelFor(values.size(), kGrain, [&](size_t begin, size_t end) {
    widths[begin / kGrain] = widthOf(values, begin, end);
  });
  width_ = widths.empty() ? 1 : *std::max_element(widths.begin(), widths.end());
  bytes_.resize(values.size() * width_);
  parallelFor(values.size(), kGrain, [&](size_t begin, size_t end) {
    uint8_t* out = bytes_.data() + begin * width_;
    if (width_ == 4) {
      std::memcpy(out, values.data() + begin, (end - begin) * sizeof(float));
      return;
    }
    for (size_t i = begin; i < end; ++i, out += width_) {
      if (width_ == 1) {
        *out = static_cast<uint8_t>(values[i] * 255.0f + 0.5f);
      } else {
        const auto step = static_cast<uint16_t>(values[i] * 65535.0f + 0.5f);
        std::memcpy(out, &step, sizeof(step));
      }
    }
  });
}

void PackedNumbers::unpack(std::vector<float>& values) const {
  values.resize(size());
  parallelFor(values.size(), kGrain, [&](size_t begin, size_t end) {
    const uint8_t* in = bytes_.data() + begin * width_;
    if (width_ == 4) {
      std::memcpy(values.data() + begin, in, (end - begin) * sizeof(float));
      return;
    }
    for (size_t i = begin; i < end; ++i, in += width_) {
      if (width_ == 1) {
        values[i] = eighthBitSteps()[*in];
      } else {
        uint16_t step = 0;
        std::memcpy(&step, in, sizeof(step));
        values[i] = static_cast<float>(step) / 65535.0f;
      }
    }
  });
}

PackedPicture::PackedPicture(const ViewPicture& picture)
    : width_(picture.width),
      height_(picture.height),
      colour_(picture.colour),
      alpha_(picture.alpha),
      weights_(picture.weights),
      depth_(picture.depth),
      normals_(picture.normals.size()) {
  parallelFor(normals_.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) normals_[i] = packedComponent(picture.normals[i]);
  });
}

ViewPicture PackedPicture::unpacked() const {
  ViewPicture picture;
  picture.width = width_;
  picture.height = height_;
  colour_.unpack(picture.colour);
  alpha_.unpack(picture.alpha);
  weights_.unpack(picture.weights);
  picture.depth = depth_;
  picture.normals.resize(normals_.size());
  parallelFor(normals_.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      picture.normals[i] = static_cast<float>(normals_[i]) / kFullNormal;
    }
  });
  return picture;
}

uint64_t PackedPicture::bytes() const {
  return sizeof(*this) + colour_.byteCount() + alpha_.byteCount() + weights_.byteCount() +
         depth_.size() * sizeof(float) + normals_.size() * sizeof(int16_t);
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
