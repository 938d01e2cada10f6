#include "model/splat_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include "decode/field/field_parameters.h"
#include "decode/test_clouds.h"
#include "decode/test_meshes.h"
#include "decode/tree/merge_tree.h"
#include "io/scratch_folder.h"
#include "model/field_splats.h"
#include "model/hierarchy_splats.h"
#include "model/model_kinds.h"
#include "model/motion_splats.h"
#include "model/surface_splats.h"
#include "moving_cloud.h"
#include "small_latent.h"

namespace stipple {
namespace {

constexpr uint64_t kSplats = 300;

std::shared_ptr<const SplatModel> surface() {
  TriMesh mesh = test::terrain(2, 8, 0, {0, 0, 0});
  SurfaceModelOptions options;
  options.sampling.count = 5000;
  options.density.leaf_level = 6;
  return makeSurfaceSplats(buildSurfaceModel(mesh, options));
}

std::shared_ptr<const SplatModel> hierarchy() {
  auto cloud = std::make_shared<const SplatCloud>(test::randomCloud(kSplats, 2));
  auto tree = std::make_shared<const MergeTree>(buildMergeTree(*cloud, {}, {}));
  return makeHierarchySplats(std::make_shared<const HierarchyDecoder>(cloud, tree));
}

std::shared_ptr<const SplatModel> field(bool nested) {
  FieldShape shape;
  shape.leaf_level = 4;
  shape.surface_cells = 256;
  std::vector<float> points;
  for (int i = 0; i < 200; ++i) {
    const float t = 0.03f * static_cast<float>(i);
    points.insert(points.end(), {0.5f + 0.3f * std::sin(t), 0.5f + 0.3f * std::cos(t), 0.5f});
  }
  OctreeDensityOptions options;
  options.leaf_level = 4;
  auto density =
      std::make_shared<const OctreeDensity>(OctreeDensity::fromPoints(points, {}, options));
  shape.root = density->root();  // one cube for both, as an asset stores it
  return makeFieldSplats(std::move(density),
                         std::make_shared<const FieldParameters>(makeFieldParameters(shape)),
                         {true, nested, 7});
}

TEST(SplatModel, ACancelledSmoothDecodeLeavesNothingBehind) {
  ModelRequest request;
  request.budget = 700;
  request.smooth = true;
  const std::shared_ptr<const SplatModel> model = surface();
  Progress progress;
  progress.cancel();
  expectError(ErrorCode::kCancelled, {}, [&] { model->decode(request, &progress); });
  const SplatCloud after = model->decode(request), fresh = surface()->decode(request);
  EXPECT_EQ(after.size(), 1024u);
  EXPECT_EQ(after.positions, fresh.positions);
  EXPECT_EQ(after.opacities, fresh.opacities);
}

ModelRequest small() {
  ModelRequest request;
  request.budget = 100;
  return request;
}

/// Generated splats, and the folder that has their weights.
class SplatModelOfEveryKind : public ScratchFolder {
 protected:
  std::vector<std::shared_ptr<const SplatModel>> allKinds() {
    std::filesystem::create_directories(weights());
    return {surface(), hierarchy(), field(true),
            test::smallLatent(STIPPLE_TEST_DATA "/networks/deg_pipeline_a.safetensors", weights()),
            makeMotionSplats(test::movingCloud(small().budget))};
  }
  std::string weights() const { return path("weights"); }
};

void expectSameSplats(const SplatCloud& one, const SplatCloud& other) {
  EXPECT_EQ(one.positions, other.positions);
  EXPECT_EQ(one.rotations, other.rotations);
  EXPECT_EQ(one.scales, other.scales);
  EXPECT_EQ(one.opacities, other.opacities);
  EXPECT_EQ(one.sh, other.sh);
}

TEST_F(SplatModelOfEveryKind, GivesTheSameBitsAtEveryTimeWhereNothingMoves) {
  size_t still_count = 0;
  for (const auto& model : allKinds()) {
    if (model->settings().time) continue;
    ++still_count;
    ModelRequest request = small();
    const SplatCloud still = model->decode(request);
    ASSERT_GT(still.size(), 0u);
    for (const double time : {-3.5, 0.25, 1e9}) {
      request.time = time;
      expectSameSplats(model->decode(request), still);
    }
  }
  EXPECT_EQ(still_count, 4u);
}

TEST_F(SplatModelOfEveryKind, RefusesATimeThatIsNotFinite) {
  for (const auto& model : allKinds()) {
    ModelRequest request = small();
    request.time = std::numeric_limits<double>::quiet_NaN();
    expectError(ErrorCode::kInvalidArgument, {"the time"}, [&] { model->decode(request); });
  }
}

TEST(SplatModel, OfASurfaceHasAllSettingsOfAnchors) {
  const ModelSettings settings = surface()->settings();
  EXPECT_EQ(settings.budget_unit, BudgetUnit::kAnchors);
  EXPECT_EQ(settings.maximum_budget, kMaxAnchorCount);
  EXPECT_EQ(settings.maximum_learned_budget, 0u);
  EXPECT_EQ(settings.minimum_gaussians_per_anchor, 1u);
  EXPECT_EQ(settings.maximum_gaussians_per_anchor, 32u);
  EXPECT_TRUE(settings.has_order && settings.has_seed);
  EXPECT_FALSE(settings.takes_mask);
}

TEST(SplatModel, OfACloudCountsItsSplats) {
  const auto model = hierarchy();
  const ModelSettings settings = model->settings();
  EXPECT_EQ(settings.budget_unit, BudgetUnit::kSplats);
  EXPECT_EQ(settings.maximum_budget, kSplats);
  EXPECT_EQ(settings.maximum_gaussians_per_anchor, 1u);
  EXPECT_FALSE(settings.has_order || settings.has_seed);
  EXPECT_TRUE(settings.takes_mask);
  EXPECT_EQ(model->density(), nullptr);
  std::vector<uint8_t> mask(kSplats, 1);
  mask[3] = mask[5] = 0;
  EXPECT_EQ(model->keep(mask)->settings().maximum_budget, kSplats - 2);
}

TEST(SplatModel, OfAFieldHasOneKAndAnOrderOnlyWhereItsDrawsAreNotNested) {
  const auto model = field(true);
  const ModelSettings settings = model->settings();
  EXPECT_EQ(settings.minimum_gaussians_per_anchor, 4u);
  EXPECT_EQ(settings.maximum_gaussians_per_anchor, 4u);
  EXPECT_EQ(settings.maximum_learned_budget, FieldShape().most_anchors);
  EXPECT_FALSE(settings.has_order);
  EXPECT_TRUE(field(false)->settings().has_order);
  // A K of 1 stands for its own.
  EXPECT_EQ(model->decode(small()).size(), 400u);
}

TEST(SplatModel, WithoutASettingGivesTheSameSplatsWhateverItsValue) {
  const auto expectNoDifference = [](const SplatModel& model, auto change) {
    ModelRequest request = small();
    const SplatCloud before = model.decode(request);
    change(request);
    expectSameSplats(model.decode(request), before);
  };
  const auto other_order = [](ModelRequest& request) { request.order = AnchorOrder::kProgressive; };
  expectNoDifference(*field(true), other_order);
  expectNoDifference(*hierarchy(), other_order);
  expectNoDifference(*hierarchy(), [](ModelRequest& request) { request.seed = 3; });
}

TEST_F(SplatModelOfEveryKind, ComesBackThroughTheTableWithTheSameSplats) {
  for (const auto& model : allKinds()) {
    const std::string file = path(model->kind());
    model->save(file);
    const auto again = loadModel(file, {{weights()}, nullptr});
    EXPECT_STREQ(again->kind(), model->kind());
    expectSameSplats(again->decode(small()), model->decode(small()));
    again->save(file + " again");
    EXPECT_EQ(load(file), load(file + " again")) << model->kind();
  }
}

}  // namespace
}  // namespace stipple
