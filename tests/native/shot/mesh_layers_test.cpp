#include "shot/mesh_layers.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "base/error.h"
#include "base/parallel.h"
#include "data/images/hole_fill.h"
#include "math/empty_depth.h"

// Every layer against the same formulas in double, one pixel at a time, on passes of random
// pixels: empty, covered, covered in part, in shadow, held out, and with numbers that are none.

namespace stipple {
namespace {

/// Colours are below 4 and divided by a shadow of 1/8 at least: 8 roundings of 32 at most.
constexpr double kClose = 8 * 32 * 6e-8;

struct Passes {
  uint32_t width = 37, height = 23;
  std::vector<float> combined, depth, shadow, held_depth, held_opacity, world;
  std::vector<float> splats, splat_depth, transmittance;

  size_t count() const { return size_t{width} * height; }
};

Passes randomPasses(uint32_t seed) {
  std::mt19937 random(seed);
  const auto unit = [&] { return static_cast<float>(random() % 1025) / 1024.0f; };
  const auto one_of = [&](std::initializer_list<float> values) {
    return values.begin()[random() % values.size()];
  };
  Passes made;
  for (size_t i = 0; i < made.count(); ++i) {
    const float alpha = one_of({0.0f, 0.0f, 1.0f, unit()});
    for (int c = 0; c < 3; ++c) made.combined.push_back(alpha * unit() * 4.0f);
    made.combined.push_back(alpha);
    made.depth.push_back(alpha > 0.0f && random() % 4 ? 1.0f + unit() : kEmptyDepth);
    const float shadow = one_of({1.0f, 1.0f, 0.125f + 0.875f * unit()});
    for (int c = 0; c < 3; ++c) made.shadow.push_back(shadow);
    const float held = one_of({0.0f, 0.0f, unit()});
    made.held_opacity.push_back(held);
    made.held_depth.push_back(held > 0.0f ? 1.0f + unit() : kEmptyDepth);
    for (int c = 0; c < 3; ++c) made.world.push_back(unit());
    const float seen = std::max(unit(), 1.0f / 1024.0f);  // splats show in every pixel
    for (int c = 0; c < 3; ++c) made.splats.push_back(seen * unit());
    made.splats.push_back(seen);
    made.splat_depth.push_back(1.0f + unit());
    made.transmittance.push_back((1.0f - seen) * unit());
  }
  return made;
}

double clamped(double value) {
  return std::clamp(value, 0.0, 1.0);
}

/// The same formulas in double.
struct Reference {
  explicit Reference(const Passes& given, bool with_shadow, bool with_holdouts)
      : passes(given), shadow(with_shadow), holdouts(with_holdouts) {}

  double passed(size_t i) const {
    double sum = 0;
    for (size_t c = 0; c < 3; ++c) sum += static_cast<double>(passes.shadow[i * 3 + c]);
    return shadow ? clamped(sum / 3) : 1.0;
  }
  double alpha(size_t i) const {
    return clamped(1 - (1 - static_cast<double>(passes.combined[i * 4 + 3])) / passed(i));
  }
  double hidden(size_t i) const {
    return holdouts ? std::min(alpha(i) + static_cast<double>(passes.held_opacity[i]), 1.0)
                    : alpha(i);
  }
  double depth(size_t i) const {
    double nearest = static_cast<double>(passes.depth[i]);
    const int x = static_cast<int>(i % passes.width), y = static_cast<int>(i / passes.width);
    for (int row = y - 1; row <= y + 1; ++row) {
      for (int column = x - 1; column <= x + 1; ++column) {
        if (row < 0 || column < 0 || row >= static_cast<int>(passes.height) ||
            column >= static_cast<int>(passes.width)) {
          continue;
        }
        const size_t at = static_cast<size_t>(row) * passes.width + static_cast<size_t>(column);
        const bool is_edge = alpha(i) > 1e-6 && alpha(i) < 1 - 1e-6;
        if (is_edge && alpha(at) > 1e-6) {
          nearest = std::min(nearest, static_cast<double>(passes.depth[at]));
        }
      }
    }
    return holdouts ? std::min(nearest, static_cast<double>(passes.held_depth[i])) : nearest;
  }

