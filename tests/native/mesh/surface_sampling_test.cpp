#include "mesh/surface_sampling.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "base/error.h"
#include "base/parallel.h"
#include "data/clouds/splat_cloud.h"
#include "math/colour.h"
#include "mesh/shown_harmonics.h"

namespace stipple {
namespace {

using ::testing::HasSubstr;

/// Two triangles of a rectangle of width x height in z = 0, normal +z.
TriMesh rectangle(float width, float height) {
  TriMesh mesh;
  mesh.positions = {0, 0, 0, width, 0, 0, width, height, 0, 0, height, 0};
  mesh.triangles = {0, 1, 2, 0, 2, 3};
  mesh.materials.resize(1);
  return mesh;
}

void addRectangleUvs(TriMesh& mesh) {
  mesh.corner_uvs = {0, 0, 1, 0, 1, 1, 0, 0, 1, 1, 0, 1};
}

PointSet sampled(const TriMesh& mesh, uint64_t count, double detail_weight = 0, uint64_t seed = 0) {
  SurfaceSamplingOptions options;
  options.count = count;
  options.detail_weight = detail_weight;
  options.seed = seed;
  return sampleSurface(mesh, options);
}

TEST(SurfaceSampling, GivesExactlyTheCountWithTheWholeAreaSharedEqually) {
  const PointSet set = sampled(rectangle(3, 2), 1000);
  ASSERT_EQ(set.size(), 1000u);
  double area = 0;
  for (const float share : set.areas) area += static_cast<double>(share);
  EXPECT_NEAR(area, 6.0, 6e-7 * 10);  // 1000 float roundings of 6e-3
  EXPECT_EQ(set.weights, set.areas);
}

TEST(SurfaceSampling, LiesOnTheSurfaceAndFollowsItsArea) {
  // One triangle of area 1.5 and one of 0.5: three quarters of the samples, one stratum off at
  // most.
  TriMesh mesh;
  mesh.positions = {0, 0, 0, 3, 0, 0, 0, 1, 0, 0, 0, 5, 1, 0, 5, 0, 1, 5};
  mesh.triangles = {0, 1, 2, 3, 4, 5};
  mesh.materials.resize(1);
  const PointSet set = sampled(mesh, 4000);
  size_t low = 0;
  for (size_t i = 0; i < set.size(); ++i) {
    const float* p = &set.positions[i * 3];
    if (p[2] == 0.0f) {
      ++low;
      EXPECT_LE(p[0] / 3 + p[1], 1 + 1e-6f);
    } else {
      EXPECT_EQ(p[2], 5.0f);
      EXPECT_LE(p[0] + p[1], 1 + 1e-6f);
    }
    EXPECT_GE(p[0], 0.0f);
    EXPECT_GE(p[1], 0.0f);
  }
  EXPECT_NEAR(static_cast<double>(low), 3000.0, 1.0);
}

TEST(SurfaceSampling, IsStratifiedInsideALargeTriangle) {
  // 10,000 samples over 20 x 20 cells: independent draws would leave a standard deviation of 5 per
  // cell of 25; a low-discrepancy set keeps far below half of it.
  const PointSet set = sampled(rectangle(1, 1), 10000);
  std::vector<double> cells(400, 0.0);
  for (size_t i = 0; i < set.size(); ++i) {
    const auto x = static_cast<size_t>(std::min(set.positions[i * 3] * 20, 19.0f));
    const auto y = static_cast<size_t>(std::min(set.positions[i * 3 + 1] * 20, 19.0f));
    cells[y * 20 + x] += 1;
  }
  double variance = 0;
  for (const double cell : cells) variance += (cell - 25) * (cell - 25) / 400;
  EXPECT_LT(std::sqrt(variance), 2.5);
}

TEST(SurfaceSampling, SkipsFacesWithoutArea) {
  TriMesh mesh = rectangle(1, 1);
  mesh.triangles = {0, 0, 1, 0, 1, 2, 1, 1, 1, 0, 2, 3, 3, 3, 3};
  const PointSet set = sampled(mesh, 5000);
  for (size_t i = 0; i < set.size(); ++i) {
    ASSERT_TRUE(std::isfinite(set.positions[i * 3]));
    ASSERT_EQ(set.normals[i * 3 + 2], 1.0f);
  }
}

TEST(SurfaceSampling, InterpolatesCornerNormalsAndFallsBackOnFaces) {
  TriMesh mesh = rectangle(1, 1);
  EXPECT_EQ(sampled(mesh, 1).normals, (std::vector<float>{0, 0, 1}));
  const float s = std::sqrt(0.5f);
  for (int corner = 0; corner < 6; ++corner) {
    mesh.corner_normals.insert(mesh.corner_normals.end(), {s, 0, s});
  }
  EXPECT_NEAR(sampled(mesh, 1).normals[0], s, 1e-6f);
  mesh.corner_normals.assign(18, 0.0f);
  EXPECT_EQ(sampled(mesh, 1).normals, (std::vector<float>{0, 0, 1}));
}

TEST(SurfaceSampling, ReadsConstantAndCornerColours) {
  TriMesh mesh = rectangle(1, 1);
  mesh.materials[0] = Material{MaterialColour::kConstant, {0.1f, 0.2f, 0.3f, 0.4f}, kNoTexture};
  PointSet set = sampled(mesh, 10);
  EXPECT_EQ(set.colours[0], 0.1f);
  EXPECT_EQ(set.colours[2], 0.3f);
  EXPECT_EQ(set.opacities[5], 0.4f);
  // Red grows with x: the colour of a sample is its position.
  mesh.materials[0].colour = MaterialColour::kCorner;
  mesh.corner_colours = {0, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1};
  set = sampled(mesh, 100);
  for (size_t i = 0; i < set.size(); ++i) {
    EXPECT_NEAR(set.colours[i * 3], set.positions[i * 3], 1e-6f);
  }
}

TEST(SurfaceSampling, FiltersTexturesInSceneLinear) {
  // A black and a white texel side by side, sRGB: between them the bilinear value is the linear
  // mean, and the repeat wrap makes the left edge grey too.
  TriMesh mesh = rectangle(1, 1);
  addRectangleUvs(mesh);
  mesh.materials[0].colour = MaterialColour::kTexture;
  mesh.materials[0].texture = 0;
  mesh.textures.push_back(Image{2, 1, 3, {0, 0, 0, 1, 1, 1}, Transfer::kSrgb});
  const PointSet set = sampled(mesh, 400);
  for (size_t i = 0; i < set.size(); ++i) {
    const double x = static_cast<double>(set.positions[i * 3]);
    // Distance to the white centre at 0.75, wrapped, in texels.
    double distance = std::abs(x - 0.75);
    distance = 2 * std::min(distance, 1 - distance);
    EXPECT_NEAR(static_cast<double>(set.colours[i * 3]), 1 - distance, 2e-6);
  }
}

TEST(SurfaceSampling, DecodesTheDisplayTransferOfATexture) {
  TriMesh mesh = rectangle(1, 1);
  addRectangleUvs(mesh);
  mesh.materials[0].colour = MaterialColour::kTexture;
  mesh.materials[0].texture = 0;
  mesh.textures.push_back(Image{1, 1, 4, {0.5f, 0.25f, 0.02f, 0.75f}, Transfer::kSrgb});
  const PointSet set = sampled(mesh, 1);
  EXPECT_NEAR(static_cast<double>(set.colours[0]), srgbToLinear(0.5), 1e-6);
  EXPECT_NEAR(static_cast<double>(set.colours[1]), srgbToLinear(0.25), 1e-6);
  EXPECT_NEAR(static_cast<double>(set.colours[2]), srgbToLinear(0.02), 1e-6);
  EXPECT_EQ(set.opacities[0], 0.75f);
}

TEST(SurfaceSampling, PutsRowZeroOfATextureAtTheTop) {
  TriMesh mesh = rectangle(1, 1);
  addRectangleUvs(mesh);
  mesh.materials[0].colour = MaterialColour::kTexture;
  mesh.materials[0].texture = 0;
  Image image{1, 64, 3, {}, Transfer::kLinear};
  for (int row = 0; row < 64; ++row) {
    const float value = row < 32 ? 1.0f : 0.0f;
    image.pixels.insert(image.pixels.end(), {value, value, value});
  }
  mesh.textures.push_back(image);
  const PointSet set = sampled(mesh, 200);
  for (size_t i = 0; i < set.size(); ++i) {
    const float y = set.positions[i * 3 + 1];
    if (std::abs(y - 0.5f) < 0.1f || y < 0.1f || y > 0.9f) continue;
    EXPECT_EQ(set.colours[i * 3], y > 0.5f ? 1.0f : 0.0f);
  }
}

TEST(SurfaceSampling, AveragesATextureFinerThanTheSamples) {
  // A chequer of single texels, 200 samples on 65,536 texels: a single tap would be 0 or 1
  // (standard deviation up to 0.5); eight bilinear taps keep within a third of it.
  TriMesh mesh = rectangle(1, 1);
  addRectangleUvs(mesh);
  mesh.materials[0].colour = MaterialColour::kTexture;
  mesh.materials[0].texture = 0;
  Image image{256, 256, 1, {}, Transfer::kLinear};
  for (int y = 0; y < 256; ++y) {
    for (int x = 0; x < 256; ++x) image.pixels.push_back((x + y) % 2 == 0 ? 1.0f : 0.0f);
  }
  mesh.textures.push_back(image);
  const PointSet set = sampled(mesh, 200);
  double sum = 0, square = 0;
  for (size_t i = 0; i < set.size(); ++i) {
    const auto value = static_cast<double>(set.colours[i * 3]);
    sum += value / 200;
    square += value * value / 200;
  }
  EXPECT_NEAR(sum, 0.5, 0.05);
  EXPECT_LT(std::sqrt(square - sum * sum), 0.17);
}

TEST(SurfaceSampling, GivesMoreWeightToTexturedAndCurvedPlaces) {
  // Left half plain, right half a chequer of 16 periods.
  TriMesh mesh = rectangle(1, 1);
  addRectangleUvs(mesh);
  mesh.materials[0].colour = MaterialColour::kTexture;
  mesh.materials[0].texture = 0;
  Image image{64, 64, 1, {}, Transfer::kSrgb};
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      image.pixels.push_back(x >= 32 && (x / 2 + y / 2) % 2 == 0 ? 1.0f : 0.0f);
    }
  }
  mesh.textures.push_back(image);
  const PointSet set = sampled(mesh, 20000, 1.0);
  double plain = 0, chequered = 0;
  for (size_t i = 0; i < set.size(); ++i) {
    const float x = set.positions[i * 3];
    EXPECT_GE(set.weights[i], set.areas[i]);
    EXPECT_LE(set.weights[i], 5.0001f * set.areas[i]);
    if (x > 0.1f && x < 0.4f) plain += static_cast<double>(set.weights[i]);
    if (x > 0.6f && x < 0.9f) chequered += static_cast<double>(set.weights[i]);
  }
  EXPECT_NEAR(plain, 0.3, 0.003);     // detail 0: the weight is the area, ± one row of strata
  EXPECT_GT(chequered, 4.0 * plain);  // variance 1/4 in display space is a detail of 0.99

