#include "io/volume_file.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <random>
#include <string>

#include "scratch_folder.h"

namespace stipple {
namespace {

class VolumeFile : public ScratchFolder {};

/// Bricks on both sides of zero, about half of the voxels empty.
SparseVolume randomVolume(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0.0f, 1.0f);
  SparseVolume volume;
  volume.voxel_size = 0.0125;
  volume.origin = {0.3, -7.25, 1e3};
  for (int x = -2; x < 2; ++x) {
    for (int y = -600; y < 600; y += 400) {
      for (int z = 0; z < 3; ++z) volume.bricks.push_back({x * 8, y * 8, z * 8});
    }
  }
  volume.density.resize(volume.brickCount() * kBrickVoxelCount);
  volume.colour.resize(volume.density.size() * 3);
  for (size_t v = 0; v < volume.density.size(); ++v) {
    if (unit(random) < 0.5f) continue;
    volume.density[v] = 100.0f * unit(random);
    for (size_t c = 0; c < 3; ++c) volume.colour[v * 3 + c] = unit(random);
  }
  return volume;
}

TEST_F(VolumeFile, GivesEveryVoxelBackExactly) {
  SparseVolume volume = randomVolume(1);
  // Numbers that half floats do not hold, colour without density and density without colour.
  volume.density[5] = 1e-30f;
  volume.density[6] = 0.0f;
  volume.colour[18] = 3e7f;
  volume.density[7] = 1.0f;
  volume.colour[21] = volume.colour[22] = volume.colour[23] = 0.0f;
  writeVolumeFile(volume, path("a.vdb"));
  const SparseVolume seen = readVolumeFile(path("a.vdb"));
  EXPECT_EQ(seen.voxel_size, volume.voxel_size);
  EXPECT_EQ(seen.origin, volume.origin);
  EXPECT_EQ(seen.bricks, volume.bricks);
  EXPECT_EQ(seen.density, volume.density);
  EXPECT_EQ(seen.colour, volume.colour);
  EXPECT_EQ(fileCount(), 1u);
}

TEST_F(VolumeFile, KeepsAnEmptyVolume) {
  SparseVolume volume;
  volume.voxel_size = 2.0;
  writeVolumeFile(volume, path("a.vdb"));
  const SparseVolume seen = readVolumeFile(path("a.vdb"));
  EXPECT_EQ(seen.brickCount(), 0u);
  EXPECT_EQ(seen.voxel_size, 2.0);
}

TEST_F(VolumeFile, IsCompressed) {
  SparseVolume volume;
  volume.voxel_size = 1.0;
  for (int b = 0; b < 1000; ++b)
    volume.bricks.push_back({b / 100 * 8, b / 10 % 10 * 8, b % 10 * 8});
  volume.density.assign(volume.brickCount() * kBrickVoxelCount, 3.0f);
  volume.colour.assign(volume.density.size() * 3, 0.25f);
  writeVolumeFile(volume, path("a.vdb"));
  // Uncompressed it is 16 bytes per voxel; constant bricks shrink far below a quarter of that.
  EXPECT_LT(std::filesystem::file_size(path("a.vdb")), volume.density.size() * 4);
}

TEST_F(VolumeFile, RefusesWhatIsNotAVolume) {
  expectError(ErrorCode::kIo, {"missing.vdb", "No such file"},
              [&] { readVolumeFile(path("missing.vdb")); });
  expectError(ErrorCode::kIo, {"folder"}, [&] { readVolumeFile(folder_.string()); });
  expectError(ErrorCode::kFormat, {"empty.vdb"}, [&] { readVolumeFile(store("empty.vdb", "")); });
  expectError(ErrorCode::kFormat, {"a.vdb"},
              [&] { readVolumeFile(store("a.vdb", std::string(1000, 'x'))); });
  expectError(ErrorCode::kIo, {"missing/a.vdb", "No such file"},
              [&] { writeVolumeFile(randomVolume(3), path("missing/a.vdb")); });
}

TEST_F(VolumeFile, RefusesVolumesThatAreNotSound) {
  store("a.vdb", "old");
  const auto refuse = [&](const char* text, const auto& spoil) {
    SparseVolume volume = randomVolume(4);
    spoil(volume);
    expectError(ErrorCode::kInvalidArgument, {text},
                [&] { writeVolumeFile(volume, path("a.vdb")); });
  };
  refuse("voxel_size", [](SparseVolume& v) { v.voxel_size = 0; });
  refuse("origin", [](SparseVolume& v) { v.origin[1] = std::nan(""); });
  refuse("density", [](SparseVolume& v) { v.density[600] = HUGE_VALF; });
  refuse("densities", [](SparseVolume& v) { v.density.pop_back(); });
  refuse("multiple of 8", [](SparseVolume& v) { v.bricks[0][0] -= 1; });
  refuse("not after", [](SparseVolume& v) { std::swap(v.bricks[0], v.bricks[1]); });
  EXPECT_EQ(load(path("a.vdb")), "old");
}

}  // namespace
}  // namespace stipple
