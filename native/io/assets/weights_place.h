#pragma once

#include <mutex>
#include <string>

namespace stipple {

/// Where the user's files of networks' weights lie; it may be set while other threads ask.
class WeightsPlace {
 public:
  WeightsPlace() { setByEnvironment(); }

  /// "": nobody has said.
  std::string folder() const;
  void set(const std::string& folder);
  /// The folder that the environment variable STIPPLE_WEIGHTS names, or "".
  void setByEnvironment();

 private:
  mutable std::mutex mutex_;
  std::string folder_;
};

}  // namespace stipple
