#include "train/loop/picture_store.h"

#include <chrono>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 15;

}  // namespace

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
