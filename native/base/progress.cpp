#include "base/progress.h"

#include "base/error.h"

namespace stipple {

void Progress::advance(double fraction, const char* stage) {
  throwIfCancelled();
  fraction_.store(part_begin_.load(std::memory_order_relaxed) +
                      part_size_.load(std::memory_order_relaxed) * fraction,
                  std::memory_order_relaxed);
  std::lock_guard<std::mutex> lock(mutex_);
  if (stage_ != stage) stage_ = stage;
}

void Progress::throwIfCancelled() const {
  if (cancelled()) fail(ErrorCode::kCancelled, "cancelled");
}

std::string Progress::stage() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return stage_;
}

void advance(Progress* progress, double fraction, const char* stage) {
  if (progress) progress->advance(fraction, stage);
}

}  // namespace stipple
