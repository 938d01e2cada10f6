#include "splat/cpu/tiles/tile_lists.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <vector>

#include "bench/exact_tiles.h"
#include "splat/random_scene.h"

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::frontCamera;
using testing::randomCloud;

struct Pairs {
  uint64_t listed = 0;
  uint64_t exact = 0;
  uint64_t missing = 0;
  uint64_t out_of_order = 0;
};

Pairs countPairs(const VisibleSplats& visible, const TileGrid& grid) {
  std::vector<std::vector<uint32_t>> exact(grid.tileCount());
  std::vector<uint32_t> place_of(visible.splats.size());
  for (size_t i = 0; i < visible.count; ++i) {
    const uint32_t slot = visible.slotAt(i);
    place_of[slot] = static_cast<uint32_t>(i);
    bench::forEachExactTile(visible.slots().footprint(slot), visible.extras[slot].half_x,
                            static_cast<double>(visible.splats[slot].half_y), grid,
                            [&](size_t tile) { exact[tile].push_back(static_cast<uint32_t>(i)); });
  }
  Pairs pairs;
  size_t next_tile = 0;
  forEachTileGroup(visible, grid, nullptr, [&](const TileListGroup& group) {
    EXPECT_EQ(group.first_tile, next_tile);
    next_tile = group.end_tile;
    for (size_t tile = group.first_tile; tile < group.end_tile; ++tile) {
      std::vector<uint32_t> listed;
      for (const uint32_t slot : group.tile(tile)) listed.push_back(place_of[slot]);
      pairs.listed += listed.size();
      pairs.exact += exact[tile].size();
      for (size_t k = 1; k < listed.size(); ++k) pairs.out_of_order += listed[k] <= listed[k - 1];
      for (const uint32_t splat : exact[tile]) {
        pairs.missing += !std::binary_search(listed.begin(), listed.end(), splat);
      }
    }
  });
  EXPECT_EQ(next_tile, grid.tileCount());
  return pairs;
}

TEST(TileLists, HoldEveryPairOfTheExactSetAndAtMostOneInAHundredMore) {
  struct Kind {
    double size_min, size_max;
    size_t count;
  };
  // Sub-pixel, a few pixels, many tiles, needles through the whole picture.
  for (const Kind& kind : {Kind{0.0005, 0.003, 20000}, Kind{0.005, 0.05, 20000},
                           Kind{0.1, 1.0, 2000}, Kind{0.0005, 3.0, 2000}}) {
    CloudRecipe recipe;
    recipe.count = kind.count;
    recipe.size_min = kind.size_min;
    recipe.size_max = kind.size_max;
    recipe.opacity_min = 0.003;
    const SplatCloud cloud = randomCloud(recipe, 9);
    const SplatInstance instance{&cloud};
    const Camera camera = frontCamera(605, 411, 500, 3.0);
    const PlacedScene scene = placeScene({&instance, 1}, camera, {});
    const VisibleSplats visible = findVisibleSplats(scene, nullptr);
    const Pairs pairs = countPairs(visible, TileGrid(camera.width, camera.height));
    SCOPED_TRACE(::testing::Message() << "sizes " << kind.size_min << " to " << kind.size_max);
    EXPECT_GT(pairs.exact, kind.count / 2);
    EXPECT_EQ(pairs.missing, 0u);
    EXPECT_EQ(pairs.out_of_order, 0u);
    // The margin of 0.01 px in every bound is what the lists hold too much.
    EXPECT_LE(static_cast<double>(pairs.listed), 1.01 * static_cast<double>(pairs.exact));
  }
}

struct ProjectedArrays {
  std::vector<VisibleSplat> splats;
  std::vector<VisibleExtra> extras;
  std::vector<DepthItem> items;
  std::vector<TileSpan> spans;

  void resize(size_t count) {
    splats.resize(count);
    extras.resize(count);
    items.resize(count);
    spans.resize(count);
  }
};

ProjectedArrays projectWith(Projector projector, const PlacedScene& scene) {
  ProjectedArrays out;
  out.resize(scene.splat_count);
  const ProjectedSlots slots = {out.splats.data(), out.extras.data(), out.items.data(),
                                out.spans.data()};
  size_t slot = 0;
  for (const PlacedCloud& placed : scene.clouds) {
    slot = projector(scene, placed, 0, placed.cloud->size(), slots, slot);
  }
  out.resize(slot);
  return out;
}

