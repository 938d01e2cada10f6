#include "io/assets/weights_reference.h"

#include <algorithm>
#include <filesystem>
#include <vector>

#include "io/assets/weights_folder.h"
#include "io/bytes/input_file.h"
#include "io/bytes/sha256.h"

namespace stipple {

namespace {

constexpr size_t kHashDigits = 64;
constexpr size_t kLongestName = 255;
constexpr char kStage[] = "Checking weights";

std::string nameOf(const std::string& path) {
  return std::filesystem::path(path).filename().string();
}

/// "decoder.safetensors (576148442 bytes, SHA-256 ed0d0c3d...)".
std::string describe(const WeightsReference& weights) {
  constexpr size_t kShownDigits = 16;
  return weights.name + " (" + std::to_string(weights.bytes) + " bytes, SHA-256 " +
         weights.sha256.substr(0, kShownDigits) + "...)";
}

}  // namespace

void validate(const WeightsReference& weights, const std::string& what, ErrorCode code) {
  // It is looked for in a folder of the user's, and nowhere else.
  const bool is_name = !weights.name.empty() && weights.name.size() <= kLongestName &&
                       weights.name.find_first_of(std::string("/\\\0", 3)) == std::string::npos &&
                       weights.name != "." && weights.name != "..";
  if (!is_name) {
    fail(code, what + " names its file of weights '" + weights.name.substr(0, 60) +
                   "'; a file name without folders is needed");
  }
  if (weights.bytes == 0) {
    fail(code, what + " says that its file of weights has 0 bytes; at least 1 is needed");
  }
  const bool is_hash = weights.sha256.size() == kHashDigits &&
                       weights.sha256.find_first_not_of("0123456789abcdef") == std::string::npos;
  if (!is_hash) {
    fail(code, what + " has the weights_sha256 '" + weights.sha256.substr(0, 70) +
                   "'; 64 hexadecimal digits in lower case are needed");
  }
}

WeightsReference referenceOf(const std::string& path, Progress* progress) {
  return {nameOf(path), InputFile(path).size(), sha256OfFile(path, progress, kStage)};
}

std::string findReferenced(const WeightsReference& weights, std::span<const std::string> folders,
                           const std::string& what, Progress* progress) {
  if (folders.empty()) {
    fail(ErrorCode::kUnavailable,
         what + " needs the weights " + describe(weights) +
             ", and no folder of weights is set; set it in the add-on's preferences, or by the "
             "environment variable STIPPLE_WEIGHTS");
  }
  std::vector<std::string> paths;
  std::string places;
  for (const std::string& folder : folders) {
    const std::vector<std::string> found = weightFilesBelow(folder);
    paths.insert(paths.end(), found.begin(), found.end());
    places += (places.empty() ? "'" : " and '") + folder + "'";
  }
  // Hashing takes seconds: the likeliest one first.
  std::stable_partition(paths.begin(), paths.end(),
                        [&](const std::string& path) { return nameOf(path) == weights.name; });
  std::string namesake;
  for (const std::string& path : paths) {
    std::error_code error;
    const uint64_t bytes = std::filesystem::file_size(path, error);
    if (error) continue;
    if (bytes == weights.bytes && sha256OfFile(path, progress, kStage) == weights.sha256) {
      return path;
    }
    if (namesake.empty() && nameOf(path) == weights.name) {
      namesake = "; " + path + " is another file (" + std::to_string(bytes) + " bytes)";
    }
  }
  const bool is_one = folders.size() == 1;
  fail(ErrorCode::kUnavailable, what + " needs the weights " + describe(weights) +
                                    ", which the folder" + (is_one ? " " : "s ") + places +
                                    (is_one ? " does" : " do") + " not have" + namesake);
}

}  // namespace stipple
