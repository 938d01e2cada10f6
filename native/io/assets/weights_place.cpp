#include "io/assets/weights_place.h"

#include <algorithm>

#include "base/platform/environment.h"

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
  set(platform::environmentVariable("STIPPLE_WEIGHTS"));
}

std::string WeightsPlace::shipped() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return shipped_;
}

void WeightsPlace::setShipped(const std::string& folder) {
  const std::lock_guard<std::mutex> lock(mutex_);
  shipped_ = folder;
}

std::vector<std::string> WeightsPlace::folders() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::vector<std::string> all;
  for (const std::string* each : {&folder_, &shipped_}) {
    if (!each->empty() && std::find(all.begin(), all.end(), *each) == all.end())
      all.push_back(*each);
  }
  return all;
}

}  // namespace stipple