TEST(Projector, GivesTheSameBitsOnEveryTarget) {
  Camera camera = frontCamera(200, 150, 180, 1.2);  // some splats behind, some outside
  for (int degree = 0; degree <= kMaxShDegree; ++degree) {
    for (const LowPass low_pass : {LowPass::kClassic, LowPass::kMip, LowPass::kNone}) {
      CloudRecipe recipe;
      recipe.count = 1003;  // no multiple of any lane count
      recipe.degree = degree;
      recipe.opacity_min = 0.001;
      const SplatCloud cloud = randomCloud(recipe, 60 + static_cast<uint32_t>(degree));
      const SplatInstance instance{&cloud};
      camera.model = degree == 2 ? CameraModel::kOrthographic : CameraModel::kPerspective;
      RenderOptions options;
      options.low_pass = low_pass;
      options.blend_space = degree == 1 ? BlendSpace::kSceneLinear : BlendSpace::kAsTrained;
      const PlacedScene scene = placeScene({&instance, 1}, camera, options);
      const ProjectedArrays expected = projectWith(projectScalar, scene);
      EXPECT_GT(expected.splats.size(), 100u);
      for (const NamedProjector& named : projectors()) {
        SCOPED_TRACE(::testing::Message() << named.target << " degree " << degree);
        const ProjectedArrays seen = projectWith(named.project, scene);
        ASSERT_EQ(seen.splats.size(), expected.splats.size());
        EXPECT_EQ(seen.items, expected.items);
        EXPECT_EQ(seen.spans, expected.spans);
        for (size_t i = 0; i < seen.splats.size(); ++i) {
          const VisibleSplat& a = seen.splats[i];
          const VisibleSplat& b = expected.splats[i];
          EXPECT_EQ(std::memcmp(&a, &b, offsetof(VisibleSplat, half_y)), 0);
          EXPECT_EQ(std::memcmp(a.colour, b.colour, sizeof(a.colour)), 0);
          EXPECT_EQ(a.depth, b.depth);
          EXPECT_EQ(seen.extras[i].index, expected.extras[i].index);
          EXPECT_EQ(seen.extras[i].opacity, expected.extras[i].opacity);
          // Logarithms of two libraries, each good to a few units in the last place.
          EXPECT_NEAR(seen.extras[i].half_x, expected.extras[i].half_x,
                      1e-12 * expected.extras[i].half_x);
          EXPECT_NEAR(a.half_y, b.half_y, 2e-7f * b.half_y);
          EXPECT_NEAR(a.log2_opacity, b.log2_opacity, 1e-6);
        }
      }
    }
  }
}

TEST(VisibleSplats, ComeInTheOrderOfAStableSortByDepth) {
  // Several ranges of the sort's chunks, equal depths, one depth only, and a depth range that takes
  // three passes.
  for (const double stretch : {0.0, 1e-6, 1.0, 1e20}) {
    CloudRecipe recipe;
    recipe.count = 30000;
    recipe.size_min = 0.2 * std::max(stretch, 1.0);
    recipe.size_max = 0.3 * std::max(stretch, 1.0);
    SplatCloud cloud = randomCloud(recipe, 4);
    for (size_t i = 0; i < cloud.size(); ++i) {
      const double random = std::abs(static_cast<double>(cloud.positions[i * 3 + 1]));
      cloud.positions[i * 3 + 1] = static_cast<float>(
          stretch < 1e10 ? stretch * std::round(random * 1e4) * 1e-4 : std::pow(stretch, random));
      cloud.positions[i * 3] = cloud.positions[i * 3 + 2] = 0.0f;
    }
    const SplatInstance instance{&cloud};
    Camera camera = frontCamera(64, 64, 60, 3.0);
    camera.far_plane = 1e30;
    const PlacedScene scene = placeScene({&instance, 1}, camera, {});
    const VisibleSplats visible = findVisibleSplats(scene, nullptr);
    ASSERT_GT(visible.count, 20000u);
    size_t wrong = 0;
    for (size_t i = 1; i < visible.count; ++i) {
      const float before = visible.at(i - 1).depth;
      const float depth = visible.at(i).depth;
      const bool in_order = visible.extraAt(i - 1).index < visible.extraAt(i).index;
      wrong += !(before < depth || (before == depth && in_order));
    }
    EXPECT_EQ(wrong, 0u) << "stretch " << stretch;
  }
}

}  // namespace
}  // namespace stipple
