#include "io/volume_file.h"

#include <string>

#include "base/error.h"
#include "io/bytes/input_file.h"
#include "io/bytes/output_file.h"
#include "io/media_library.h"

namespace stipple {

namespace {

void validateVolume(const SparseVolume& volume) {
  const size_t bricks = volume.brickCount();
  if (volume.density.size() != bricks * kBrickVoxelCount ||
      volume.colour.size() != bricks * kBrickVoxelCount * 3) {
    fail(ErrorCode::kInvalidArgument, "volume has " + std::to_string(bricks) + " bricks, but " +
                                          std::to_string(volume.density.size()) +
                                          " densities and " + std::to_string(volume.colour.size()) +
                                          " colour values; 512 and 1536 each are needed");
  }
  requireFinite(volume.voxel_size, "volume.voxel_size");
  if (!(volume.voxel_size > 0)) {
    fail(ErrorCode::kInvalidArgument,
         "volume.voxel_size is " + std::to_string(volume.voxel_size) + " m; it must be positive");
  }
  for (const double value : volume.origin) requireFinite(value, "volume.origin");
  requireFinite(volume.density.data(), volume.density.size(), kBrickVoxelCount,
                "volume.density of brick");
  requireFinite(volume.colour.data(), volume.colour.size(), kBrickVoxelCount * 3,
                "volume.colour of brick");
  for (size_t b = 0; b < bricks; ++b) {
    for (const int32_t value : volume.bricks[b]) {
      if (value % kBrickSide != 0) {
        fail(ErrorCode::kInvalidArgument, "volume.bricks " + std::to_string(b) +
                                              " starts at voxel " + std::to_string(value) +
                                              "; a multiple of 8 is needed");
      }
    }
    if (b > 0 && !(volume.bricks[b - 1] < volume.bricks[b])) {
      fail(ErrorCode::kInvalidArgument,
           "volume.bricks " + std::to_string(b) + " is not after the one before it");
    }
  }
}

}  // namespace

void writeVolumeFile(const SparseVolume& volume, const std::string& path) {
  validateVolume(volume);
  const StippleMediaTable& media = mediaTable();
  StippleMediaVolume view{};
  view.voxel_size = volume.voxel_size;
  for (size_t axis = 0; axis < 3; ++axis) view.origin[axis] = volume.origin[axis];
  view.brick_count = volume.brickCount();
  view.bricks = volume.bricks.empty() ? nullptr : volume.bricks.front().data();
  view.density = volume.density.data();
  view.colour = volume.colour.data();
  writeByLibrary(path, [&](const char* temporary) {
    callMedia([&](StippleMediaStatus* status) { media.volume_write(temporary, &view, status); });
  });
}

SparseVolume readVolumeFile(const std::string& path) {
  // Names a missing or unreadable file in the words of every reader.
  { const InputFile file(path); }
  SparseVolume volume;
  const MediaSink sink([&volume](uint32_t array, uint64_t bytes) -> void* {
    const size_t count = static_cast<size_t>(bytes);
    switch (array) {
      case kMediaBricks:
        volume.bricks.resize(count / sizeof(volume.bricks[0]));
        return volume.bricks.data();
      case kMediaDensity:
        volume.density.resize(count / sizeof(float));
        return volume.density.data();
      case kMediaColour:
        volume.colour.resize(count / sizeof(float));
        return volume.colour.data();
      default:
        return nullptr;
    }
  });
  const StippleMediaTable& media = mediaTable();
  callMedia([&](StippleMediaStatus* status) {
    media.volume_read(path.c_str(), &volume.voxel_size, volume.origin.data(), sink.get(), status);
  });
  return volume;
}

}  // namespace stipple