  // A fold of 90 degrees: weight next to the crease, none far from it.
  TriMesh fold = rectangle(1, 1);
  fold.positions = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1};
  fold.triangles = {0, 1, 2, 0, 2, 3, 0, 3, 5, 0, 5, 4};
  const PointSet folded = sampled(fold, 20000, 1.0);
  float near_crease = 0, far = 0;
  for (size_t i = 0; i < folded.size(); ++i) {
    const float distance = std::max(folded.positions[i * 3], folded.positions[i * 3 + 2]);
    const float gain = folded.weights[i] / folded.areas[i];
    if (distance < 0.01f) near_crease = std::max(near_crease, gain);
    if (distance > 0.1f) far = std::max(far, gain);
  }
  EXPECT_GT(near_crease, 3.0f);
  EXPECT_LT(far, 1.001f);
}

/// A square of 8 m, black but for stripes of 0.05 m in a strip of 1 m along one side.
TriMesh stripedSquare() {
  TriMesh mesh = rectangle(8, 8);
  addRectangleUvs(mesh);
  mesh.materials[0].colour = MaterialColour::kTexture;
  mesh.materials[0].texture = 0;
  Image image{160, 8, 1, {}, Transfer::kLinear};
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 160; ++x) image.pixels.push_back(x < 20 && x % 2 == 0 ? 1.0f : 0.0f);
  }
  mesh.textures.push_back(image);
  return mesh;
}

