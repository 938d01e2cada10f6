#include "mesh/mesh_image.h"

#include <gtest/gtest.h>

#include <cmath>
#include <thread>

#include "base/error.h"
#include "base/parallel.h"
#include "math/colour.h"

namespace stipple {
namespace {

constexpr uint32_t kSide = 12;

/// One pixel is one metre, looking down; row 0 is at y = +6, column 0 at x = −6, as images are.
Camera fromAbove() {
  Camera camera;
  camera.model = CameraModel::kOrthographic;
  camera.width = camera.height = kSide;
  camera.fx = camera.fy = 1;
  camera.cx = camera.cy = kSide / 2.0;
  camera.world_to_camera = Mat4d::Identity();
  camera.world_to_camera(1, 1) = -1;
  camera.world_to_camera(2, 2) = -1;
  camera.world_to_camera(2, 3) = 10;
  return camera;
}

/// Adds x0..x1 times y0..y1 at height z with a material.
void addQuad(TriMesh& mesh, float x0, float x1, float y0, float y1, float z,
             const Material& material) {
  const auto first = static_cast<uint32_t>(mesh.vertexCount());
  for (const float x : {x0, x1}) {
    for (const float y : {y0, y1}) mesh.positions.insert(mesh.positions.end(), {x, y, z});
  }
  mesh.triangles.insert(mesh.triangles.end(),
                        {first, first + 2, first + 3, first, first + 3, first + 1});
  mesh.triangle_materials.insert(mesh.triangle_materials.end(), 2,
                                 static_cast<uint32_t>(mesh.materials.size()));
  mesh.materials.push_back(material);
}

Material plain(float r, float g, float b, float alpha = 1) {
  Material material;
  const float colour[4] = {r, g, b, alpha};
  std::copy_n(colour, 4, material.base_colour);
  return material;
}

std::vector<float> drawn(const TriMesh& mesh, uint32_t samples) {
  std::vector<float> rgba(kSide * kSide * 4);
  const SurfaceColour colour(mesh);
  drawMeshImage(mesh, colour, fromAbove(), samples, rgba);
  return rgba;
}

const float* pixel(const std::vector<float>& rgba, uint32_t column, uint32_t row) {
  return &rgba[(row * kSide + column) * 4];
}

TEST(MeshImage, CoversWhatTheRaysOfAPixelMeet) {
  TriMesh mesh;
  // Right and lower sides lie a quarter and a half into pixels 9 and 8.
  addQuad(mesh, -4, 3.25f, -2.5f, 4, 0, plain(0.25f, 0.5f, 1));
  const std::vector<float> rgba = drawn(mesh, 4);
  EXPECT_FLOAT_EQ(pixel(rgba, 5, 5)[3], 1);
  EXPECT_FLOAT_EQ(pixel(rgba, 9, 5)[3], 0.25f);
  EXPECT_FLOAT_EQ(pixel(rgba, 5, 8)[3], 0.5f);
  EXPECT_FLOAT_EQ(pixel(rgba, 9, 8)[3], 0.125f);
  EXPECT_FLOAT_EQ(pixel(rgba, 10, 5)[3], 0);
  EXPECT_FLOAT_EQ(pixel(rgba, 1, 5)[3], 0);
  // Associated display values.
  EXPECT_NEAR(pixel(rgba, 9, 5)[0], 0.25f * linearToSrgb(0.25f), 1e-6f);
  EXPECT_NEAR(pixel(rgba, 5, 5)[1], linearToSrgb(0.5f), 1e-6f);
}

TEST(MeshImage, ShowsTheNearestAndMixesInSceneLinear) {
  TriMesh mesh;
  addQuad(mesh, -5, 5, -5, 5, 0, plain(1, 1, 1));
  addQuad(mesh, -5, 0.5f, -5, 5, 2, plain(0, 0, 0));
  const std::vector<float> rgba = drawn(mesh, 4);
  EXPECT_FLOAT_EQ(pixel(rgba, 3, 5)[0], 0);
  EXPECT_FLOAT_EQ(pixel(rgba, 8, 5)[0], 1);
  EXPECT_NEAR(pixel(rgba, 6, 5)[0], linearToSrgb(0.5f), 1e-6f);
  EXPECT_FLOAT_EQ(pixel(rgba, 6, 5)[3], 1);
}

TEST(MeshImage, LooksTexturesUpAtTheirPlace) {
  TriMesh mesh;
  Material material;
  material.colour = MaterialColour::kTexture;
  material.texture = 0;
  addQuad(mesh, -4, 4, -4, 4, 0, material);
  Image image;
  image.width = image.height = 8;
  image.channels = 3;
  image.transfer = Transfer::kLinear;
  for (uint32_t i = 0; i < 64; ++i) {
    image.pixels.insert(image.pixels.end(), {static_cast<float>(i) / 64, 0.5f, 0});
  }
  mesh.textures.push_back(image);
  for (const uint32_t corner : mesh.triangles) {
    mesh.corner_uvs.push_back((mesh.positions[corner * 3] + 4) / 8);
    mesh.corner_uvs.push_back((mesh.positions[corner * 3 + 1] + 4) / 8);
  }
  // A ray through the middle of each pixel meets the middle of a texel.
  const std::vector<float> rgba = drawn(mesh, 1);
  for (uint32_t row = 0; row < 8; ++row) {
    for (uint32_t column = 0; column < 8; ++column) {
      const float texel = image.pixels[(row * 8 + column) * 3];
      EXPECT_NEAR(pixel(rgba, column + 2, row + 2)[0], linearToSrgb(texel), 1e-5f);
    }
  }
}

TEST(MeshImage, ShowsWhatComesAlongTheCamera) {
  TriMesh mesh;
  Material shining = plain(0.1f, 0.1f, 0.1f);
  shining.view_textures = {0, 1, 1, 1, 1, 1};
  addQuad(mesh, -6, 6, -6, 6, 0, shining);
  mesh.corner_uvs.assign(12, 0.5f);
  // Down is what the camera looks along; the others are at right angles to it or come from behind.
  mesh.view_directions = {0, 0, -1, 1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 1};
  Image added;
  added.width = added.height = 1;
  added.channels = 3;
  added.pixels = {0.3f, 0, -0.4f};
  mesh.textures = {added, added};
  mesh.textures[1].pixels = {100, 100, 100};
  const std::vector<float> rgba = drawn(mesh, 1);
  // exp(-6) of the nearest direction's weight is below what counts; less than nothing is black.
  EXPECT_NEAR(pixel(rgba, 5, 5)[0], linearToSrgb(0.4), 1e-6);
  EXPECT_NEAR(pixel(rgba, 5, 5)[1], linearToSrgb(0.1), 1e-6);
  EXPECT_EQ(pixel(rgba, 5, 5)[2], 0.0f);
}

TEST(MeshImage, LetsAShareOfTheRaysThrough) {
  TriMesh mesh;
  addQuad(mesh, -6, 6, -6, 6, 0, plain(1, 1, 1));
  addQuad(mesh, -6, 6, -6, 6, 1, plain(0, 0, 0, 0.7f));
  addQuad(mesh, -6, 6, -6, 6, 2, plain(0, 0, 0, 0));
  const std::vector<float> rgba = drawn(mesh, 8);
  double light = 0;
  for (size_t i = 0; i < kSide * kSide; ++i) {
    EXPECT_FLOAT_EQ(rgba[i * 4 + 3], 1);
    light += srgbToLinear(static_cast<double>(rgba[i * 4])) / (kSide * kSide);
  }
  // 9,216 rays: four standard deviations of their mean.
  EXPECT_NEAR(light, 0.3, 4 * std::sqrt(0.3 * 0.7 / 9216));
}

TEST(MeshImage, IsTheSameForAnyNumberOfThreads) {
  TriMesh mesh;
  for (int i = 0; i < 40; ++i) {
    const auto at = static_cast<float>(i % 7 - 4);
    addQuad(mesh, at, at + 2.3f, at - 1, at + 3.1f, static_cast<float>(i % 3),
            plain(static_cast<float>(i) / 40, 0.5f, 0.2f, i % 2 ? 0.5f : 1.0f));
  }
  std::vector<float> one;
  withThreads(1, [&] { one = drawn(mesh, 3); });
  EXPECT_EQ(one, drawn(mesh, 3));
}

TEST(MeshImage, RefusesWhatItCannotDraw) {
  TriMesh mesh;
  addQuad(mesh, -1, 1, -1, 1, 0, plain(1, 1, 1));
  const SurfaceColour colour(mesh);
  std::vector<float> rgba(kSide * kSide * 4);
  EXPECT_THROW(drawMeshImage(mesh, colour, fromAbove(), 0, rgba), Error);
  EXPECT_THROW(drawMeshImage(mesh, colour, fromAbove(), 17, rgba), Error);
  rgba.pop_back();
  EXPECT_THROW(drawMeshImage(mesh, colour, fromAbove(), 3, rgba), Error);
}

}  // namespace
}  // namespace stipple
