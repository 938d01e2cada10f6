#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "decode/surface/surface_model.h"
#include "decode/test_meshes.h"

namespace stipple {
namespace {

constexpr uint64_t kAnchors = 4000;

SplatCloud splatsOf(const TriMesh& mesh) {
  SurfaceModelOptions options;
  options.sampling.count = 50000;
  options.sampling.detail_count = 50000;
  const SurfaceModel model = buildSurfaceModel(mesh, options);
  DecodeRequest request;
  const AnchorSet anchors = sampleAnchors(*model.density, {.count = kAnchors});
  request.anchors = &anchors;
  return model.decoder->decode(request);
}

/// How many splats of `a` have none of `b` within a hundredth of their spacing.
size_t movedCount(const SplatCloud& a, const SplatCloud& b, double area) {
  const double limit = 1e-4 * area / static_cast<double>(a.size());
  size_t moved = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    double nearest = std::numeric_limits<double>::infinity();
    for (size_t j = 0; j < b.size() && nearest > limit; ++j) {
      double squared = 0;
      for (size_t axis = 0; axis < 3; ++axis) {
        const double d = static_cast<double>(a.positions[i * 3 + axis]) -
                         static_cast<double>(b.positions[j * 3 + axis]);
        squared += d * d;
      }
      nearest = std::min(nearest, squared);
    }
    moved += nearest > limit ? 1 : 0;
  }
  return moved;
}

/// Every number a few units in the last place off, as another compiler or Blender has it.
void disturb(std::vector<float>& values) {
  std::mt19937 random(3);
  for (float& value : values) {
    value *= 1.0f + 1e-7f * (static_cast<float>(random() % 5) - 2.0f);
  }
}

// What rounding changes in a mesh changes a few splats, those that a border of a cell or of a
// triangle decides about, never all: else an object that moves flickers everywhere, and two
// versions of Blender make different splats of one file.
TEST(SurfaceStability, RoundingOfTheMeshMovesFewSplats) {
  TriMesh mesh = test::torus(1, 0.3, 96, 32);
  test::smoothNormals(mesh);
  const double area = 4 * 9.8696 * 0.3;
  const SplatCloud splats = splatsOf(mesh);
  TriMesh turned = mesh;
  disturb(turned.corner_normals);
  EXPECT_LE(movedCount(splats, splatsOf(turned), area), kAnchors / 100);
  TriMesh moved = mesh;
  disturb(moved.positions);
  EXPECT_LE(movedCount(splats, splatsOf(moved), area), kAnchors / 50);
}

}  // namespace
}  // namespace stipple
