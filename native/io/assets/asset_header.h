#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "io/bytes/safetensors.h"

namespace stipple {

/// What every Stipple asset (`.stipple.safetensors`, version 1) says of itself.
constexpr char kAssetSurface[] = "surface";
constexpr char kAssetHierarchy[] = "hierarchy";
constexpr char kAssetField[] = "field";
constexpr char kAssetLatent[] = "latent";
constexpr char kAssetMotion[] = "motion";
constexpr char kAssetScaffold[] = "scaffold";
constexpr char kAssetRelay[] = "relay";
constexpr char kAssetCheckpoint[] = "checkpoint";

/// Text of the metadata. Errors: kFormat where it is missing.
const std::string& requireText(const SafeTensorsReader& file, const char* key);

/// A whole number of the metadata. Errors: kFormat where it is none from `least` to `most`.
uint64_t requireWhole(const SafeTensorsReader& file, const char* key, uint64_t least,
                      uint64_t most);

/// Whether a text of the metadata is the first of the two that it may be. Errors: kFormat.
bool isFirstText(const SafeTensorsReader& file, const char* key, const std::string& first,
                 const std::string& second);

/// The kind of an asset of a version that is supported. Errors: kFormat; kUnsupported for a newer
/// major version.
const std::string& assetKind(const SafeTensorsReader& file);
/// The same of a file that is not open yet. Errors: kIo too.
std::string readAssetKind(const std::string& path);

/// Refuses assets of another kind. Errors: kUnsupported, those of assetKind.
void requireAssetKind(const SafeTensorsReader& file, const char* kind);

/// What a file says, and the tensors in it that this version does not know: kept from loading to
/// saving, so that nothing that a newer version wrote is lost here.
struct AssetExtras {
  std::map<std::string, std::string> metadata;
  std::map<std::string, CarriedTensor> tensors;
};

/// In: file, from which all tensors that are known have been read.
AssetExtras readAssetExtras(const SafeTensorsReader& file);
/// Adds what `file` does not have yet, and the file's version where it is newer. In: file, with all
/// that this version writes; extras, which must live until it is written.
void addAssetExtras(SafeTensorsWriter& file, const AssetExtras& extras);

/// Writes version and kind.
void setAssetKind(SafeTensorsWriter& file, const char* kind);

/// Gives an asset a checksum, and the version 1.1, from which on one without it is damaged. After
/// setAssetKind.
void setAssetChecksum(SafeTensorsWriter& file);
/// Refuses an asset that is not as setAssetChecksum() had it written; older ones have no checksum.
/// Errors: kIo, kFormat.
void requireAssetChecksum(const SafeTensorsReader& file);

}  // namespace stipple