TEST(SurfaceSampling, PutsFurtherSamplesWhereThereIsDetail) {
  SurfaceSamplingOptions options;
  options.count = 20000;
  options.detail_count = 5000;
  const TriMesh mesh = stripedSquare();
  const PointSet even = sampled(mesh, options.count, 1);
  const PointSet set = sampleSurface(mesh, options);
  EXPECT_GT(set.size(), 24000u);
  EXPECT_LE(set.size(), 25000u);
  double area = 0, striped_area = 0;
  size_t striped = 0;
  for (size_t i = 0; i < set.size(); ++i) {
    const float x = set.positions[i * 3], y = set.positions[i * 3 + 1];
    ASSERT_TRUE(x >= 0 && x <= 8.00001f && y >= 0 && y <= 8.00001f);
    area += static_cast<double>(set.areas[i]);
    if (x > 0.9f) continue;
    ++striped;
    striped_area += static_cast<double>(set.areas[i]);
  }
  EXPECT_NEAR(area, 64.0, 1e-3);
  // A share of 0.9 / 8 of 20,000 samples, nearly three for each of them and most of all further
  // ones; each stands for less, so that together they stand for the same place as before.
  EXPECT_GT(striped, 2250u * 5 / 2);
  EXPECT_NEAR(striped_area, 0.9 * 8, 0.15);
  // The density asks for as much as without them.
  const auto weightOf = [](const PointSet& samples) {
    double sum = 0;
    for (size_t i = 0; i < samples.size(); ++i) {
      if (samples.positions[i * 3] < 0.9f) sum += static_cast<double>(samples.weights[i]);
    }
    return sum;
  };
  EXPECT_NEAR(weightOf(set) / weightOf(even), 1, 0.03);
  withThreads(1, [&] { EXPECT_EQ(sampleSurface(mesh, options).positions, set.positions); });
}

