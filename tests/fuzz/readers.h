#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "json_mutation.h"

namespace stipple::fuzz {

/// A reader to be fuzzed: a row of the table in readers.cpp.
struct Reader {
  std::string name;
  /// Puts what the input needs beside it into an empty folder; null: nothing.
  std::function<void(const std::filesystem::path& folder)> prepare;
  /// Puts the input into the folder under the name (or names) that the reader looks for.
  std::function<void(const std::filesystem::path& folder, const std::string& bytes)> store;
  /// Reads it, and checks that what comes back keeps its promises. Errors: those of the reader.
  std::function<void(const std::filesystem::path& folder)> read;
  /// Small valid inputs, made in the folder. Each is an input of its own.
  std::function<std::vector<std::string>(const std::filesystem::path& folder)> seeds;
  /// Where its files hold JSON, whose values are changed one by one.
  JsonPlace json = JsonPlace::kNowhere;
};

/// Every reader of files from elsewhere, but those of images in 8 and 16 bits (OpenImageIO), which
/// are the library's own.
const std::vector<Reader>& readers();

/// Writes a whole file.
void storeFile(const std::filesystem::path& path, const std::string& bytes);

}  // namespace stipple::fuzz
