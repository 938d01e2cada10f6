#include "fit/registration/registration_watch.h"

#include <utility>

namespace stipple {

std::shared_ptr<TriMesh> RegistrationWatch::takeShape() {
  const std::lock_guard<std::mutex> lock(mutex_);
  wants_shape_.store(true, std::memory_order_relaxed);
  return std::exchange(newest_, nullptr);
}

void RegistrationWatch::show(std::shared_ptr<TriMesh> shape) {
  const std::lock_guard<std::mutex> lock(mutex_);
  newest_ = std::move(shape);
  wants_shape_.store(false, std::memory_order_relaxed);
}

}  // namespace stipple