TEST(SurfaceSampling, SplitsNoSampleWithoutDetail) {
  SurfaceSamplingOptions options;
  options.count = 3000;
  options.detail_count = 3000;
  EXPECT_EQ(sampleSurface(rectangle(2, 2), options).size(), 3000u);
  options.detail_weight = 0;
  EXPECT_EQ(sampleSurface(stripedSquare(), options).size(), 3000u);
}

TEST(SurfaceSampling, DependsOnTheSeedAndNotOnTheThreads) {
  TriMesh mesh = rectangle(2, 1);
  PointSet one, two;
  withThreads(1, [&] { one = sampled(mesh, 30000, 1.0, 7); });
  withThreads(2, [&] { two = sampled(mesh, 30000, 1.0, 7); });
  EXPECT_EQ(one.positions, two.positions);
  EXPECT_EQ(one.weights, two.weights);
  EXPECT_NE(sampled(mesh, 30000, 1.0, 8).positions, one.positions);
}

/// A dark square that shines white along one of six directions, and a plain one beside it.
TriMesh shiningSquare() {
  TriMesh mesh = rectangle(1, 1);
  mesh.positions.insert(mesh.positions.end(), {2, 0, 0, 3, 0, 0, 3, 1, 0, 2, 1, 0});
  mesh.triangles.insert(mesh.triangles.end(), {4, 5, 6, 4, 6, 7});
  addRectangleUvs(mesh);
  mesh.corner_uvs.insert(mesh.corner_uvs.end(), 12, 0.0f);
  mesh.triangle_materials = {0, 0, 1, 1};
  mesh.materials.assign(2, Material());
  mesh.view_directions = {1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 1, 0.6f, 0, -0.8f};
  Image dark;
  dark.width = dark.height = 1;
  dark.channels = 3;
  dark.pixels = {0, 0, 0};
  Image bright = dark;
  bright.pixels = {0.6f, 0.6f, 0.6f};
  mesh.textures = {dark, bright};
  for (float& value : mesh.materials[0].base_colour) value = 0.1f;
  mesh.materials[0].base_colour[3] = 1;
  mesh.materials[0].view_textures = {0, 0, 0, 0, 0, 1};
  return mesh;
}

