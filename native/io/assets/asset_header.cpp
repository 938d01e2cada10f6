#include "io/assets/asset_header.h"

#include <charconv>
#include <cstdlib>

#include "base/error.h"

namespace stipple {

namespace {

constexpr int kMajorVersion = 1;
constexpr char kVersion[] = "1.0";
constexpr char kChecksumVersion[] = "1.1";
constexpr char kVersionKey[] = "stipple_version";

/// Minor number of a version text that majorVersion() has accepted; 0 where there is none.
int minorVersion(const std::string& text) {
  const size_t dot = text.find('.');
  return dot == std::string::npos ? 0 : std::atoi(text.c_str() + dot + 1);
}

int majorVersion(const SafeTensorsReader& file) {
  const std::string& text = requireText(file, kVersionKey);
  const size_t dot = text.find('.');
  const std::string major = text.substr(0, dot);
  const bool digits = !major.empty() && major.size() < 6 &&
                      major.find_first_not_of("0123456789") == std::string::npos;
  if (!digits) {
    fail(ErrorCode::kFormat, file.path() + " has the stipple_version '" + text.substr(0, 20) +
                                 "'; a number such as 1.0 is needed");
  }
  return std::stoi(major);
}

}  // namespace

const std::string& requireText(const SafeTensorsReader& file, const char* key) {
  const auto found = file.metadata().find(key);
  if (found == file.metadata().end()) {
    fail(ErrorCode::kFormat,
         file.path() + " is not a Stipple asset: its metadata has no '" + key + "'");
  }
  return found->second;
}

uint64_t requireWhole(const SafeTensorsReader& file, const char* key, uint64_t least,
                      uint64_t most) {
  const std::string& text = requireText(file, key);
  uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < least || value > most) {
    fail(ErrorCode::kFormat, file.path() + " has " + key + " = " + text.substr(0, 40) + "; " +
                                 std::to_string(least) + " to " + std::to_string(most) +
                                 " is needed");
  }
  return value;
}

bool isFirstText(const SafeTensorsReader& file, const char* key, const std::string& first,
                 const std::string& second) {
  const std::string& text = requireText(file, key);
  if (text != first && text != second) {
    fail(ErrorCode::kFormat, file.path() + " has the " + key + " '" + text.substr(0, 40) + "'; '" +
                                 first + "' or '" + second + "' is needed");
  }
  return text == first;
}

const std::string& assetKind(const SafeTensorsReader& file) {
  const int version = majorVersion(file);
  if (version != kMajorVersion) {
    fail(ErrorCode::kUnsupported, file.path() + " is a Stipple asset of version " +
                                      std::to_string(version) +
                                      "; version 1 is supported by this release");
  }
  return requireText(file, "kind");
}

std::string readAssetKind(const std::string& path) {
  return assetKind(SafeTensorsReader(path));
}

void requireAssetKind(const SafeTensorsReader& file, const char* kind) {
  const std::string& seen = assetKind(file);
  if (seen != kind) {
    fail(ErrorCode::kUnsupported, file.path() + " is a Stipple asset of kind '" +
                                      seen.substr(0, 40) + "'; '" + kind + "' is needed");
  }
}

AssetExtras readAssetExtras(const SafeTensorsReader& file) {
  return {file.metadata(), file.readOthers()};
}

void addAssetExtras(SafeTensorsWriter& file, const AssetExtras& extras) {
  const auto version = extras.metadata.find(kVersionKey);
  if (version != extras.metadata.end() && minorVersion(version->second) > minorVersion(kVersion)) {
    file.setMetadata(kVersionKey, version->second);
  }
  for (const auto& [key, value] : extras.metadata) file.carryMetadata(key, value);
  for (const auto& [name, tensor] : extras.tensors) file.carry(name, tensor);
}

void setAssetKind(SafeTensorsWriter& file, const char* kind) {
  file.setMetadata(kVersionKey, kVersion);
  file.setMetadata("kind", kind);
}

void setAssetChecksum(SafeTensorsWriter& file) {
  file.setMetadata(kVersionKey, kChecksumVersion);
  file.addChecksum();
}

void requireAssetChecksum(const SafeTensorsReader& file) {
  const bool needs_one =
      minorVersion(requireText(file, kVersionKey)) >= minorVersion(kChecksumVersion);
  if (!file.checksumIsRight(needs_one)) {
    fail(ErrorCode::kFormat, file.path() +
                                 " is damaged: what it holds is not what was written (its checksum "
                                 "differs)");
  }
}

}  // namespace stipple
