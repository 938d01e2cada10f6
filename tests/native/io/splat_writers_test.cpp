// What all writers of splats have in common.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <string>

#include "base/parallel.h"
#include "io/splats/splat_file.h"
#include "random_cloud.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

constexpr const char* kNames[] = {"a.ply", "a.compressed.ply", "a.spz", "a.splat", "a.glb",
                                  "a.sog"};

class SplatWriters : public ScratchFolder {};

TEST_F(SplatWriters, RefuseValuesThatNoSplatHasAndKeepTheOldFile) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  const struct {
    const char* says;
    void (*damage)(SplatCloud& cloud, float value);
    float value;
  } kCases[] = {
      {"position of splat 700 ", [](SplatCloud& c, float v) { c.positions[700 * 3 + 1] = v; }, nan},
      {"rotation of splat 700 ", [](SplatCloud& c, float v) { c.rotations[700 * 4] = v; },
       infinity},
      {"rotation of splat 700 ",
       [](SplatCloud& c, float v) { std::fill_n(&c.rotations[700 * 4], 4, v); }, 0.0f},
      {"scale of splat 700 ", [](SplatCloud& c, float v) { c.scales[700 * 3 + 2] = v; }, -1.0f},
      {"opacity of splat 700 ", [](SplatCloud& c, float v) { c.opacities[700] = v; }, 1.5f},
      {"colour of splat 700 ", [](SplatCloud& c, float v) { c.sh[700 * 48] = v; }, -infinity},
      // Harmonics count where a format leaves them out, too.
      {"colour of splat 700 ", [](SplatCloud& c, float v) { c.sh[700 * 48 + 47] = v; }, nan}};
  for (const char* name : kNames) {
    for (const auto& one : kCases) {
      SplatCloud cloud = randomCloud(2000, 3, 1);
      one.damage(cloud, one.value);
      store(name, "old");
      expectError(ErrorCode::kInvalidArgument, {"cloud: ", one.says},
                  [&] { writeSplatFile(cloud, path(name), {}); });
      EXPECT_EQ(load(path(name)), "old") << name;
      EXPECT_EQ(fileCount(), 1u) << name;
    }
    std::filesystem::remove(path(name));
  }
}

TEST_F(SplatWriters, GiveTheSameBytesForAnyNumberOfThreads) {
  // Several tasks of every writer, the last one short.
  const SplatCloud cloud = randomCloud(20001, 2, 2);
  for (const char* name : kNames) {
    withThreads(1, [&] { writeSplatFile(cloud, path(name), {}); });
    const std::string one = load(path(name));
    withThreads(4, [&] { writeSplatFile(cloud, path(name), {}); });
    EXPECT_TRUE(one == load(path(name))) << name;
  }
}

TEST_F(SplatWriters, PassOverHarmonicsThatTheFormatDoesNotHold) {
  const SplatCloud full = randomCloud(5000, 3, 3);
  SplatCloud plain = full;
  plain.sh_degree = 0;
  plain.sh.resize(plain.size() * 3);
  for (size_t i = 0; i < plain.size(); ++i) {
    for (size_t k = 0; k < 3; ++k) plain.sh[i * 3 + k] = full.sh[i * 48 + k];
  }
  writeSplatFile(full, path("full.splat"), {});
  writeSplatFile(plain, path("plain.splat"), {});
  EXPECT_TRUE(load(path("full.splat")) == load(path("plain.splat")));
}

}  // namespace
}  // namespace stipple
