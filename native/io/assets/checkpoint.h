#pragma once

#include <string>

#include "data/tensor_table.h"

namespace stipple {

/// A fit as it stood after one of its iterations.
struct Checkpoint {
  std::string settings_json = "{}";  ///< what the fit was started with, for comparing
  TensorTable tensors;
};

/// Refuses a place where a checkpoint cannot be written, or would replace a file of another kind.
/// Errors: kIo, kInvalidArgument.
void requireCheckpointPlace(const std::string& path);

/// `.stipple.safetensors`, version 1.1, kind "checkpoint", with a checksum. The file appears under
/// its name when it is whole; until then, and where that fails, the one before it stays.
/// Errors: kIo; kInvalidArgument where the path has a file of another kind.
void writeCheckpoint(const Checkpoint& checkpoint, const std::string& path);
/// The same without a copy of the tensors.
void writeCheckpoint(const std::string& settings_json, const TensorTable& tensors,
                     const std::string& path);

/// Checkpoints of version 1.0 have no checksum.
/// Errors: kIo, kFormat (truncated, damaged, or no checkpoint's tensors), kUnsupported (newer major
/// version, other kind).
Checkpoint readCheckpoint(const std::string& path);

}  // namespace stipple
