#pragma once

#include <string>

namespace stipple::platform {

/// What a variable of the environment says, in UTF-8; empty where it is not set. For names of files:
/// std::getenv() gives them in a code page on Windows.
std::string environmentVariable(const char* name);

}  // namespace stipple::platform
