// Meshes to splats. References: one nearest-neighbour query of nanoflann per anchor, over the same
// positions (what any decoder that looks at neighbours pays at least), and a copy of the mesh.
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstring>
#include <nanoflann.hpp>
#include <numbers>

#include "bench/comparison.h"
#include "decode/surface/surface_model.h"

namespace stipple::bench {

namespace {

/// A bumpy, textured torus of 500 x 500 quads: 500,000 triangles, one 1024² texture.
TriMesh texturedTorus() {
  constexpr uint32_t kSide = 500;
  constexpr uint32_t kTexture = 1024;
  using std::numbers::pi;
  TriMesh mesh;
  for (uint32_t j = 0; j < kSide; ++j) {
    for (uint32_t i = 0; i < kSide; ++i) {
      const double u = 2 * pi * i / kSide, v = 2 * pi * j / kSide;
      const double minor = 0.4 + 0.02 * std::sin(20 * u) * std::sin(15 * v);
      const double distance = 1 + minor * std::cos(v);
      mesh.positions.push_back(static_cast<float>(distance * std::cos(u)));
      mesh.positions.push_back(static_cast<float>(distance * std::sin(u)));
      mesh.positions.push_back(static_cast<float>(minor * std::sin(v)));
    }
  }
  const auto corner = [&](uint32_t i, uint32_t j) {
    mesh.triangles.push_back(j % kSide * kSide + i % kSide);
    mesh.corner_uvs.push_back(static_cast<float>(i) / kSide);
    mesh.corner_uvs.push_back(static_cast<float>(j) / kSide);
  };
  for (uint32_t j = 0; j < kSide; ++j) {
    for (uint32_t i = 0; i < kSide; ++i) {
      corner(i, j), corner(i + 1, j), corner(i + 1, j + 1);
      corner(i, j), corner(i + 1, j + 1), corner(i, j + 1);
    }
  }
  Image texture{kTexture, kTexture, 3, {}, Transfer::kSrgb};
  for (uint32_t y = 0; y < kTexture; ++y) {
    for (uint32_t x = 0; x < kTexture; ++x) {
      const float value = (x / 16 + y / 16) % 2 == 0 ? 0.8f : 0.2f;
      texture.pixels.insert(texture.pixels.end(), {value, 0.5f, 1 - value});
    }
  }
  mesh.textures.push_back(std::move(texture));
  mesh.materials.push_back(Material{MaterialColour::kTexture, {1, 1, 1, 1}, 0});
  return mesh;
}

const TriMesh& mesh() {
  static const TriMesh value = texturedTorus();
  return value;
}

const SurfaceModel& model() {
  static const SurfaceModel value = buildSurfaceModel(mesh(), {});
  return value;
}

AnchorSet anchorsOf(uint64_t count) {
  AnchorSamplingOptions options;
  options.count = count;
  return sampleAnchors(*model().density, options);
}

struct Points {
  const AnchorSet* anchors;
  size_t kdtree_get_point_count() const { return anchors->size(); }
  float kdtree_get_pt(size_t i, size_t axis) const { return anchors->positions[i * 3 + axis]; }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Points>,
                                                 Points, 3, uint32_t>;

/// No target: the ratio shows changes; the aim is absolute (a slider at 50,000).
/// Anchors sampled and decoded, against building a tree over them and asking it for every anchor's
/// nearest neighbour.
void decode(benchmark::State& state) {
  const auto count = static_cast<uint64_t>(state.range(0));
  const AnchorSet fixed = anchorsOf(count);
  compare(
      state, "nearest_neighbour",
      [&] {
        const AnchorSet anchors = anchorsOf(count);
        DecodeRequest request;
        request.anchors = &anchors;
        benchmark::DoNotOptimize(model().decoder->decode(request).positions.data());
      },
      [&] {
        const Points points{&fixed};
        const Tree tree(3, points, nanoflann::KDTreeSingleIndexAdaptorParams(16));
        for (size_t i = 0; i < fixed.size(); ++i) {
          uint32_t index[2];
          float distance[2];
          const size_t found = tree.knnSearch(&fixed.positions[i * 3], 2, index, distance);
          benchmark::DoNotOptimize(distance[found - 1]);
        }
      });
}

/// Mesh to model to 100,000 splats, against copying the mesh's arrays.
void build(benchmark::State& state) {
  compare(
      state, "copy",
      [&] {
        const SurfaceModel built = buildSurfaceModel(mesh(), {});
        AnchorSamplingOptions options;
        options.count = 100000;
        const AnchorSet anchors = sampleAnchors(*built.density, options);
        DecodeRequest request;
        request.anchors = &anchors;
        benchmark::DoNotOptimize(built.decoder->decode(request).positions.data());
      },
      [&] {
        const TriMesh copy = mesh();
        benchmark::DoNotOptimize(copy.positions.data());
      });
}

BENCHMARK(decode)
    ->Name("surface.decode.10k")
    ->Arg(10000)
    ->UseManualTime()
    ->Iterations(10)
    ->Unit(benchmark::kMillisecond);
BENCHMARK(decode)
    ->Name("surface.decode.50k")
    ->Arg(50000)
    ->UseManualTime()
    ->Iterations(10)
    ->Unit(benchmark::kMillisecond);
BENCHMARK(decode)
    ->Name("surface.decode.100k")
    ->Arg(100000)
    ->UseManualTime()
    ->Iterations(5)
    ->Unit(benchmark::kMillisecond);
BENCHMARK(decode)
    ->Name("surface.decode.1M")
    ->Arg(1000000)
    ->UseManualTime()
    ->Iterations(2)
    ->Unit(benchmark::kMillisecond);
BENCHMARK(build)
    ->Name("surface.build.500k_triangles")
    ->UseManualTime()
    ->Iterations(3)
    ->Unit(benchmark::kMillisecond);

}  // namespace

}  // namespace stipple::bench
