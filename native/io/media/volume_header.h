#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "io/bytes/input_file.h"

namespace stipple::media {

/// Where a grid lies in its file.
struct VolumeGridPlace {
  std::string type;  ///< OpenVDB's name of its tree
  bool is_half = false;  ///< floats are stored in 16 bits
  uint32_t compression = 0;  ///< OpenVDB's flags
  uint64_t transform = 0;  ///< offset in the file
  uint64_t blocks = 0;     ///< ... of the values, which follow the tree
};

/// What stands in front of the trees of an OpenVDB file.
struct VolumeHeader {
  uint32_t file_version = 0;
  uint32_t library_major = 0;
  uint32_t library_minor = 0;
  std::map<std::string, VolumeGridPlace> grids;  ///< by name; of equal names the first
};

/// Reads it with every length compared with the file: OpenVDB allocates what a length says before it
/// notices that the file has ended. Metadata is passed over.
/// Errors: kFormat; kUnsupported (written before OpenVDB 3, or as a stream without offsets).
VolumeHeader readVolumeHeader(const InputFile& file);

}  // namespace stipple::media
