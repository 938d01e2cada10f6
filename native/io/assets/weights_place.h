#pragma once

#include <mutex>
#include <string>
#include <vector>

namespace stipple {

/// Where the user's files of networks' weights lie; it may be set while other threads ask.
class WeightsPlace {
 public:
  WeightsPlace() { setByEnvironment(); }

  /// "": nobody has said.
  std::string folder() const;
  /// The folder of networks that came with the program; "": none did.
  std::string shipped() const;
  /// Where assets' weights are looked for, one after the other.
  std::vector<std::string> folders() const;
  void set(const std::string& folder);
  /// The folder that the environment variable STIPPLE_WEIGHTS names, or "".
  void setByEnvironment();
  void setShipped(const std::string& folder);

 private:
  mutable std::mutex mutex_;
  std::string folder_, shipped_;
};

}  // namespace stipple
