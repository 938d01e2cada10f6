#include "train/picture_store.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>

#include "base/parallel.h"
#include "data/view_check.h"

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

PictureStore::PictureStore(std::shared_ptr<const ViewSource> views, uint64_t byte_limit)
    : views_(std::move(views)), byte_limit_(byte_limit), kept_(views_->count()) {}

PictureStore::~PictureStore() {
  if (awaited_.valid()) awaited_.wait();
}

std::shared_ptr<const PictureStore::Packed> PictureStore::packed(size_t view) const {
  const ViewPicture picture = views_->load(view);
  validateView(views_->camera(view), picture, views_->name(view));
  auto made = std::make_shared<Packed>();
  made->width = picture.width;
  made->height = picture.height;
  made->colour.pack(picture.colour);
  made->alpha.pack(picture.alpha);
  made->weights.pack(picture.weights);
  return made;
}

void PictureStore::prefetch(size_t view) {
  if (kept_[view]) return;
  if (awaited_.valid()) {
    if (awaited_view_ == view ||
        awaited_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) {
      return;
    }
    awaited_ = {};  // nobody came for it
  }
  awaited_view_ = view;
  awaited_ = std::async(std::launch::async, [this, view] { return packed(view); });
}

std::shared_ptr<const PictureStore::Packed> PictureStore::fetch(size_t view) {
  if (kept_[view]) return kept_[view];
  std::shared_ptr<const Packed> made;
  if (awaited_.valid() && awaited_view_ == view) {
    made = awaited_.get();
  } else {
    made = packed(view);
  }
  // What is kept stays: orders are random, so that no other choice would serve more often.
  if (bytes_ + made->byteCount() <= byte_limit_) {
    bytes_ += made->byteCount();
    kept_[view] = made;
  }
  return made;
}

void PictureStore::load(size_t view, const double background[3], TargetPicture& target) {
  const std::shared_ptr<const Packed> packed = fetch(view);
  target.width = packed->width;
  target.height = packed->height;
  packed->colour.unpack(target.colour);
  packed->alpha.unpack(target.alpha);
  packed->weights.unpack(target.weights);
  if (target.alpha.empty()) return;
  parallelFor(target.alpha.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const float through = 1.0f - target.alpha[i];
      for (size_t c = 0; c < 3; ++c) {
        target.colour[i * 3 + c] += through * static_cast<float>(background[c]);
      }
    }
  });
}

}  // namespace stipple
