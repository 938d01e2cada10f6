#pragma once

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "base/error.h"
#include "readers.h"

// What the makers of rows of the table of readers share.

namespace stipple::fuzz {

inline std::string load(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

inline auto storeAs(const char* name) {
  return [name](const std::filesystem::path& folder, const std::string& bytes) {
    storeFile(folder / name, bytes);
  };
}

/// A result that breaks its promises is no fault of the file: it must not look like one.
template <typename Check>
void keepsPromises(const Check& check) {
  try {
    check();
  } catch (const Error& error) {
    fail(ErrorCode::kInternal, error.what());
  }
}

}  // namespace stipple::fuzz
