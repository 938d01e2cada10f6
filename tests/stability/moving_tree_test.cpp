#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "decode/tree/moving_decoder.h"
#include "model/moving_cloud.h"

// Moving splats that are hard to merge, with floating-point traps on. Every cut must be splats, at
// every time, and every error a number.

namespace stipple {
namespace {

struct Hard {
  std::string name;
  MotionCloud moving;
};

void fill(std::vector<float>& column, float value) {
  std::ranges::fill(column, value);
}

std::vector<Hard> hardClouds() {
  std::vector<Hard> cases;
  const auto add = [&](const char* name, size_t count,
                       const std::function<void(MotionCloud&)>& set) {
    cases.push_back({name, test::movingCloud(count)});
    set(cases.back().moving);
  };
  add("one splat", 1, [](MotionCloud&) {});
  add("two identical splats", 2, test::makeAlike);
  // A million of them take the same path as these, a few rounds more.
  add("many equal splats", 20000, test::makeAlike);
  add("lives that do not overlap", 200, [](MotionCloud& m) {
    m.clip.frame_count = 300;
    fill(m.lifespans, 0.01f);
    for (size_t i = 0; i < m.size(); ++i) m.centres[i] = i % 2 == 0 ? 0.0f : 1.0f;
  });
  add("lives of one frame", 200, [](MotionCloud& m) {
    m.clip.frame_count = 1000;
    fill(m.lifespans, static_cast<float>(kSmallestLifespan));
  });
  add("lives as long as they can be", 200,
      [](MotionCloud& m) { fill(m.lifespans, static_cast<float>(kLargestLifespan)); });
  add("far apart in time", 200, [](MotionCloud& m) {
    m.clip.frame_count = 1u << 24;
    for (size_t i = 0; i < m.size(); ++i) m.centres[i] = static_cast<float>(i) / 200;
  });
  add("zero opacity", 200, [](MotionCloud& m) { fill(m.splats.opacities, 0); });
  add("full opacity", 200, [](MotionCloud& m) { fill(m.splats.opacities, 1); });
  add("hardly any opacity", 200, [](MotionCloud& m) { fill(m.splats.opacities, 1e-38f); });
  for (const float size : {1e-30f, 1e6f, 1e15f, 1e18f}) {
    add(size < 1 ? "tiny coordinates" : "huge coordinates", 200, [size](MotionCloud& m) {
      for (float& x : m.splats.positions) x *= size;
      for (float& x : m.splats.scales) x *= size;
      for (auto& wave : m.waves) {
        for (float& x : wave) x *= size;
      }
    });
  }
  add("an outlier of 1e30 m", 200, [](MotionCloud& m) {
    m.splats.positions[3] = 1e30f;
    m.splats.scales[6] = 1e30f;
    m.waves[2][9] = -1e30f;
  });
  add("points", 200, [](MotionCloud& m) { fill(m.splats.scales, 0); });
  add("one place", 200, [](MotionCloud& m) {
    fill(m.splats.positions, 0);
    for (auto& wave : m.waves) fill(wave, 0);
  });
  add("needles that turn a million times", 200, [](MotionCloud& m) {
    for (size_t i = 0; i < m.size(); ++i) m.splats.scales[3 * i] = 10;
    for (float& x : m.spins) x *= 1e6f;
  });
  add("quaternions through 0", 200, [](MotionCloud& m) {
    m.clip.window_frames = 0;
    fill(m.centres, 0);
    for (size_t k = 0; k < m.spins.size(); ++k) m.spins[k] = -2 * m.splats.rotations[k];
  });
  for (const uint32_t frames : {1u, 2u, 5u, 100u}) {
    add("clips of few frames and as long as a window", 200,
        [frames](MotionCloud& m) { m.clip.frame_count = frames; });
  }
  add("phases of a thousand turns", 200, [](MotionCloud& m) {
    for (float& x : m.phases) x *= 6283.f;
  });
  return cases;
}

TEST(MovingTreeStability, EveryCutIsSplatsAtEveryTime) {
  for (const Hard& hard : hardClouds()) {
    SCOPED_TRACE(hard.name);
    const MotionCloud& moving = hard.moving;
    for (const size_t times : {size_t{3}, kMergeTimes}) {
      MovingTreeOptions options;
      options.times = times;
      const auto tree = std::make_shared<const MovingTree>(buildMovingTree(moving, {}, options));
      for (const float error : tree->errors) ASSERT_TRUE(std::isfinite(error));
      if (tree->nodes.size() > 0) {
        ASSERT_NO_THROW(validate(tree->nodes, "nodes"));
      }
      const MovingDecoder decoder(moving, tree);
      const uint64_t count = moving.size();
      for (const uint64_t budget : {uint64_t{1}, (count + 1) / 2, count}) {
        for (const double part : {0.0, 0.3, 1.0}) {
          DecodeRequest request;
          request.budget = budget;
          request.time = moving.clip.begin + part * (moving.clip.end() - moving.clip.begin);
          const SplatCloud cut = decoder.decode(request);
          EXPECT_EQ(cut.size(), budget);
          EXPECT_NO_THROW(validate(cut, "cut"));
        }
      }
    }
  }
}

TEST(MovingTreeStability, VisibilitiesAndFootprintsOfAnySize) {
  for (const Hard& hard : hardClouds()) {
    if (hard.moving.size() > 1000) continue;
    SCOPED_TRACE(hard.name);
    std::vector<float> visibility(hard.moving.size());
    for (size_t i = 0; i < visibility.size(); ++i) {
      visibility[i] = i % 3 == 0 ? 0.0f : i % 3 == 1 ? 1e-30f : 1.0f;
    }
    for (const double footprint : {1e-12, 1e12}) {
      MovingTreeOptions options;
      options.footprint = footprint;
      const MovingTree tree = buildMovingTree(hard.moving, visibility, options);
      for (const float error : tree.errors) ASSERT_TRUE(std::isfinite(error));
      if (tree.nodes.size() > 0) {
        EXPECT_NO_THROW(validate(tree.nodes, "nodes"));
      }
    }
  }
}

}  // namespace
}  // namespace stipple
