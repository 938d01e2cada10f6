#include "io/assets/weights_place.h"

#include <cstdlib>

namespace stipple {

std::string WeightsPlace::folder() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return folder_;
}

void WeightsPlace::set(const std::string& folder) {
  const std::lock_guard<std::mutex> lock(mutex_);
  folder_ = folder;
}

void WeightsPlace::setByEnvironment() {
  const char* folder = std::getenv("STIPPLE_WEIGHTS");
  set(folder != nullptr ? folder : "");
}

}  // namespace stipple
