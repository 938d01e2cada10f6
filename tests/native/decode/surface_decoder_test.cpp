#include "decode/surface/surface_decoder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "base/error.h"
#include "base/parallel.h"
#include "decode/surface/surface_model.h"
#include "decode/test_meshes.h"
#include "math/colour.h"
#include "mesh/shown_harmonics.h"

namespace stipple {
namespace {

using ::testing::HasSubstr;

SurfaceModel modelOf(const TriMesh& mesh, uint64_t samples = 100000, int leaf_level = 10) {
  SurfaceModelOptions options;
  options.sampling.count = samples;
  options.sampling.detail_weight = 0;
  options.density.leaf_level = leaf_level;
  return buildSurfaceModel(mesh, options);
}

SplatCloud decoded(const SurfaceModel& model, uint64_t anchor_count, uint32_t per_anchor = 1,
                   uint64_t seed = 0) {
  AnchorSamplingOptions sampling;
  sampling.count = anchor_count;
  sampling.seed = seed;
  const AnchorSet anchors = sampleAnchors(*model.density, sampling);
  DecodeRequest request;
  request.anchors = &anchors;
  request.gaussians_per_anchor = per_anchor;
  request.seed = seed;
  return model.decoder->decode(request);
}

Vec3d position(const SplatCloud& cloud, size_t i) {
  return {static_cast<double>(cloud.positions[i * 3]),
          static_cast<double>(cloud.positions[i * 3 + 1]),
          static_cast<double>(cloud.positions[i * 3 + 2])};
}

/// Red comes along +x, green along -x, to a grey square that faces up.
TriMesh shimmeringSquare() {
  TriMesh mesh;
  mesh.positions = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
  mesh.triangles = {0, 1, 2, 0, 2, 3};
  mesh.corner_uvs.assign(12, 0.5f);
  mesh.view_directions = {0.6f, 0, -0.8f, -0.6f, 0, -0.8f};
  Image added;
  added.width = added.height = 1;
  added.channels = 3;
  mesh.textures.assign(2, added);
  mesh.textures[0].pixels = {0.3f, 0, 0};
  mesh.textures[1].pixels = {0, 0.3f, 0};
  Material material;
  for (size_t c = 0; c < 3; ++c) material.base_colour[c] = 0.2f;
  material.view_textures = {0, 1};
  mesh.materials = {material};
  return mesh;
}

TEST(SurfaceDecoder, GivesSplatsThatChangeWithTheView) {
  const SplatCloud cloud = decoded(modelOf(shimmeringSquare(), 20000), 500);
  ASSERT_EQ(cloud.sh_degree, 3);
  ASSERT_EQ(cloud.sh.size(), cloud.size() * 48);
  const auto shown = [&](size_t i, const Vec3d& d, size_t channel) {
    return shownAlong(&cloud.sh[i * 48], 3, d, channel);
  };
  for (size_t i = 0; i < cloud.size(); ++i) {
    // So few directions do not outweigh what holds coefficients small: it takes a third at most of
    // the step of 0.25 between them.
    EXPECT_NEAR(shown(i, Vec3d(0.6, 0, -0.8), 0), linearToSrgb(0.5), 0.08);
    EXPECT_NEAR(shown(i, Vec3d(0.6, 0, -0.8), 1), linearToSrgb(0.2), 0.08);
    EXPECT_NEAR(shown(i, Vec3d(-0.6, 0, -0.8), 0), linearToSrgb(0.2), 0.08);
    EXPECT_NEAR(shown(i, Vec3d(-0.6, 0, -0.8), 1), linearToSrgb(0.5), 0.08);
    EXPECT_NEAR(shown(i, Vec3d(0, 0, -1), 2), linearToSrgb(0.2), 0.08);
  }
}

/// Third axis of a splat: the direction of its thickness.
Vec3d normalOf(const SplatCloud& cloud, size_t i) {
  const auto w = static_cast<double>(cloud.rotations[i * 4]);
  const auto x = static_cast<double>(cloud.rotations[i * 4 + 1]);
  const auto y = static_cast<double>(cloud.rotations[i * 4 + 2]);
  const auto z = static_cast<double>(cloud.rotations[i * 4 + 3]);
  return {2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)};
}

/// How deep splat i of a ball of 1 m lies: what silhouettes.cpp says of its widths, the
/// curvature 1.
double insetInBall(const SplatCloud& cloud, size_t i) {
  const auto major = static_cast<double>(cloud.scales[i * 3]);
  const auto minor = static_cast<double>(cloud.scales[i * 3 + 1]);
  return 0.4 * minor + 2 * major * minor;
}

void expectValid(const SplatCloud& cloud) {
  validate(cloud, "decoded");
  for (const float scale : cloud.scales) ASSERT_GT(scale, 0.0f);
}

TEST(SurfaceDecoder, LaysFlatSplatsOnTheSurface) {
  const SplatCloud cloud = decoded(modelOf(test::uvSphere(1, {0, 0, 0}, 64, 128)), 5000);
  ASSERT_EQ(cloud.size(), 5000u);
  EXPECT_EQ(cloud.sh_degree, 0);
  EXPECT_EQ(cloud.colour_space, ColourSpace::kDisplay);
  expectValid(cloud);
  for (size_t i = 0; i < cloud.size(); ++i) {
    const Vec3d p = position(cloud, i);
    // The polyhedron's faces lie up to 1 − cos(pi/64)·cos(pi/128) = 1.5e-3 below the sphere, and
    // the curvature of a patch of few samples is off by a third: 1e-3 of what it adds, 3e-3.
    EXPECT_NEAR(p.norm(), 1.0 - insetInBall(cloud, i), 3e-3);
    // A patch of radius 0.05 may lean by a few hundredths.
    EXPECT_GT(normalOf(cloud, i).dot(p.normalized()), 0.995);
    EXPECT_LT(cloud.scales[i * 3 + 2], 0.36f * cloud.scales[i * 3 + 1]);
    EXPECT_LE(cloud.scales[i * 3 + 1], cloud.scales[i * 3] * 1.0001f);
  }
}

TEST(SurfaceDecoder, SizesSplatsByTheSpacing) {
  // Four times the splats, half the size.
  const SurfaceModel model = modelOf(test::terrain(2, 8, 0, {0, 0, 0}), 400000);
  const auto meanScale = [&](uint64_t count) {
    const SplatCloud cloud = decoded(model, count);
    double sum = 0;
    for (size_t i = 0; i < cloud.size(); ++i) {
      sum += std::sqrt(static_cast<double>(cloud.scales[i * 3] * cloud.scales[i * 3 + 1]));
    }
    return sum / static_cast<double>(cloud.size());
  };
  const double coarse = meanScale(2000), fine = meanScale(8000);
  EXPECT_NEAR(coarse / fine, 2.0, 0.2);  // borders weigh more at the smaller count
  // About 2/3 of the spacing sqrt(4 / 2000); a regular square pattern closes at 0.66.
  EXPECT_NEAR(coarse / std::sqrt(4.0 / 2000), 0.7, 0.12);
}

TEST(SurfaceDecoder, GivesTheMeanColourOfThePatchInDisplaySpace) {
  // A material of one colour: exact. Left black, right white: means in between only at the seam.
  TriMesh mesh = test::terrain(1, 4, 0, {0, 0, 0});
  mesh.materials[0] = Material{MaterialColour::kConstant, {0.5f, 0.2f, 0.05f, 1.0f}, kNoTexture};
  SplatCloud cloud = decoded(modelOf(mesh), 300);
  for (size_t i = 0; i < cloud.size(); ++i) {
    EXPECT_NEAR(static_cast<double>(cloud.sh[i * 3] * kShC0 + 0.5f), linearToSrgb(0.5), 1e-5);
    EXPECT_NEAR(static_cast<double>(cloud.sh[i * 3 + 2] * kShC0 + 0.5f), linearToSrgb(0.05), 1e-5);
    EXPECT_EQ(cloud.opacities[i], 0.99f);
  }
  // A fine chequer of black and white: every patch sees many cells and takes their linear mean 1/2.
  mesh.materials[0].colour = MaterialColour::kTexture;
  mesh.materials[0].texture = 0;
  for (size_t k = 0; k < mesh.triangles.size(); ++k) {
    mesh.corner_uvs.push_back(mesh.positions[size_t{mesh.triangles[k]} * 3]);
    mesh.corner_uvs.push_back(mesh.positions[size_t{mesh.triangles[k]} * 3 + 1]);
  }
  Image image{128, 128, 1, {}, Transfer::kSrgb};
  for (int y = 0; y < 128; ++y) {
    for (int x = 0; x < 128; ++x) image.pixels.push_back((x + y) % 2 == 0 ? 1.0f : 0.0f);
  }
  mesh.textures.push_back(image);
  cloud = decoded(modelOf(mesh), 300);
  double sum = 0;
  for (size_t i = 0; i < cloud.size(); ++i) {
    const double value = srgbToLinear(static_cast<double>(cloud.sh[i * 3] * kShC0 + 0.5f));
    // A patch takes part in about 50 samples, whose cells are averaged by few taps each.
    EXPECT_NEAR(value, 0.5, 0.15);
    sum += value;
  }
  // The mean over all patches: their deviations of at most 0.05 average to 0.05 / sqrt(300).
  EXPECT_NEAR(sum / static_cast<double>(cloud.size()), 0.5, 4 * 0.05 / std::sqrt(300.0));
}

TEST(SurfaceDecoder, CarriesTheOpacityOfTheSurface) {
  TriMesh mesh = test::terrain(1, 4, 0, {0, 0, 0});
  mesh.materials[0].base_colour[3] = 0.25f;
  const SplatCloud cloud = decoded(modelOf(mesh), 500);
  for (const float opacity : cloud.opacities) EXPECT_NEAR(opacity, 0.25f, 1e-5f);
}

TEST(SurfaceDecoder, KeepsTheColoursOfCloseSheetsApart) {
  // A red square 0.02 above a blue one; the spacing is 0.045. Both face up: only height tells them
  // apart.
  TriMesh mesh =
      test::joined(test::terrain(1, 4, 0, {0, 0, 0.02}), test::terrain(1, 4, 0, {0, 0, 0}));
  mesh.materials[0] = Material{MaterialColour::kConstant, {1, 0, 0, 1}, kNoTexture};
  mesh.materials.push_back(Material{MaterialColour::kConstant, {0, 0, 1, 1}, kNoTexture});
  mesh.triangle_materials.assign(mesh.triangleCount(), 0);
  std::fill(mesh.triangle_materials.begin() + 32, mesh.triangle_materials.end(), 1u);
  const SplatCloud cloud = decoded(modelOf(mesh), 1000);
  size_t mixed = 0;
  for (size_t i = 0; i < cloud.size(); ++i) {
    const float red = cloud.sh[i * 3] * kShC0 + 0.5f;
    const bool upper = cloud.positions[i * 3 + 2] > 0.01f;
    mixed += upper ? red < 0.9f : red > 0.3f;
  }
  EXPECT_LE(mixed, 10u);  // 1 %: where one sheet's anchors leave a gap of more than two spacings
}

TEST(SurfaceDecoder, IsTheSameForAnyNumberOfThreads) {
  const SurfaceModel model = modelOf(test::torus(1, 0.4, 48, 24));
  SplatCloud one, two;
  withThreads(1, [&] { one = decoded(model, 8000, 2, 5); });
  withThreads(2, [&] { two = decoded(model, 8000, 2, 5); });
  EXPECT_EQ(one.positions, two.positions);
  EXPECT_EQ(one.rotations, two.rotations);
  EXPECT_EQ(one.scales, two.scales);
  EXPECT_EQ(one.sh, two.sh);
  EXPECT_NE(decoded(model, 8000, 2, 6).positions, one.positions);
}

TEST(SurfaceDecoder, SpreadsSeveralGaussiansOverTheAnchorsPatch) {
  const SurfaceModel model = modelOf(test::uvSphere(1, {0, 0, 0}, 48, 96));
  const SplatCloud cloud = decoded(model, 500, 4);
  ASSERT_EQ(cloud.size(), 2000u);
  expectValid(cloud);
  // In anchor order: the four of an anchor lie within two of the anchors' spacings of each other.
  const double spacing = std::sqrt(12.566 / 500);
  for (size_t i = 0; i < cloud.size(); i += 4) {
    for (size_t k = 1; k < 4; ++k) {
      const double distance = (position(cloud, i + k) - position(cloud, i)).norm();
      EXPECT_GT(distance, 0.05 * spacing);
      EXPECT_LT(distance, 2 * spacing);
    }
  }
}

TEST(SurfaceDecoder, HandlesOneAnchorAndOneTriangle) {
  TriMesh mesh;
  mesh.positions = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  mesh.triangles = {0, 1, 2};
  mesh.materials.resize(1);
  const SurfaceModel model = modelOf(mesh, 2000);
  const SplatCloud cloud = decoded(model, 1);
  ASSERT_EQ(cloud.size(), 1u);
  expectValid(cloud);
  EXPECT_NEAR((position(cloud, 0) - Vec3d(1.0 / 3, 1.0 / 3, 0)).norm(), 0, 0.03);
  EXPECT_NEAR(std::abs(normalOf(cloud, 0).z()), 1.0, 1e-5);
  EXPECT_EQ(decoded(model, 7).size(), 7u);
}

TEST(SurfaceDecoder, SpreadsManyAnchorsOverFewLeavesAndSamples) {
  // 64 cells at level 2 and 500 samples for 20,000 anchors: no two splats in one place, no holes
  // larger than a sample's spacing of 0.045.
  const SurfaceModel model = modelOf(test::terrain(1, 4, 0, {0, 0, 0}), 500, 2);
  const SplatCloud cloud = decoded(model, 20000);
  expectValid(cloud);
  std::set<std::pair<float, float>> places;
  std::vector<int> cells(400, 0);
  for (size_t i = 0; i < cloud.size(); ++i) {
    const float x = cloud.positions[i * 3], y = cloud.positions[i * 3 + 1];
    EXPECT_NEAR(cloud.positions[i * 3 + 2], 0.0f, 1e-6f);
    places.emplace(x, y);
    const int column = std::clamp(static_cast<int>((x + 0.5f) * 20), 0, 19);
    const int row = std::clamp(static_cast<int>((y + 0.5f) * 20), 0, 19);
    ++cells[static_cast<size_t>(row * 20 + column)];
  }
  EXPECT_GT(places.size(), 19000u);
  EXPECT_EQ(std::count(cells.begin(), cells.end(), 0), 0);
}

TEST(SurfaceDecoder, HandlesNeedlesAndSpecks) {
  // A sliver 1e-4 wide, a speck of 1e-5 and a face of ordinary size in one mesh.
  TriMesh mesh;
  mesh.positions = {0, 0, 0, 3,         0, 0, 3, 1e-4f, 0, 5, 5, 5, 5, 5 + 1e-5f,
                    5, 5, 5, 5 + 1e-5f, 0, 0, 1, 1,     0, 1, 0, 1, 1};
  mesh.triangles = {0, 1, 2, 3, 4, 5, 6, 7, 8};
  mesh.materials.resize(1);
  expectValid(decoded(modelOf(mesh), 5000));
}

TEST(SurfaceDecoder, KeepsItsPrecisionFarFromTheOrigin) {
  const SplatCloud cloud = decoded(modelOf(test::uvSphere(1, {20000, 0, 0}, 32, 64)), 2000);
  expectValid(cloud);
  for (size_t i = 0; i < cloud.size(); ++i) {
    // float32 steps at 20,000 are 2e-3; the facets add 6e-3.
    EXPECT_NEAR((position(cloud, i) - Vec3d(20000, 0, 0)).norm(), 1.0 - insetInBall(cloud, i),
                2e-2);
  }
}

TEST(SurfaceDecoder, RefusesBadRequestsAndStopsWhenCancelled) {
  const SurfaceModel model = modelOf(test::cube(1, {0, 0, 0}), 5000);
  const auto refusal = [&](const DecodeRequest& request) -> std::string {
    try {
      model.decoder->decode(request);
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  };
  DecodeRequest request;
  EXPECT_THAT(refusal(request), HasSubstr("anchors are missing"));
  AnchorSamplingOptions sampling;
  const AnchorSet anchors = sampleAnchors(*model.density, sampling);
  request.anchors = &anchors;
  request.gaussians_per_anchor = 0;
  EXPECT_THAT(refusal(request), HasSubstr("Gaussians per anchor is 0"));
  request.gaussians_per_anchor = 1;
  Progress progress;
  progress.cancel();
  request.progress = &progress;
  try {
    model.decoder->decode(request);
    FAIL() << "was not cancelled";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCancelled);
  }
  EXPECT_THROW(SurfaceDecoder(nullptr, RootCube{}, 10), Error);
}

}  // namespace
}  // namespace stipple
