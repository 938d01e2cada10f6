// Splats of a mesh that are fitted to images of it.
#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "base/parallel.h"
#include "decode/surface/surface_model.h"
#include "mesh/mesh_image.h"
#include "splat/render/render.h"
#include "train/allocation_count.h"
#include "train/backend/backend_factory.h"
#include "train/loop/refine.h"
#include "train/loop/view_rig.h"

namespace stipple {
namespace {

/// A cube of 2 metres with a chequer of 4 x 4 squares on each side.
TriMesh chequeredCube() {
  TriMesh mesh;
  Image image;
  image.width = image.height = 64;
  image.channels = 3;
  image.transfer = Transfer::kLinear;
  for (uint32_t y = 0; y < 64; ++y) {
    for (uint32_t x = 0; x < 64; ++x) {
      const bool dark = (x / 16 + y / 16) % 2 == 0;
      image.pixels.insert(image.pixels.end(),
                          {dark ? 0.05f : 0.8f, dark ? 0.1f : 0.7f, dark ? 0.4f : 0.3f});
    }
  }
  mesh.textures.push_back(image);
  Material material;
  material.colour = MaterialColour::kTexture;
  material.texture = 0;
  mesh.materials.push_back(material);
  for (size_t axis = 0; axis < 3; ++axis) {
    for (const float side : {-1.0f, 1.0f}) {
      const auto first = static_cast<uint32_t>(mesh.vertexCount());
      const float corners[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
      for (const auto& corner : corners) {
        float p[3];
        p[axis] = side;
        p[(axis + 1) % 3] = side * corner[0];
        p[(axis + 2) % 3] = corner[1];
        mesh.positions.insert(mesh.positions.end(), p, p + 3);
      }
      for (const uint32_t corner : {0u, 1u, 2u, 0u, 2u, 3u}) {
        mesh.triangles.push_back(first + corner);
        mesh.corner_uvs.push_back(0.5f * (corners[corner][0] + 1));
        mesh.corner_uvs.push_back(0.5f * (corners[corner][1] + 1));
      }
    }
  }
  return mesh;
}

SplatCloud splatsOf(const TriMesh& mesh, uint64_t count) {
  SurfaceModelOptions options;
  options.sampling.count = 100000;
  const SurfaceModel model = buildSurfaceModel(mesh, options);
  AnchorSamplingOptions sampling;
  sampling.count = count;
  const AnchorSet anchors = sampleAnchors(*model.density, sampling);
  DecodeRequest request;
  request.anchors = &anchors;
  return model.decoder->decode(request);
}

/// Of images of the splats against images of the mesh, over black.
double psnr(const TriMesh& mesh, const SplatCloud& cloud, const std::vector<Camera>& views) {
  const SurfaceColour colour(mesh);
  const SplatInstance instance{&cloud};
  double sum = 0;
  size_t count = 0;
  for (const Camera& camera : views) {
    std::vector<float> truth(size_t{camera.width} * camera.height * 4);
    drawMeshImage(mesh, colour, camera, 4, truth);
    const RenderResult drawn = renderTiled({&instance, 1}, camera, RenderOptions{});
    for (size_t i = 0; i < truth.size(); ++i, ++count) {
      const auto error = static_cast<double>(truth[i] - drawn.colour[i]);
      sum += error * error;
    }
  }
  return -10 * std::log10(sum / static_cast<double>(count));
}

RefineOptions fewSteps() {
  RefineOptions options;
  options.iterations = 60;
  options.view_count = 16;
  options.view_size = 200;
  return options;
}

class RefineToMesh : public ::testing::Test {
 protected:
  std::shared_ptr<const BackendFactory> kept_ = cpuBackends();
  const BackendFactory& backends_ = *kept_;
  TriMesh mesh_ = chequeredCube();
  SplatCloud start_ = splatsOf(mesh_, 3000);

  std::vector<Camera> otherViews() const {
    ViewRigOptions rig;
    rig.rig = ViewRig::kAround;
    rig.count = 5;
    rig.size = 200;
    rig.seed = 77;
    return viewsOfCloud(backends_, start_, rig);
  }
};

TEST_F(RefineToMesh, ShowsTheMeshBetterFromOtherSides) {
  const SplatCloud refined = refineToMesh(backends_, start_, mesh_, fewSteps());
  ASSERT_EQ(refined.size(), start_.size());
  const double before = psnr(mesh_, start_, otherViews());
  const double after = psnr(mesh_, refined, otherViews());
  std::printf("%.2f dB, refined %.2f dB\n", before, after);
  EXPECT_GT(after, before + 3);
}

TEST_F(RefineToMesh, LooksAtRoomsFromInsideToo) {
  TriMesh room = mesh_;
  for (size_t t = 0; t < room.triangleCount(); ++t) {
    std::swap(room.triangles[t * 3], room.triangles[t * 3 + 1]);
    for (size_t k = 0; k < 2; ++k) {
      std::swap(room.corner_uvs[t * 6 + k], room.corner_uvs[t * 6 + 2 + k]);
    }
  }
  ViewRigOptions rig;
  rig.rig = ViewRig::kInside;
  rig.count = 4;
  rig.size = 200;
  rig.seed = 77;
  const std::vector<Camera> inside = viewsOfCloud(backends_, start_, rig);
  const double before = psnr(room, start_, inside);
  EXPECT_GT(psnr(room, refineToMesh(backends_, start_, room, fewSteps()), inside), before + 1);
}

TEST_F(RefineToMesh, IsTheSameForAnyNumberOfThreads) {
  RefineOptions options = fewSteps();
  options.iterations = 3;
  SplatCloud one;
  withThreads(1, [&] { one = refineToMesh(backends_, start_, mesh_, options); });
  const SplatCloud many = refineToMesh(backends_, start_, mesh_, options);
  EXPECT_EQ(one.positions, many.positions);
  EXPECT_EQ(one.sh, many.sh);
}

TEST_F(RefineToMesh, HoldsNoMoreThanItsBound) {
  RefineOptions options = fewSteps();
  options.iterations = 2;
  const uint64_t bound = refineToMeshMemoryBound(backends_, start_, mesh_, options);
  const uint64_t most =
      testing::mostBytesDuring([&] { refineToMesh(backends_, start_, mesh_, options); });
  EXPECT_LE(most, bound);
  // The targets alone, and the rays of one.
  EXPECT_GE(most, 16u * 200 * 200 * 12 + 600u * 600 * 8);
}

TEST_F(RefineToMesh, RefusesWhatItCannotFit) {
  SplatCloud linear = start_;
  linear.colour_space = ColourSpace::kLinear;
  EXPECT_THROW(refineToMesh(backends_, linear, mesh_, fewSteps()), Error);
  EXPECT_THROW(refineToMesh(backends_, SplatCloud{}, mesh_, fewSteps()), Error);
  EXPECT_THROW(refineToMesh(backends_, start_, TriMesh{}, fewSteps()), Error);
}

}  // namespace
}  // namespace stipple
