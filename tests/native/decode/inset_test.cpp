// Splats lie as deep in the body that they enclose as puts its silhouette where the surface ends.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "decode/silhouette.h"
#include "decode/surface/surface_model.h"
#include "decode/test_meshes.h"
#include "splat/render/render.h"

namespace stipple {
namespace {

SplatCloud splatsOf(const TriMesh& mesh, uint64_t count) {
  SurfaceModelOptions options;
  options.sampling.detail_weight = 0;
  const SurfaceModel model = buildSurfaceModel(mesh, options);
  AnchorSamplingOptions sampling;
  sampling.count = count;
  const AnchorSet anchors = sampleAnchors(*model.density, sampling);
  DecodeRequest request;
  request.anchors = &anchors;
  return model.decoder->decode(request);
}

TriMesh turnedInsideOut(TriMesh mesh) {
  for (size_t t = 0; t < mesh.triangleCount(); ++t) {
    std::swap(mesh.triangles[t * 3], mesh.triangles[t * 3 + 1]);
  }
  for (float& value : mesh.corner_normals) value = -value;
  return mesh;
}

/// Pixels that the splats cover over pixels that the mesh covers, seen from one side.
double coveredShare(const TriMesh& mesh, const SplatCloud& cloud, double radius) {
  constexpr uint32_t kSize = 256;
  const Camera camera =
      test::viewFrom({1, 0.7, 0.6}, {0, 0, 0}, radius, kSize, CameraModel::kOrthographic);
  const std::vector<uint8_t> mask = test::rasterise(mesh, camera);
  const SplatInstance instance{&cloud, Mat4d::Identity()};
  const RenderResult picture = renderTiled({&instance, 1}, camera, RenderOptions{});
  double alpha = 0;
  for (size_t i = 0; i < mask.size(); ++i) {
    alpha += static_cast<double>(picture.colour[i * 4 + 3]);
  }
  return alpha / static_cast<double>(std::count(mask.begin(), mask.end(), 1));
}

double radiusOf(const SplatCloud& cloud, size_t i) {
  const auto x = static_cast<double>(cloud.positions[i * 3]);
  const auto y = static_cast<double>(cloud.positions[i * 3 + 1]);
  const auto z = static_cast<double>(cloud.positions[i * 3 + 2]);
  return std::sqrt(x * x + y * y + z * z);
}

TEST(InsetSplats, PutTheSilhouetteWhereTheSurfaceEnds) {
  const TriMesh ball = test::uvSphere(1, {0, 0, 0}, 128, 256);
  for (const uint64_t count : {2000u, 10000u, 50000u}) {
    // On the surface the splats of a ball cover 1.034, 1.013 and 1.010 times its disc, and the
    // eight pixels between 2,000 of them are more than the low-pass that is allowed for.
    const double share = coveredShare(ball, splatsOf(ball, count), 1);
    EXPECT_LT(share, 1.008) << count;
    EXPECT_GT(share, count == 2000 ? 0.97 : 0.985) << count;
  }
}

TEST(InsetSplats, GoInwardWhateverTheNormalsSay) {
  const TriMesh ball = test::uvSphere(1, {0, 0, 0}, 64, 128);
  const double spacing = std::sqrt(4 * 3.141592653589793 / 2000);
  for (const TriMesh& mesh : {ball, turnedInsideOut(ball)}) {
    const SplatCloud cloud = splatsOf(mesh, 2000);
    double mean = 0;
    for (size_t i = 0; i < cloud.size(); ++i) {
      EXPECT_LT(radiusOf(cloud, i), 1);
      mean += radiusOf(cloud, i) / static_cast<double>(cloud.size());
    }
    EXPECT_GT(mean, 1 - 0.6 * spacing);
    EXPECT_LT(mean, 1 - 0.15 * spacing);
  }
}

TEST(InsetSplats, StayOnTheirSideOfAThinPlate) {
  TriMesh plate = test::cube(2, {0, 0, 0});
  for (size_t i = 0; i < plate.vertexCount(); ++i) plate.positions[i * 3 + 2] *= 0.002f;
  // Splats a hundred times as far apart as the plate is thick.
  const SplatCloud cloud = splatsOf(plate, 200);
  size_t over = 0, under = 0;
  for (size_t i = 0; i < cloud.size(); ++i) {
    const float z = cloud.positions[i * 3 + 2];
    EXPECT_LE(std::abs(z), 0.002001f);
    (z > 0.0002f ? over : under) += std::abs(z) > 0.0002f;
  }
  EXPECT_GT(over, 80u);
  EXPECT_GT(under, 80u);
}

TEST(InsetSplats, LeaveASheetInItsPlane) {
  TriMesh sheet;
  sheet.positions = {-1, -1, 0.5f, 1, -1, 0.5f, 1, 1, 0.5f, -1, 1, 0.5f};
  sheet.triangles = {0, 1, 2, 0, 2, 3};
  sheet.materials.resize(1);
  const SplatCloud cloud = splatsOf(sheet, 3000);
  for (size_t i = 0; i < cloud.size(); ++i) EXPECT_NEAR(cloud.positions[i * 3 + 2], 0.5f, 1e-6f);
}

}  // namespace
}  // namespace stipple
