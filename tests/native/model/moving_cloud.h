#pragma once

#include <vector>

#include "base/random.h"
#include "motion/motion_cloud.h"

namespace stipple::test {

/// Splats of harmonic degree 1 that all move, turn and fade, over a clip of 12 frames from second 2
/// on.
inline MotionCloud movingCloud(size_t count) {
  const auto drawn = [](uint64_t stream, size_t i, float from, float to) {
    return from + (to - from) * unitFloat(keyedBits(stream, RandomUse::kThinning, i));
  };
  MotionCloud moving;
  moving.splats.sh_degree = 1;
  moving.splats.frame = Frame::kRFU;
  moving.splats.antialias = Antialias::kMip;
  moving.splats.resize(count);
  for (size_t i = 0; i < 3 * count; ++i) {
    moving.splats.positions[i] = drawn(1, i, -1, 1);
    moving.splats.scales[i] = drawn(2, i, 0.01f, 0.1f);
  }
  for (size_t i = 0; i < 4 * count; ++i) {
    moving.splats.rotations[i] = drawn(3, i, 0.1f, 1);
    moving.phases.push_back(drawn(4, i, -3, 3));
    moving.spins.push_back(drawn(5, i, -1, 1));
  }
  for (size_t i = 0; i < moving.splats.sh.size(); ++i) {
    moving.splats.sh[i] = drawn(6, i, -0.5f, 0.5f);
  }
  for (size_t wave = 0; wave < kMotionWaves; ++wave) {
    for (size_t i = 0; i < 3 * count; ++i) {
      moving.waves[wave].push_back(drawn(10 + wave, i, -0.1f, 0.1f));
    }
  }
  for (size_t i = 0; i < count; ++i) {
    moving.splats.opacities[i] = drawn(7, i, 0.1f, 1);
    moving.centres.push_back(drawn(8, i, 0, 1));
    for (size_t side = 0; side < 2; ++side) {
      moving.lifespans.push_back(drawn(9, 2 * i + side, 0.2f, 1.1f));
    }
  }
  moving.clip.begin = 2;
  moving.clip.frames_per_second = 8;
  moving.clip.frame_count = 12;
  return moving;
}

/// Gives all splats the numbers of the first.
inline void makeAlike(MotionCloud& moving) {
  const auto repeat = [&](std::vector<float>& column) {
    const size_t width = column.size() / moving.size();
    for (size_t i = width; i < column.size(); ++i) column[i] = column[i - width];
  };
  repeat(moving.splats.positions);
  repeat(moving.splats.rotations);
  repeat(moving.splats.scales);
  repeat(moving.splats.opacities);
  repeat(moving.splats.sh);
  for (auto& wave : moving.waves) repeat(wave);
  repeat(moving.phases);
  repeat(moving.spins);
  repeat(moving.lifespans);
  repeat(moving.centres);
}

}  // namespace stipple::test
