#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/progress.h"

namespace stipple {

/// What a file of weights does when an image becomes splats.
enum class WeightsRole : uint32_t { kStructureEncoder, kColourEncoder, kFlow, kDecoder };
constexpr size_t kWeightsRoleCount = 4;

/// What is known of the published file of a role. We have none of these files.
struct PublishedWeights {
  WeightsRole role;
  const char* label;    ///< for people
  const char* path;     ///< in the published model
  uint64_t bytes;       ///< of the published file
  const char* sha256;   ///< 64 hexadecimal digits
  const char* licence;  ///< one or two sentences
};

/// One for each role, in order.
std::span<const PublishedWeights, kWeightsRoleCount> publishedWeights();
/// Where users get the files, in one or two sentences; nothing here downloads anything.
const char* publishedWeightsSource();

/// A file that was found for a role.
struct WeightsFile {
  std::string path;  ///< empty: there is none
  uint64_t bytes = 0;
  int64_t modified = 0;  ///< nanoseconds since 1970
  /// Of the content, 64 hexadecimal digits, where hashWeights() has read it.
  std::string sha256;
  bool is_trained = false;  ///< here (weight_file.h, kTrainedKey)
};

/// What a file is, compared with the published one of its role.
enum class WeightsState : uint32_t {
  kMissing,
  kOtherSize,
  kUnchecked,
  kPublished,
  kOtherContent,
  kTrained,    ///< of a training here
  kNotNeeded,  ///< there is none, and the flow network, which was trained here, needs none
};

/// The files of a folder that turn images into splats.
struct WeightsFolder {
  std::string path;
  std::array<WeightsFile, kWeightsRoleCount> files;
  /// Sentences about files that cannot be read, and about roles that several files have.
  std::vector<std::string> notes;

  const WeightsFile& of(WeightsRole role) const { return files[static_cast<size_t>(role)]; }
};

/// Of the file by itself, and among the others.
WeightsState stateOf(const WeightsFile& file, const PublishedWeights& published);
WeightsState stateOf(const WeightsFolder& folder, WeightsRole role);

/// Which role the names of a file's tensors tell, whatever it is called and wherever it lies.
std::optional<WeightsRole> weightsRole(std::span<const std::string> tensor_names);

/// Looks through a folder and its subfolders for safetensors files, and reads their headers. Where
/// several files have the same role, the one of the published size is taken, else the first by
/// path. Errors: kIo for a folder that cannot be read; kInvalidArgument for one with too many
/// entries to be a folder of weights.
WeightsFolder findWeights(const std::string& folder);

/// All safetensors files in a folder and its subfolders, by path. Errors: those of findWeights().
std::vector<std::string> weightFilesBelow(const std::string& folder);

/// The file of a role. Errors: kInvalidArgument where it is missing, with what to do.
const WeightsFile& requireWeights(const WeightsFolder& folder, WeightsRole role);

/// Reads all files that were found and fills in their hashes. A file that was hashed before by this
/// process, and has the same path, size and time, is not read again.
/// Errors: kIo; kCancelled. Cost: about 4 GB are read.
void hashWeights(WeightsFolder& folder, Progress* progress = nullptr);

}  // namespace stipple
