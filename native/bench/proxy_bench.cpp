// A volume's closed mesh. The reference is OpenVDB's surface alone, over the same voxels: what
// turning it into triangles, parting edges and keeping the largest piece adds.
#include <benchmark/benchmark.h>

#include <cmath>
#include <string>

#include "base/parallel.h"
#include "bench/comparison.h"
#include "io/volume_surface.h"
#include "mesh/edge_pairs.h"
#include "mesh/surface_pieces.h"

namespace stipple::bench {
namespace {

constexpr double kThreshold = 50.0;

/// A shell of radius 1 and two voxels' thickness, `resolution` voxels along its side.
SparseVolume shellVolume(int resolution) {
  SparseVolume volume;
  volume.voxel_size = 2.2 / resolution;
  const double width = 2.0 * volume.voxel_size;
  const int half = resolution / 2 / kBrickSide + 1;
  for (int x = -half; x < half; ++x) {
    for (int y = -half; y < half; ++y) {
      for (int z = -half; z < half; ++z) {
        float density[kBrickVoxelCount];
        bool any = false;
        for (int v = 0; v < kBrickVoxelCount; ++v) {
          const double px = volume.voxel_size * (x * kBrickSide + v / 64);
          const double py = volume.voxel_size * (y * kBrickSide + v / 8 % 8);
          const double pz = volume.voxel_size * (z * kBrickSide + v % 8);
          const double away = (std::sqrt(px * px + py * py + pz * pz) - 1.0) / width;
          density[v] = static_cast<float>(100.0 * std::exp(-away * away));
          any = any || density[v] > 1e-3f;
        }
        if (!any) continue;
        volume.bricks.push_back({x * kBrickSide, y * kBrickSide, z * kBrickSide});
        volume.density.insert(volume.density.end(), density, density + kBrickVoxelCount);
      }
    }
  }
  volume.colour.resize(volume.density.size() * 3);
  return volume;
}

void shell(benchmark::State& state, int resolution, unsigned threads) {
  const SparseVolume volume = shellVolume(resolution);
  TriMesh mesh;
  compare(
      state, "surface",
      [&] {
        withThreads(threads, [&] {
          mesh = triangulated(surfaceOfVolume(volume, kThreshold, 0.0));
          pairEdges(mesh);
          keepLargestPiece(mesh);
        });
      },
      [&] {
        withThreads(threads, [&] {
          benchmark::DoNotOptimize(surfaceOfVolume(volume, kThreshold, 0.0).faces.data());
        });
      });
  state.counters["bricks"] = static_cast<double>(volume.brickCount());
  state.counters["triangles"] = static_cast<double>(mesh.triangleCount());
}

const bool registered = [] {
  for (const int resolution : {128, 256}) {
    for (const unsigned threads : {1u, 2u}) {
      const std::string name =
          "proxy.shell." + std::to_string(resolution) + (threads == 1 ? "" : ".2threads");
      benchmark::RegisterBenchmark(name.c_str(), shell, resolution, threads)
          ->UseManualTime()
          ->Iterations(3)
          ->Unit(benchmark::kMillisecond);
    }
  }
  return true;
}();

}  // namespace
}  // namespace stipple::bench
