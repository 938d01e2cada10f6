#include "shot/mattes.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/parallel.h"

namespace stipple {
namespace {

/// Looks along z from 3 metres before the origin, at a mesh about it.
Camera camera(uint32_t width, uint32_t height) {
  Camera made;
  made.width = width;
  made.height = height;
  made.fx = made.fy = 0.8 * width;
  made.cx = 0.45 * width;
  made.cy = 0.6 * height;
  made.world_to_camera(2, 3) = 3;
  made.near_plane = 0.5;
  return made;
}

/// Two slanted triangles that overlap in part.
TriMesh triangles() {
  TriMesh mesh;
  mesh.positions = {-0.9f, -0.7f, 0.3f, 0.8f, -0.5f, -0.4f, 0.1f,  0.9f,  0.0f,
                    -0.6f, 0.5f,  0.9f, 0.7f, 0.6f,  -0.8f, -0.1f, -0.8f, 0.1f};
  mesh.triangles = {0, 1, 2, 3, 4, 5};
  return mesh;
}

struct Matte {
  std::vector<float> depth, opacity;
};

Matte matteOf(const TriMesh& mesh, const Camera& view, uint32_t side) {
  Matte made;
  made.depth.resize(size_t{view.width} * view.height);
  made.opacity.resize(made.depth.size());
  const MeshInstance placed{&mesh};
  drawMatte({&placed, 1}, view, side, made.depth, made.opacity);
  return made;
}

/// The samples of a larger picture, folded by hand.
Matte byHand(const TriMesh& mesh, const Camera& view, uint32_t side) {
  Camera finer = view;
  finer.width *= side;
  finer.height *= side;
  finer.fx *= side;
  finer.fy *= side;
  finer.cx *= side;
  finer.cy *= side;
  std::vector<float> samples(size_t{finer.width} * finer.height);
  const MeshInstance placed{&mesh};
  drawMeshDepth({&placed, 1}, finer, samples);
  Matte made;
  for (size_t y = 0; y < view.height; ++y) {
    for (size_t x = 0; x < view.width; ++x) {
      float nearest = kEmptyDepth, hits = 0;
      for (size_t k = 0; k < size_t{side} * side; ++k) {
        const float sample = samples[(y * side + k / side) * finer.width + x * side + k % side];
        nearest = std::min(nearest, sample);
        hits += sample < kEmptyDepth ? 1.0f : 0.0f;
      }
      made.depth.push_back(nearest);
      made.opacity.push_back(hits / static_cast<float>(side * side));
    }
  }
  return made;
}

TEST(Mattes, FoldTheSamplesOfALargerPicture) {
  const TriMesh mesh = triangles();
  for (const uint32_t side : {1u, 3u, 4u, 16u}) {
    const Matte drawn = matteOf(mesh, camera(40, 30), side),
                wanted = byHand(mesh, camera(40, 30), side);
    EXPECT_EQ(drawn.depth, wanted.depth) << side;
    EXPECT_EQ(drawn.opacity, wanted.opacity) << side;
  }
}

TEST(Mattes, AreOfOnePieceWhereTheyAreDrawnInStrips) {
  // More samples than are held at a time; the strips' rows are other multiples in double.
  const TriMesh mesh = triangles();
  const Camera view = camera(2000, 600);
  const Matte drawn = matteOf(mesh, view, 4), wanted = byHand(mesh, view, 4);
  size_t other = 0;
  for (size_t i = 0; i < drawn.depth.size(); ++i) {
    if (drawn.opacity[i] != wanted.opacity[i]) ++other;
    if (drawn.depth[i] < kEmptyDepth && wanted.depth[i] < kEmptyDepth) {
      ASSERT_NEAR(drawn.depth[i], wanted.depth[i], 1e-5f * wanted.depth[i]);
    }
  }
  // A sample that a rounding puts across an edge.
  EXPECT_LE(other, 2u);
}

TEST(Mattes, HaveTheSameBitsForAnyNumberOfThreads) {
  const TriMesh mesh = triangles();
  Matte one, two;
  withThreads(1, [&] { one = matteOf(mesh, camera(90, 70), 4); });
  withThreads(2, [&] { two = matteOf(mesh, camera(90, 70), 4); });
  EXPECT_EQ(one.depth, two.depth);
  EXPECT_EQ(one.opacity, two.opacity);
}

TEST(Mattes, RefuseWhatTheyCannotDraw) {
  EXPECT_THROW(validateMatte(camera(10, 10), 0), Error);
  EXPECT_THROW(validateMatte(camera(10, 10), 17), Error);
  EXPECT_THROW(validateMatte(camera(20000, 10), 4), Error);
  Camera panorama = camera(10, 10);
  panorama.model = CameraModel::kEquirectangular;
  EXPECT_THROW(validateMatte(panorama, 2), Error);
  const TriMesh mesh = triangles();
  const MeshInstance placed{&mesh};
  std::vector<float> depth(100), opacity(99);
  EXPECT_THROW(drawMatte({&placed, 1}, camera(10, 10), 2, depth, opacity), Error);
}

TEST(Mattes, WithoutMeshesHideNothing) {
  std::vector<float> depth(12), opacity(12, 1.0f);
  drawMatte({}, camera(4, 3), 4, depth, opacity);
  EXPECT_EQ(depth, std::vector<float>(12, kEmptyDepth));
  EXPECT_EQ(opacity, std::vector<float>(12, 0.0f));
}

}  // namespace
}  // namespace stipple
