// The surface decoder's promise: no holes inside a silhouette, no growth over it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "decode/silhouette.h"
#include "decode/surface/surface_model.h"
#include "decode/test_meshes.h"
#include "splat/render/render.h"

namespace stipple {
namespace {

using test::SilhouetteFit;

struct Worst {
  SilhouetteFit fit;
  size_t open_count = 0;
};

/// The worst figures over views from five directions, perspective and orthographic in turn.
Worst worstOverViews(const TriMesh& mesh, const SplatCloud& cloud, double area, uint64_t splats) {
  constexpr uint32_t kSize = 320;
  const Vec3d directions[] = {{0, 0, 1}, {0, -1, 0}, {1, 0.7, 0.6}, {-0.5, 1, 0.2}, {0.3, -0.6, 1}};
  Vec3d low(1e30, 1e30, 1e30), high(-1e30, -1e30, -1e30);
  for (size_t i = 0; i < mesh.vertexCount(); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      const auto x = static_cast<double>(mesh.positions[i * 3 + static_cast<size_t>(axis)]);
      low[axis] = std::min(low[axis], x);
      high[axis] = std::max(high[axis], x);
    }
  }
  const Vec3d centre = 0.5 * (low + high);
  const double radius = 0.5 * (high - low).norm();
  Worst worst;
  for (size_t k = 0; k < std::size(directions); ++k) {
    const Camera camera =
        test::viewFrom(directions[k], centre, radius, kSize,
                       k % 2 == 0 ? CameraModel::kPerspective : CameraModel::kOrthographic);
    const std::vector<uint8_t> mask = test::rasterise(mesh, camera);
    // An open sheet seen edge-on has no silhouette to compare with.
    if (std::count(mask.begin(), mask.end(), 1) < 500) continue;
    const SplatInstance instance{&cloud, Mat4d::Identity()};
    const RenderResult picture = renderTiled({&instance, 1}, camera, RenderOptions{});
    std::vector<float> alpha(mask.size());
    for (size_t i = 0; i < alpha.size(); ++i) alpha[i] = picture.colour[i * 4 + 3];
    // Spacing as the mean distance of the splats on the surface, at the depth of its middle.
    const double scale =
        camera.model == CameraModel::kPerspective ? camera.fx / (4 * radius) : camera.fx;
    const SilhouetteFit fit = test::measureFit(
        mask, alpha, kSize, kSize, std::sqrt(area / static_cast<double>(splats)) * scale);
    worst.fit.min_inside = std::min(worst.fit.min_inside, fit.min_inside);
    worst.fit.mean_outside = std::max(worst.fit.mean_outside, fit.mean_outside);
    worst.fit.max_beyond = std::max(worst.fit.max_beyond, fit.max_beyond);
    worst.fit.inside_count += fit.inside_count;
    worst.open_count +=
        static_cast<size_t>(std::llround(fit.open_share * static_cast<double>(fit.inside_count)));
  }
  return worst;
}

/// Decodes `mesh` at four budgets and checks the promise at each.
void expectClosed(const char* name, const TriMesh& mesh, uint32_t per_anchor = 1,
                  double detail_weight = 0) {
  SurfaceModelOptions options;
  options.sampling.detail_weight = detail_weight;
  const SurfaceModel model = buildSurfaceModel(mesh, options);
  double area = 0;
  for (const float share : model.surface->areas) area += static_cast<double>(share);
  for (const uint64_t splats : {1000u, 4000u, 20000u, 50000u, 100000u}) {
    if (splats < 1000 * per_anchor) continue;  // budgets are of anchors
    for (const AnchorOrder order : {AnchorOrder::kSystematic, AnchorOrder::kProgressive}) {
      AnchorSamplingOptions sampling;
      sampling.count = splats / per_anchor;
      sampling.order = order;
      sampling.seed = 3;
      const AnchorSet anchors = sampleAnchors(*model.density, sampling);
      DecodeRequest request;
      request.anchors = &anchors;
      request.gaussians_per_anchor = per_anchor;
      const SplatCloud cloud = model.decoder->decode(request);
      const Worst worst = worstOverViews(mesh, cloud, area, splats);
      std::printf(
          "%-9s %6llu splats %-11s alpha inside >= %.4f (%zu of %zu px below 0.98), "
          "1-2 spacings out %.4f, beyond 3 %.4f\n",
          name, static_cast<unsigned long long>(splats),
          order == AnchorOrder::kSystematic ? "systematic" : "progressive", worst.fit.min_inside,
          worst.open_count, worst.fit.inside_count, worst.fit.mean_outside, worst.fit.max_beyond);
      EXPECT_GE(worst.fit.min_inside, 0.98) << name << ' ' << splats;
      EXPECT_LE(worst.fit.mean_outside, 0.05) << name << ' ' << splats;
      EXPECT_EQ(worst.fit.max_beyond, 0.0) << name << ' ' << splats;
    }
  }
}

TEST(SurfaceCoverage, ClosesASphere) {
  expectClosed("sphere", test::uvSphere(1, {0, 0, 0}, 48, 96));
}

TEST(SurfaceCoverage, ClosesACubeUpToItsEdges) {
  expectClosed("cube", test::cube(2, {0, 0, 0}));
}

TEST(SurfaceCoverage, ClosesAPlaneUpToItsOpenBorder) {
  expectClosed("plane", test::terrain(2, 8, 0, {0, 0, 0}));
}

TEST(SurfaceCoverage, ClosesATerrainFarFromTheOrigin) {
  // 1000 m from the origin: float32 positions keep 6e-5 m there, a hundredth of a spacing.
  expectClosed("terrain", test::terrain(2, 64, 0.15, {1000, -500, 20}));
}

TEST(SurfaceCoverage, ClosesATorus) {
  expectClosed("torus", test::torus(1, 0.3, 96, 32));
}

TEST(SurfaceCoverage, ClosesTwoSheetsCloserThanASpacing) {
  expectClosed("sheets", test::joined(test::uvSphere(1, {0, 0, 0}, 48, 96),
                                      test::uvSphere(0.97, {0, 0, 0}, 48, 96)));
}

TEST(SurfaceCoverage, ClosesObjectsOfDifferentSize) {
  TriMesh mesh = test::cube(0.4, {1.6, 0, 0.3});
  mesh = test::joined(test::uvSphere(1, {0, 0, 0}, 48, 96), mesh);
  expectClosed("objects", test::joined(mesh, test::uvSphere(0.15, {-1.4, 0.4, 0.5}, 24, 48)));
}

TEST(SurfaceCoverage, ClosesSuzanne) {
  expectClosed("suzanne", test::loadObj(STIPPLE_TEST_DATA "/suzanne.obj"));
}

TEST(SurfaceCoverage, ClosesSuzanneWithFourGaussiansPerAnchor) {
  expectClosed("4 each", test::loadObj(STIPPLE_TEST_DATA "/suzanne.obj"), 4);
}

TEST(SurfaceCoverage, ClosesSurfacesWhoseDetailAttractsAnchors) {
  // The default weight: local spacings differ by the square root of the density's range.
  expectClosed("suz w=1", test::loadObj(STIPPLE_TEST_DATA "/suzanne.obj"), 1, 1.0);
  expectClosed("cube w=1", test::cube(2, {0, 0, 0}), 1, 1.0);
}

TEST(SurfaceCoverage, MeasuresAHoleAndAFringe) {
  // The measure itself: a picture with one open pixel deep inside and a fringe 1.5 spacings wide.
  constexpr uint32_t kSize = 64;
  std::vector<uint8_t> mask(kSize * kSize, 0);
  std::vector<float> alpha(kSize * kSize, 0.0f);
  for (uint32_t y = 16; y < 48; ++y) {
    for (uint32_t x = 16; x < 48; ++x) {
      mask[y * kSize + x] = 1;
      alpha[y * kSize + x] = 1;
    }
  }
  SilhouetteFit fit = test::measureFit(mask, alpha, kSize, kSize, 4);
  EXPECT_EQ(fit.min_inside, 1.0);
  EXPECT_EQ(fit.mean_outside, 0.0);
  EXPECT_EQ(fit.inside_count, 24u * 24u);  // distances of 4.5 and more: 4 pixels off each side
  alpha[32 * kSize + 32] = 0.5f;
  for (uint32_t y = 16; y < 48; ++y) {
    for (uint32_t x = 48; x < 54; ++x) alpha[y * kSize + x] = 0.4f;
  }
  alpha[2 * kSize + 2] = 0.25f;
  fit = test::measureFit(mask, alpha, kSize, kSize, 4);
  EXPECT_EQ(fit.min_inside, 0.5);
  EXPECT_GT(fit.mean_outside, 0.02);
  EXPECT_EQ(fit.max_beyond, 0.25);
}

}  // namespace
}  // namespace stipple
