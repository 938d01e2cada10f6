#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "api/camera.h"
#include "api/guard.h"
#include "api/handles.h"
#include "api/job.h"
#include "math/affine.h"
#include "mesh/mesh_depth.h"
#include "shot/mattes.h"

using namespace stipple;
using namespace stipple::api;

namespace {

/// The placed meshes of a call, with shares that keep them alive while the job runs.
struct PlacedMeshes {
  std::vector<std::shared_ptr<const TriMesh>> shares;
  std::vector<MeshInstance> list;
};

PlacedMeshes meshesFrom(const StippleMeshInstance* instances, uint64_t count) {
  PlacedMeshes made;
  if (count == 0) return made;
  require(instances, "instances");
  for (uint64_t i = 0; i < count; ++i) {
    const std::string name = "instances[" + std::to_string(i) + "]";
    const StippleMeshInstance given = complete(instances + i, name.c_str());
    const StippleMesh& mesh = require(given.mesh, (name + ".mesh").c_str());
    MeshInstance placed;
    placed.mesh = mesh.mesh.get();
    placed.object_to_world = Eigen::Map<const Mat4d>(given.matrix);
    validateAffine(placed.object_to_world, (name + ".matrix").c_str());
    made.shares.push_back(mesh.mesh);
    made.list.push_back(placed);
  }
  return made;
}

}  // namespace

extern "C" {

StippleStatus stipple_mesh_depth_start(StippleContext* context,
                                       const StippleMeshInstance* instances, uint64_t count,
                                       const StippleCamera* camera, float* depth,
                                       StippleJob** job) {
  return guarded([&] {
    require(context, "context");
    require(depth, "depth");
    require(job, "job");
    PlacedMeshes placed = meshesFrom(instances, count);
    const Camera view = cameraFrom(camera);
    validate(view);
    requireImagePlane(view, "the depth of meshes");
    context->state->requireMemory(meshDepthMemoryBound(placed.list), "the depth of meshes");
    *job = startJob(context->state, [placed = std::move(placed), view, depth](Progress& progress) {
      const size_t pixel_count = static_cast<size_t>(view.width) * view.height;
      drawMeshDepth(placed.list, view, {depth, pixel_count}, &progress);
      return JobResult{};
    });
  });
}

StippleStatus stipple_mesh_matte_start(StippleContext* context,
                                       const StippleMeshInstance* instances, uint64_t count,
                                       const StippleCamera* camera, uint32_t samples_per_side,
                                       float* depth, float* opacity, StippleJob** job) {
  return guarded([&] {
    require(context, "context");
    require(depth, "depth");
    require(opacity, "opacity");
    require(job, "job");
    PlacedMeshes placed = meshesFrom(instances, count);
    const Camera view = cameraFrom(camera);
    validateMatte(view, samples_per_side);
    context->state->requireMemory(matteMemoryBound(placed.list, view, samples_per_side),
                                  "a matte of meshes");
    *job = startJob(context->state, [placed = std::move(placed), view, samples_per_side, depth,
                                     opacity](Progress& progress) {
      const size_t pixel_count = static_cast<size_t>(view.width) * view.height;
      drawMatte(placed.list, view, samples_per_side, {depth, pixel_count}, {opacity, pixel_count},
                &progress);
      return JobResult{};
    });
  });
}

}  // extern "C"
