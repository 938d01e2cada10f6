#include "base/platform/environment.h"

#include <cstdlib>

namespace stipple::platform {

std::string environmentVariable(const char* name) {
  const char* value = std::getenv(name);
  return value != nullptr ? value : "";
}

}  // namespace stipple::platform
