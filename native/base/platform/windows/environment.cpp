#include "base/platform/environment.h"

#include <cstdlib>
#include <filesystem>

#include "base/platform/windows/system_name.h"

namespace stipple::platform {

std::string environmentVariable(const char* name) {
  const wchar_t* value = ::_wgetenv(std::filesystem::path(name).c_str());
  return value != nullptr ? utf8Of(value) : "";
}

}  // namespace stipple::platform
