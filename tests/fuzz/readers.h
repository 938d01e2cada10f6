#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

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
};

/// Every reader of files from elsewhere, but those of pictures (OpenImageIO) and volumes (OpenVDB),
/// which are the libraries' own.
const std::vector<Reader>& readers();

/// Writes a whole file.
void storeFile(const std::filesystem::path& path, const std::string& bytes);

}  // namespace stipple::fuzz
