#include <cmath>
#include <string>

#include "api/guard.h"
#include "api/job.h"
#include "model/hierarchy_from_cloud.h"
#include "train/loop/refine.h"

using namespace stipple;
using namespace stipple::api;

namespace {

void requireRange(uint32_t value, uint32_t first, uint32_t last, const char* name) {
  if (value < first || value > last) {
    fail(ErrorCode::kInvalidArgument, std::string(name) + " is " + std::to_string(value) + "; " +
                                          std::to_string(first) + " to " + std::to_string(last) +
                                          " is allowed");
  }
}

HierarchyOptions hierarchyOptions(const StippleModelFromCloudOptions& given) {
  HierarchyOptions settings;
  settings.rig.rig = enumValue<ViewRig>(given.view_rig, 2, "options->view_rig");
  requireRange(given.view_count, 0, 4096, "options->view_count");
  requireRange(given.view_size, 1, 65536, "options->view_size");
  settings.view_count = given.view_count;
  settings.rig.count = given.view_count;
  settings.rig.size = given.view_size;
  settings.rig.seed = given.seed;
  if (!std::isfinite(given.footprint) || given.footprint < 0) {
    fail(ErrorCode::kInvalidArgument, "options->footprint is " + std::to_string(given.footprint) +
                                          " m; 0 (automatic) or more is allowed");
  }
  settings.tree.footprint = given.footprint;
  return settings;
}

RefineOptions refineSettings(const StippleRefineOptions& given) {
  RefineOptions settings;
  requireRange(given.iterations, 0, 1000000, "options->iterations");
  requireRange(given.view_count, 1, 4096, "options->view_count");
  requireRange(given.view_size, 1, 65536, "options->view_size");
  settings.iterations = given.iterations;
  settings.view_count = given.view_count;
  settings.view_size = given.view_size;
  settings.rig = enumValue<ViewRig>(given.view_rig, 2, "options->view_rig");
  settings.seed = given.seed;
  if (!std::isfinite(given.seconds) || given.seconds < 0) {
    fail(ErrorCode::kInvalidArgument, "options->seconds is " + std::to_string(given.seconds) +
                                          "; 0 (no limit) or more is allowed");
  }
  settings.seconds = given.seconds;
  return settings;
}

}  // namespace

extern "C" {

void stipple_model_from_cloud_options_init(StippleModelFromCloudOptions* options) {
  if (!options) return;
  *options = {};
  options->struct_size = sizeof(StippleModelFromCloudOptions);
  options->view_rig = STIPPLE_RIG_AUTOMATIC;
  options->view_count = 10;
  options->view_size = 400;
}

StippleStatus stipple_model_from_cloud_start(StippleContext* context, const StippleCloud* cloud,
                                             const StippleModelFromCloudOptions* options,
                                             StippleJob** job) {
  return guarded([&] {
    require(context, "context");
    require(cloud, "cloud");
    require(job, "job");
    StippleModelFromCloudOptions defaults;
    stipple_model_from_cloud_options_init(&defaults);
    const HierarchyOptions settings = hierarchyOptions(completed(options, defaults, "options"));
    const std::shared_ptr<const SplatCloud> leaves = cloud->cloud;
    if (leaves->size() == 0) {
      fail(ErrorCode::kInvalidArgument, "the cloud has 0 splats; a hierarchy needs at least 1");
    }
    const auto backends = context->state->backends;
    context->state->requireMemory(hierarchyMemoryBound(*backends, *leaves, settings),
                                  "the hierarchy of this cloud");
    *job = startJob(context->state, [leaves, settings, backends](Progress& progress) -> JobResult {
      return hierarchyFromCloud(*backends, leaves, settings, &progress);
    });
  });
}

void stipple_refine_options_init(StippleRefineOptions* options) {
  if (!options) return;
  const RefineOptions defaults;
  *options = {};
  options->struct_size = sizeof(StippleRefineOptions);
  options->iterations = defaults.iterations;
  options->view_count = defaults.view_count;
  options->view_size = defaults.view_size;
  options->view_rig = STIPPLE_RIG_AUTOMATIC;
}

StippleStatus stipple_cloud_refine_start(const StippleCloud* cloud, const StippleCloud* full,
                                         const StippleRefineOptions* options, StippleJob** job) {
  return guarded([&] {
    require(cloud, "cloud");
    require(full, "full");
    require(job, "job");
    StippleRefineOptions defaults;
    stipple_refine_options_init(&defaults);
    const RefineOptions settings = refineSettings(completed(options, defaults, "options"));
    const std::shared_ptr<const SplatCloud> start = cloud->cloud;
    const std::shared_ptr<const SplatCloud> whole = full->cloud;
    const auto backends = cloud->context->backends;
    cloud->context->requireMemory(refineMemoryBound(*backends, *start, *whole, settings),
                                  "refining this cloud");
    *job = startJob(cloud->context,
                    [start, whole, settings, backends](Progress& progress) -> JobResult {
                      return std::make_shared<const SplatCloud>(
                          refineCloud(*backends, *start, *whole, settings, &progress));
                    });
  });
}

StippleStatus stipple_cloud_refine_to_mesh_start(const StippleCloud* cloud, const StippleMesh* mesh,
                                                 const StippleRefineOptions* options,
                                                 StippleJob** job) {
  return guarded([&] {
    require(cloud, "cloud");
    require(mesh, "mesh");
    require(job, "job");
    StippleRefineOptions defaults;
    stipple_refine_options_init(&defaults);
    const RefineOptions settings = refineSettings(completed(options, defaults, "options"));
    const std::shared_ptr<const SplatCloud> start = cloud->cloud;
    const std::shared_ptr<const TriMesh> triangles = mesh->mesh;
    const auto backends = cloud->context->backends;
    cloud->context->requireMemory(refineToMeshMemoryBound(*backends, *start, *triangles, settings),
                                  "refining this cloud");
    *job = startJob(cloud->context,
                    [start, triangles, settings, backends](Progress& progress) -> JobResult {
                      return std::make_shared<const SplatCloud>(
                          refineToMesh(*backends, *start, *triangles, settings, &progress));
                    });
  });
}

}  // extern "C"
