#pragma once

#include <string>

#include "io/safetensors.h"

namespace stipple {

/// What every Stipple asset (`.stipple.safetensors`, version 1) says of itself.
constexpr char kAssetSurface[] = "surface";
constexpr char kAssetHierarchy[] = "hierarchy";

/// Text of the metadata. Errors: kFormat where it is missing.
const std::string& requireText(const SafeTensorsReader& file, const char* key);

/// The kind of an asset of a version that is supported. Errors: kFormat; kUnsupported for a newer
/// major version.
const std::string& assetKind(const SafeTensorsReader& file);
/// The same of a file that is not open yet. Errors: kIo too.
std::string readAssetKind(const std::string& path);

/// Refuses assets of another kind. Errors: kUnsupported, those of assetKind.
void requireAssetKind(const SafeTensorsReader& file, const char* kind);

/// Writes version and kind.
void setAssetKind(SafeTensorsWriter& file, const char* kind);

}  // namespace stipple
