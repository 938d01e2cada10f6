#include <algorithm>
#include <cmath>
#include <cstring>

#include "api/guard.h"
#include "api/handles.h"
#include "api/job.h"
#include "io/mesh_writer.h"
#include "io/volume_surface.h"
#include "mesh/edge_pairs.h"
#include "mesh/surface_pieces.h"

using namespace stipple;
using namespace stipple::api;

namespace {

StippleVolumeToMeshOptions completeOptions(const StippleVolumeToMeshOptions* options) {
  StippleVolumeToMeshOptions defaults;
  stipple_volume_to_mesh_options_init(&defaults);
  return completed(options, defaults, "options");
}

/// Per metre: the density of a voxel of this opacity.
double thresholdOf(const StippleVolumeToMeshOptions& options, const SparseVolume& volume) {
  if (options.density != 0.0) return options.density;
  if (!(options.opacity > 0.0 && options.opacity < 1.0)) {
    fail(ErrorCode::kInvalidArgument,
         "opacity is " + std::to_string(options.opacity) + "; a number between 0 and 1 is allowed");
  }
  return -std::log1p(-options.opacity) / volume.voxel_size;
}

}  // namespace

extern "C" {

void stipple_volume_to_mesh_options_init(StippleVolumeToMeshOptions* options) {
  if (!options) return;
  *options = {};
  options->struct_size = sizeof(StippleVolumeToMeshOptions);
  options->largest_only = 0;
  options->opacity = 0.5;
  options->density = 0.0;
  options->adaptivity = 0.0;
}

StippleStatus stipple_volume_to_mesh_start(const StippleVolume* volume,
                                           const StippleVolumeToMeshOptions* options,
                                           StippleJob** job) {
  return guarded([&] {
    require(volume, "volume");
    require(job, "job");
    const auto voxels = volume->volume;
    const StippleVolumeToMeshOptions given = completeOptions(options);
    const double threshold = voxels->brickCount() == 0 ? 1.0 : thresholdOf(given, *voxels);
    volume->context->requireMemory(surfaceMemoryBound(*voxels, threshold), "the mesh of a volume");
    *job = startJob(volume->context, [voxels, given, threshold](Progress& progress) -> JobResult {
      advance(&progress, 0.0, "Finding the surface");
      PolygonSurface surface = surfaceOfVolume(*voxels, threshold, given.adaptivity);
      advance(&progress, 0.8, "Making triangles");
      auto mesh = std::make_shared<TriMesh>(triangulated(surface));
      surface = {};
      progress.throwIfCancelled();
      pairEdges(*mesh);
      if (given.largest_only != 0) keepLargestPiece(*mesh, &progress);
      return std::shared_ptr<const TriMesh>(std::move(mesh));
    });
  });
}

StippleStatus stipple_volume_to_mesh_memory_bound(const StippleVolume* volume,
                                                  const StippleVolumeToMeshOptions* options,
                                                  uint64_t* bytes) {
  return guarded([&] {
    const SparseVolume& voxels = *require(volume, "volume").volume;
    const StippleVolumeToMeshOptions given = completeOptions(options);
    const double threshold = voxels.brickCount() == 0 ? 1.0 : thresholdOf(given, voxels);
    require(bytes, "bytes") = surfaceMemoryBound(voxels, threshold);
  });
}

StippleStatus stipple_job_mesh(const StippleJob* job, StippleMesh** mesh) {
  return guarded([&] {
    const auto& made = jobResult<std::shared_ptr<const TriMesh>>(require(job, "job"), "mesh");
    // Meshes can be added to, so each handle has one of its own.
    require(mesh, "mesh") = new StippleMesh{job->context, std::make_shared<TriMesh>(*made)};
  });
}

StippleStatus stipple_mesh_read(const StippleMesh* mesh, const StippleMeshBuffers* buffers) {
  return guarded([&] {
    const TriMesh& from = *require(mesh, "mesh").mesh;
    const StippleMeshBuffers to = complete(buffers, "buffers");
    const auto need = [](uint64_t count, uint64_t capacity, const char* what) {
      if (capacity >= count) return;
      fail(ErrorCode::kBufferTooSmall, std::string("buffers->") + what + "_capacity is " +
                                           std::to_string(capacity) + "; " + std::to_string(count) +
                                           " are needed");
    };
    if (to.positions) need(from.vertexCount(), to.vertex_capacity, "vertex");
    if (to.triangles) need(from.triangleCount(), to.triangle_capacity, "triangle");
    if (to.positions) std::copy(from.positions.begin(), from.positions.end(), to.positions);
    if (to.triangles) std::copy(from.triangles.begin(), from.triangles.end(), to.triangles);
  });
}

StippleStatus stipple_mesh_topology(const StippleMesh* mesh, StippleMeshTopology* topology) {
  return guarded([&] {
    const MeshTopology made = topologyOf(*require(mesh, "mesh").mesh);
    StippleMeshTopology out = {};
    out.edge_count = made.edge_count;
    out.open_edge_count = made.open_edge_count;
    out.piece_count = made.piece_count;
    out.euler = made.euler;
    out.volume = made.volume;
    deliver(topology, out, "topology");
  });
}

StippleStatus stipple_mesh_save(const StippleMesh* mesh, const char* path_utf8) {
  return guarded(
      [&] { writeMeshFile(*require(mesh, "mesh").mesh, &require(path_utf8, "path_utf8")); });
}

}  // extern "C"