  const Passes& passes;
  bool shadow, holdouts;
};

MeshLayers layersOf(const Passes& passes, bool shadow, bool holdouts) {
  MeshLayers layers(passes.width, passes.height, passes.combined, passes.depth,
                    shadow ? std::span<const float>(passes.shadow) : std::span<const float>());
  if (holdouts) layers.holdOut(passes.held_depth, passes.held_opacity);
  return layers;
}

class LayersOfPasses : public ::testing::TestWithParam<std::pair<bool, bool>> {
 protected:
  bool shadow() const { return GetParam().first; }
  bool holdouts() const { return GetParam().second; }

  Passes passes_ = randomPasses(7);
  Reference reference_{passes_, GetParam().first, GetParam().second};
  MeshLayers layers_ = layersOf(passes_, GetParam().first, GetParam().second);
};

TEST_P(LayersOfPasses, TheSurfaceIsTheReferences) {
  const std::vector<float> depth = layers_.surfaceDepth(), hidden = layers_.hidden();
  for (size_t i = 0; i < passes_.count(); ++i) {
    EXPECT_NEAR(static_cast<double>(layers_.colour()[i * 4 + 3]), reference_.alpha(i), kClose);
    EXPECT_NEAR(static_cast<double>(hidden[i]), reference_.hidden(i), kClose);
    EXPECT_EQ(static_cast<double>(depth[i]), reference_.depth(i)) << "pixel " << i;
  }
  EXPECT_EQ(layers_.light().empty(), !shadow());
  EXPECT_EQ(layers_.hasShadows(), shadow());
}

TEST_P(LayersOfPasses, AMatteWithCatchersHidesAllBehindThem) {
  std::vector<float> catchers(passes_.count(), kEmptyDepth);
  for (size_t i = 0; i < catchers.size(); i += 3) catchers[i] = 1.5f;
  std::vector<float> depth(catchers.size()), opacity(catchers.size());
  layers_.matteOf(catchers, 0.25f, depth, opacity);
  for (size_t i = 0; i < catchers.size(); ++i) {
    const double before = i % 3 == 0 ? 1.25 : static_cast<double>(kEmptyDepth - 0.25f);
    EXPECT_EQ(static_cast<double>(depth[i]), std::min(before, reference_.depth(i)));
    EXPECT_NEAR(static_cast<double>(opacity[i]), i % 3 == 0 ? 1.0 : reference_.hidden(i), kClose);
  }
}

TEST_P(LayersOfPasses, ThePictureOverAWorldIsTheReferences) {
  const std::vector<float> plain = {0.25f, 0.5f, 1.0f};
  layers_.takeWorld(passes_.world, plain);
  std::vector<float> colour = passes_.splats, depth = passes_.splat_depth;
  layers_.compose(colour, depth, passes_.transmittance);
  for (size_t i = 0; i < passes_.count(); ++i) {
    const double through = static_cast<double>(passes_.transmittance[i]);
    const double gap = 1 - reference_.hidden(i);
    const double share = gap > 1e-6 ? std::min(through / gap, 1.0) * reference_.passed(i) : 0.0;
    // Where a gap is a rounding, so is what passes it.
    if (gap > 0 && gap < 1e-3) continue;
    const bool is_free = !shadow() || passes_.shadow[i * 3] == 1.0f;
    const bool is_empty = passes_.depth[i] >= kEmptyDepth;
    const bool is_known = !shadow() || (is_free && (is_empty || reference_.alpha(i) > 1e-6));
    for (size_t c = 0; c < 3; ++c) {
      const double world = is_known ? static_cast<double>(passes_.world[i * 3 + c])
                                    : gap * static_cast<double>(plain[c]);
      EXPECT_NEAR(static_cast<double>(colour[i * 4 + c]),
                  static_cast<double>(passes_.splats[i * 4 + c]) + share * world, kClose);
    }
    const double held = 1 - static_cast<double>(passes_.splats[i * 4 + 3]) - through;
    EXPECT_NEAR(static_cast<double>(colour[i * 4 + 3]), held > 1e-5 ? 1 - held : 1.0, kClose);
    EXPECT_EQ(depth[i], passes_.splat_depth[i]);
  }
}

INSTANTIATE_TEST_SUITE_P(ShadowsAndHoldouts, LayersOfPasses,
                         ::testing::Values(std::pair(false, false), std::pair(false, true),
                                           std::pair(true, false), std::pair(true, true)));

TEST(MeshLayers, PixelsThatSplatsLeaveAloneKeepTheDepthOfTheMeshes) {
  const std::vector<float> combined = {0.5f, 0.25f, 0.0f, 1.0f, 0, 0, 0, 0};
  const std::vector<float> depths = {3.0f, kEmptyDepth};
  const MeshLayers layers(2, 1, combined, depths, {});
  std::vector<float> colour = combined, depth = {7.0f, 8.0f};
  colour[7] = 0.5f;  // a black splat
  layers.compose(colour, depth, std::vector<float>{0.0f, 0.5f});
  EXPECT_EQ(depth, (std::vector<float>{3.0f, 8.0f}));
}

TEST(MeshLayers, ShadowsOnNothingAreBlackWithAnAlphaWhereThereIsNoWorld) {
  const std::vector<float> shadow = {0.25f, 0.25f, 0.25f};
  const MeshLayers layers(1, 1, std::vector<float>{0, 0, 0, 0.75f}, std::vector<float>{kEmptyDepth},
                          shadow);
  EXPECT_EQ(layers.colour()[3], 0.0f) << "the alpha was that of the shadow";
  std::vector<float> colour = {0, 0, 0, 0}, depth = {kEmptyDepth};
  layers.compose(colour, depth, std::vector<float>{1.0f});
  EXPECT_EQ(colour, (std::vector<float>{0, 0, 0, 0.75f}));
}

TEST(MeshLayers, AWorldOfManyColoursIsFilledInBehindCatchers) {
  Passes passes = randomPasses(3);
  MeshLayers layers = layersOf(passes, true, false);
  layers.takeWorld(passes.world, std::nullopt);
  std::vector<uint8_t> shows(passes.count());
  for (size_t i = 0; i < shows.size(); ++i) {
    shows[i] = passes.shadow[i * 3] == 1.0f && passes.depth[i] >= kEmptyDepth &&
               passes.combined[i * 4 + 3] == 0.0f;
  }
  const std::vector<float> spread = filledHoles(passes.world, shows, passes.width, passes.height);
  std::vector<float> colour(passes.count() * 4, 0.0f), depth(passes.count(), kEmptyDepth);
  layers.compose(colour, depth, std::vector<float>(passes.count(), 1.0f));
  const Reference reference(passes, true, false);
  size_t filled = 0;
  for (size_t i = 0; i < passes.count(); ++i) {
    if (passes.shadow[i * 3] == 1.0f) continue;
    const double gap = 1 - reference.alpha(i);
    if (gap < 1e-3) continue;
    ++filled;
    for (size_t c = 0; c < 3; ++c) {
      EXPECT_NEAR(static_cast<double>(colour[i * 4 + c]),
                  reference.passed(i) * gap * static_cast<double>(spread[i * 3 + c]), kClose);
    }
  }
  EXPECT_GT(filled, passes.count() / 8);
}

TEST(MeshLayers, ShadowsOfAnotherPictureLeaveMeshesAsTheyAre) {
  const std::vector<float> combined = {0.25f, 0.25f, 0.25f, 0.5f, 0, 0, 0, 0, 0, 0, 0, 0};
  const std::vector<float> shadow = {0.5f, 0.25f, 0.0f, 0.5f, 0.5f, 0.5f, 2.0f, 2.0f, 2.0f};
  const std::vector<float> world = {0.25f, 0.25f, 0.25f, 0.5f, 0.5f, 0.5f, 0.5f, 0.5f, 0.5f};
  MeshLayers layers(3, 1, combined, std::vector<float>{2.0f, kEmptyDepth, kEmptyDepth}, {});
  layers.takeWorld(world, std::nullopt);
  layers.takeShadow(shadow);
  EXPECT_EQ(layers.light(), shadow);
  EXPECT_EQ(layers.colour(), combined) << "the picture had no catchers";
  std::vector<float> colour = combined, depth(3, kEmptyDepth);
  layers.compose(colour, depth, std::vector<float>{0.5f, 1.0f, 1.0f});
  // The world is as it shows, times the mean of the factors, which lets no more pass than there is.
  EXPECT_EQ(colour, (std::vector<float>{0.3125f, 0.3125f, 0.3125f, 1.0f, 0.25f, 0.25f, 0.25f, 1.0f,
                                        0.5f, 0.5f, 0.5f, 1.0f}));
  EXPECT_THROW(layers.takeShadow(shadow), Error) << "they are taken once";
  MeshLayers other(3, 1, combined, std::vector<float>(3, kEmptyDepth), {});
  EXPECT_THROW(other.takeShadow(combined), Error);
}

TEST(MeshLayers, LightIsSharedAsTheSplatsBeforeCatchersShowInAll) {
  const std::vector<float> shadow = {0.5f, 0.5f, 0.5f};
  MeshLayers layers(1, 1, std::vector<float>{0, 0, 0, 0}, std::vector<float>{kEmptyDepth}, shadow);
  layers.lightBefore(std::vector<float>{0.25f, 0.0f, 0.5f, 1.0f},
                     std::vector<float>{0.5f, 0.0f, 0.5f, 1.0f});
  // Half of the light is before the catcher; a channel without splats keeps the shadow; all of it.
  EXPECT_EQ(layers.light(), (std::vector<float>{0.75f, 0.5f, 1.0f}));
}

TEST(MeshLayers, NumbersThatAreNoneAreNothing) {
  const float none = std::nanf("");
  const std::vector<float> combined = {none, INFINITY, 1.0f, none},
                           shadow = {none, INFINITY, -1.0f};
  const MeshLayers layers(1, 1, combined, std::vector<float>{none}, shadow);
  EXPECT_EQ(layers.surfaceDepth()[0], kEmptyDepth);
  EXPECT_EQ(layers.light(), (std::vector<float>{1.0f, 1.0f, 0.0f}));
  EXPECT_EQ(layers.colour()[0], 0.0f);
  EXPECT_EQ(layers.colour()[1], 0.0f);
  EXPECT_EQ(layers.colour()[2], 1.0f);
}

TEST(MeshLayers, RefusesArraysOfAnotherSize) {
  const std::vector<float> values(16, 0.0f);
  const std::span<const float> four(values.data(), 4), sixteen(values);
  EXPECT_THROW(MeshLayers(0, 2, {}, {}, {}), Error);
  EXPECT_THROW(MeshLayers(2, 2, four, four, {}), Error);
  MeshLayers layers(2, 2, sixteen, four, {});
  EXPECT_THROW(layers.holdOut(sixteen, four), Error);
  EXPECT_THROW(layers.takeWorld(four, std::nullopt), Error);
}

TEST(MeshLayers, HaveTheSameBitsForAnyNumberOfThreads) {
  Passes passes = randomPasses(5);
  std::vector<float> colours[2];
  for (const uint32_t threads : {1u, 2u}) {
    withThreads(threads, [&] {
      MeshLayers layers = layersOf(passes, true, true);
      layers.takeWorld(passes.world, std::nullopt);
      std::vector<float> colour = passes.splats, depth = passes.splat_depth;
      layers.compose(colour, depth, passes.transmittance);
      colours[threads - 1] = colour;
    });
  }
  EXPECT_EQ(colours[0], colours[1]);
}

}  // namespace
}  // namespace stipple
