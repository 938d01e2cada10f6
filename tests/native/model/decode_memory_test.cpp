#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "decode/field/field_parameters.h"
#include "decode/test_clouds.h"
#include "decode/test_meshes.h"
#include "decode/tree/merge_tree.h"
#include "io/scratch_folder.h"
#include "model/field_splats.h"
#include "model/hierarchy_splats.h"
#include "model/motion_splats.h"
#include "model/splat_model.h"
#include "model/surface_splats.h"
#include "moving_cloud.h"
#include "small_latent.h"
#include "train/allocation_count.h"

namespace stipple {
namespace {

using Model = std::shared_ptr<const SplatModel>;

constexpr int kLeafLevel = 8;

Model surfaceOf(const TriMesh& mesh, uint64_t sample_count) {
  SurfaceModelOptions options;
  options.sampling.count = sample_count;
  options.density.leaf_level = kLeafLevel;
  return makeSurfaceSplats(buildSurfaceModel(mesh, options));
}

Model ball() {
  return surfaceOf(test::uvSphere(1, {0, 0, 0}, 48, 96), 200000);
}

/// Specks so far from each other that hardly two splats share a cell: the most tables for a splat.
Model dust() {
  constexpr int kSpecks = 4096;
  constexpr float kSide = 1e-3f;
  TriMesh mesh = test::cube(1e-3, {0, 0, 0});
  mesh.positions.clear();
  mesh.triangles.clear();
  mesh.triangle_materials.clear();
  for (int i = 0; i < kSpecks; ++i) {
    const auto part = static_cast<float>(i);
    // Even at any count: multiples of the powers of the inverse of the plastic number.
    const float place[3] = {std::fmod(part * 0.8191725f, 1.0f), std::fmod(part * 0.6710436f, 1.0f),
                            std::fmod(part * 0.5497005f, 1.0f)};
    const auto first = static_cast<uint32_t>(3 * i);
    for (int corner = 0; corner < 3; ++corner) {
      for (int axis = 0; axis < 3; ++axis) {
        mesh.positions.push_back(place[axis] + (axis == corner ? kSide : 0.0f));
      }
    }
    mesh.triangles.insert(mesh.triangles.end(), {first, first + 1, first + 2});
  }
  return surfaceOf(mesh, 40000);
}

Model fieldOf(int degree, uint32_t gaussians) {
  FieldShape shape;
  shape.leaf_level = kLeafLevel;
  shape.layout.sh_degree = degree;
  shape.layout.gaussians = gaussians;
  std::vector<float> points;
  constexpr int kPoints = 20000;
  for (int i = 0; i < kPoints; ++i) {
    const float turn = 2 * 3.1415927f * 0.618034f * static_cast<float>(i % 1000);
    const float z = 2 * (static_cast<float>(i) + 0.5f) / kPoints - 1;
    const float radius = 0.4f * std::sqrt(1 - z * z);
    points.insert(points.end(), {0.5f + radius * std::sin(turn), 0.5f + radius * std::cos(turn),
                                 0.5f + 0.4f * z});
  }
  OctreeDensityOptions options;
  options.leaf_level = kLeafLevel;
  auto density =
      std::make_shared<const OctreeDensity>(OctreeDensity::fromPoints(points, {}, options));
  shape.root = density->root();
  return makeFieldSplats(std::move(density),
                         std::make_shared<const FieldParameters>(makeFieldParameters(shape)),
                         {true, true, 7});
}

Model hierarchyOf(int degree) {
  auto cloud = std::make_shared<const SplatCloud>(test::randomCloud(50000, 1, degree));
  auto tree = std::make_shared<const MergeTree>(buildMergeTree(*cloud, {}, {}));
  return makeHierarchySplats(std::make_shared<const HierarchyDecoder>(cloud, tree));
}

struct Use {
  uint64_t peak = 0;
  uint64_t bound = 0;
};

Use useOf(const SplatModel& model, uint64_t budget, uint32_t gaussians,
          AnchorOrder order = AnchorOrder::kSystematic) {
  ModelRequest request;
  request.budget = budget;
  request.gaussians_per_anchor = gaussians;
  request.order = order;
  Use use;
  use.bound = model.memoryBound(request);
  use.peak = testing::mostBytesDuring([&] { model.decode(request); });
  return use;
}

/// A bound below what is held would let a decode take more memory than the limit; one of more than
/// twice that refuses budgets that fit.
void expectTight(const std::string& name, const Use& use) {
  EXPECT_GE(use.bound, use.peak) << name;
  EXPECT_LE(use.bound, 2 * use.peak) << name;
}

TEST(DecodeMemory, OfSurfacesIsBoundTightly) {
  const Model model = ball();
  expectTight("1 an anchor", useOf(*model, 150000, 1));
  expectTight("progressive", useOf(*model, 150000, 1, AnchorOrder::kProgressive));
  expectTight("4 an anchor", useOf(*model, 40000, 4));
  expectTight("32 an anchor", useOf(*model, 5000, 32));
}

TEST(DecodeMemory, OfSplatsThatShareNoCellsIsWithinTheBound) {
  const Model model = dust();
  for (const uint64_t budget : {4096u, 30000u, 60000u, 120000u}) {
    const Use use = useOf(*model, budget, 1);
    EXPECT_GE(use.bound, use.peak) << budget;
  }
}

TEST(DecodeMemory, OfFewAnchorsIsWithinTheBound) {
  const Model model = ball();
  for (const uint64_t budget : {1u, 100u, 2000u, 24000u}) {
    const Use use = useOf(*model, budget, 1);
    EXPECT_GE(use.bound, use.peak) << budget;
  }
}

TEST(DecodeMemory, OfHierarchiesIsBoundTightly) {
  for (const int degree : {0, 3}) {
    const Model model = hierarchyOf(degree);
    for (const uint64_t budget : {10000u, 49999u, 50000u}) {
      expectTight(std::to_string(degree) + " at " + std::to_string(budget),
                  useOf(*model, budget, 1));
    }
  }
}

TEST(DecodeMemory, OfMovingSplatsIsWithinTheBoundWithAndWithoutTheirTree) {
  constexpr uint64_t kCount = 20000;
  const Model model = makeMotionSplats(test::movingCloud(kCount));
  expectTight("all", useOf(*model, kCount, 1));
  // The first smaller budget builds the tree. Its bound is of the most times that it may be asked
  // for, twice as many as it has by default.
  const Use building = useOf(*model, kCount / 2, 1);
  EXPECT_GE(building.bound, building.peak);
  EXPECT_LE(building.bound, 3 * building.peak);
  const Use cutting = useOf(*model, kCount / 2, 1);
  EXPECT_GE(cutting.bound, cutting.peak);
  EXPECT_LT(cutting.bound, building.bound / 2);
}

TEST(DecodeMemory, OfFieldsIsBoundTightly) {
  for (const int degree : {0, 3}) {
    for (const uint32_t gaussians : {4u, 16u}) {
      const Model model = fieldOf(degree, gaussians);
      expectTight(std::to_string(degree) + " with " + std::to_string(gaussians),
                  useOf(*model, 20000, gaussians));
    }
  }
}

class DecodeMemoryOfLatents : public ScratchFolder {};

TEST_F(DecodeMemoryOfLatents, IsWithinTheBound) {
  // Keys and values of the latent are made by the first decode and stay.
  const std::string golden = STIPPLE_TEST_DATA "/networks/deg_pipeline_a.safetensors";
  for (const uint64_t budget : {32u, 2048u, 10000u}) {
    const Model model = test::smallLatent(golden, folder_.string());
    const Use use = useOf(*model, budget, 32);
    EXPECT_GE(use.bound, use.peak) << budget;
    // What each thread packs and 24 MiB of the sampler are constant, and much beside a network of
    // 64 channels.
    constexpr uint64_t kConstant = uint64_t{96} << 20;
    EXPECT_LE(use.bound, 2 * use.peak + kConstant) << budget;
  }
}

}  // namespace
}  // namespace stipple
