#include "train/loop/picture_store.h"

#include <chrono>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 15;
constexpr size_t kRowGrain = 8;

/// Means over blocks of `channels` values a pixel; weights: empty, or [H,W].
std::vector<float> blockMeans(const std::vector<float>& values, size_t channels, size_t width,
                              size_t height, size_t factor, const std::vector<float>& weights) {
  const size_t columns = width / factor, rows = height / factor;
  std::vector<float> means(columns * rows * channels);
  parallelFor(rows, kRowGrain, [&](size_t begin, size_t end) {
    for (size_t row = begin; row < end; ++row) {
      for (size_t column = 0; column < columns; ++column) {
        float sum[3] = {0, 0, 0}, plain[3] = {0, 0, 0}, weight = 0;
        for (size_t y = row * factor; y < (row + 1) * factor; ++y) {
          for (size_t x = column * factor; x < (column + 1) * factor; ++x) {
            const size_t pixel = y * width + x;
            const float w = weights.empty() ? 1.0f : weights[pixel];
            weight += w;
            for (size_t c = 0; c < channels; ++c) {
              sum[c] += w * values[pixel * channels + c];
              plain[c] += values[pixel * channels + c];
            }
          }
        }
        float* out = &means[(row * columns + column) * channels];
        for (size_t c = 0; c < channels; ++c) {
          out[c] = weight > 0 ? sum[c] / weight : plain[c] / static_cast<float>(factor * factor);
        }
      }
    }
  });
  return means;
}

}  // namespace

void reducePicture(uint32_t factor, TargetPicture& picture, Camera& camera) {
  const auto means = [&](std::vector<float>& values, size_t channels,
                         const std::vector<float>& weights) {
    if (values.empty()) return;
    values = blockMeans(values, channels, picture.width, picture.height, factor, weights);
  };
  means(picture.colour, 3, picture.weights);
  means(picture.alpha, 1, picture.weights);
  means(picture.weights, 1, {});
  camera = reduced(camera, factor);
  picture.width = camera.width;
  picture.height = camera.height;
}

PictureStore::PictureStore(std::shared_ptr<const ViewSource> views, uint64_t byte_limit)
    : views_(std::move(views)), byte_limit_(byte_limit), kept_(views_->count()) {}

PictureStore::~PictureStore() {
  if (awaited_.valid()) awaited_.wait();
}

void PictureStore::prefetch(size_t view) {
  if (kept_[view]) return;
  if (awaited_.valid()) {
    if (awaited_view_ == view ||
        awaited_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) {
      return;
    }
    try {
      keep(awaited_view_, awaited_.get());  // nobody came for it yet
    } catch (const Error&) {
      // Who loads it will hear of it.
    }
    if (kept_[view]) return;
  }
  awaited_view_ = view;
  awaited_ = std::async(std::launch::async, [this, view] { return views_->packed(view); });
}

std::shared_ptr<const PackedPicture> PictureStore::fetch(size_t view) {
  if (kept_[view]) return kept_[view];
  std::shared_ptr<const PackedPicture> made;
  if (awaited_.valid() && awaited_view_ == view) {
    made = awaited_.get();
  } else {
    made = views_->packed(view);
  }
  keep(view, made);
  return made;
}

void PictureStore::keep(size_t view, const std::shared_ptr<const PackedPicture>& made) {
  // What is kept stays: orders are random, so that no other choice would serve more often.
  if (kept_[view] || bytes_ + made->bytes() > byte_limit_) return;
  bytes_ += made->bytes();
  kept_[view] = made;
}

void PictureStore::load(size_t view, const double background[3], TargetPicture& target) {
  const std::shared_ptr<const PackedPicture> packed = fetch(view);
  target.width = packed->width();
  target.height = packed->height();
  packed->colour().unpack(target.colour);
  packed->alpha().unpack(target.alpha);
  packed->weights().unpack(target.weights);
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