TEST(SurfaceSampling, ShowsWhatComesToItFromViewDirections) {
  SurfaceSamplingOptions options;
  options.count = 1000;
  options.detail_count = 1000;
  options.harmonic_degree = 2;
  const PointSet set = sampleSurface(shiningSquare(), options);
  ASSERT_EQ(set.harmonic_degree, 2);
  ASSERT_EQ(set.harmonics.size(), set.size() * 24);
  const auto shown = [&](size_t i, const Vec3d& d) {
    std::array<float, 27> whole;
    std::copy_n(&set.harmonics[i * 24], 24, whole.begin() + 3);
    for (size_t c = 0; c < 3; ++c) {
      whole[c] = (linearToSrgb(set.colours[i * 3 + c]) - 0.5f) / kShC0;
    }
    return shownAlong(whole.data(), 2, d, 0);
  };
  for (size_t i = 0; i < set.size(); ++i) {
    const bool is_plain = set.positions[i * 3] > 1.5f;
    // So few directions do not outweigh what holds coefficients small: it takes a quarter at most
    // of the step of 0.5 between the two.
    EXPECT_NEAR(shown(i, Vec3d(0, 0, -1)), linearToSrgb(is_plain ? 0.8 : 0.1), 0.125);
    EXPECT_NEAR(shown(i, Vec3d(0.6, 0, -0.8)), linearToSrgb(is_plain ? 0.8 : 0.7), 0.125);
    if (is_plain) {
      EXPECT_EQ(set.colours[i * 3], 0.8f);
    }
  }
  options.harmonic_degree = 0;
  const PointSet still = sampleSurface(shiningSquare(), options);
  EXPECT_TRUE(still.harmonics.empty());
  EXPECT_EQ(still.harmonicStride(), 0u);
  options.harmonic_degree = 4;
  EXPECT_THROW(sampleSurface(shiningSquare(), options), Error);
}

TEST(SurfaceSampling, RefusesViewTexturesThatDoNotFit) {
  const auto refusal = [](const TriMesh& mesh) -> std::string {
    try {
      sampled(mesh, 10);
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  };
  TriMesh mesh = shiningSquare();
  mesh.materials[0].view_textures.pop_back();
  EXPECT_THAT(refusal(mesh), HasSubstr("view textures of a material holds 5 values; 6 are needed"));
  mesh = shiningSquare();
  mesh.materials[0].view_textures[2] = 9;
  EXPECT_THAT(refusal(mesh), HasSubstr("view texture 9"));
  mesh = shiningSquare();
  mesh.view_directions[0] = 2;
  EXPECT_THAT(refusal(mesh), HasSubstr("view direction 0 has a length of 2"));
  mesh = shiningSquare();
  mesh.corner_uvs.clear();
  EXPECT_THAT(refusal(mesh), HasSubstr("view textures, but the mesh has no UV"));
}

TEST(SurfaceSampling, RefusesBadOptionsAndMeshes) {
  const auto refusal = [](const TriMesh& mesh, uint64_t count, double weight) -> std::string {
    try {
      sampled(mesh, count, weight);
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(refusal(rectangle(1, 1), 0, 0), HasSubstr("sample count is 0"));
  EXPECT_THAT(refusal(rectangle(1, 1), 10, -1), HasSubstr("detail weight is -1"));
  EXPECT_THAT(refusal(rectangle(1, 1), 10, std::nan("")), HasSubstr("detail weight is nan"));
  EXPECT_THAT(refusal(rectangle(0, 1), 10, 0), HasSubstr("all faces have zero area"));
  EXPECT_THAT(refusal(TriMesh{}, 10, 0), HasSubstr("0 triangles"));
}

TEST(SurfaceSampling, StopsWhenCancelled) {
  Progress progress;
  progress.cancel();
  SurfaceSamplingOptions options;
  EXPECT_THROW(sampleSurface(rectangle(1, 1), options, &progress), Error);
}

}  // namespace
}  // namespace stipple
