#include <utility>

#include "api/conversions.h"
#include "api/job.h"
#include "base/parallel.h"
#include "data/clouds/cloud_selection.h"
#include "mesh/floaters.h"
#include "mesh/winding_number.h"
#include "splat/edit/cloud_merge.h"
#include "splat/edit/ground_plane.h"

using namespace stipple;
using namespace stipple::api;

namespace {

Mat4d matrixFrom(const double* values, const char* name) {
  return Eigen::Map<const Mat4d>(&require(values, name));
}

Vec3d vectorFrom(const double* values) {
  return Eigen::Map<const Vec3d>(values);
}

void deliverMatrix(const Mat4d& made, double* matrix) {
  Eigen::Map<Mat4d>(&require(matrix, "matrix")) = made;
}

/// Refuses masks that do not fit the cloud.
void requireMask(const uint8_t* mask, uint64_t mask_count, const SplatCloud& cloud) {
  require(mask, "mask");
  if (mask_count != cloud.size()) {
    fail(ErrorCode::kInvalidArgument, "mask_count is " + std::to_string(mask_count) +
                                          "; the cloud has " + std::to_string(cloud.size()) +
                                          " splats, one value each is needed");
  }
}

/// A selection of what is inside becomes the mask of what to keep.
void deliverMask(std::vector<uint8_t> inside, StippleSide side, uint8_t* mask,
                 uint64_t* kept_count) {
  if (side == STIPPLE_SIDE_OUTSIDE) invertMask(inside);
  if (!inside.empty()) std::memcpy(mask, inside.data(), inside.size());
  if (kept_count) *kept_count = selectedCount(inside);
}

FloaterOptions floaterOptions(const StippleFloaterOptions* options) {
  StippleFloaterOptions defaults;
  stipple_floater_options_init(&defaults);
  const StippleFloaterOptions given = completed(options, defaults, "options");
  FloaterOptions settings;
  settings.by_opacity = enumValue<uint32_t>(given.by_opacity, 1, "options->by_opacity") == 1;
  settings.by_size = enumValue<uint32_t>(given.by_size, 1, "options->by_size") == 1;
  settings.by_connectivity =
      enumValue<uint32_t>(given.by_connectivity, 1, "options->by_connectivity") == 1;
  settings.min_opacity = given.min_opacity;
  if (given.max_size != 0) settings.max_size = given.max_size;
  if (given.radius != 0) settings.radius = given.radius;
  if (given.min_group_count != 0) settings.min_group_count = given.min_group_count;
  return settings;
}

GroundPlaneOptions groundPlaneOptions(const StippleGroundPlaneOptions* options) {
  StippleGroundPlaneOptions defaults;
  stipple_ground_plane_options_init(&defaults);
  const StippleGroundPlaneOptions given = completed(options, defaults, "options");
  GroundPlaneOptions settings;
  settings.up = vectorFrom(given.up);
  settings.max_tilt = given.max_tilt;
  if (given.tolerance != 0) settings.tolerance = given.tolerance;
  settings.seed = given.seed;
  return settings;
}

StippleFloaterReport reportFrom(const FloaterReport& found) {
  StippleFloaterReport out = {};
  out.faint = found.faint;
  out.large = found.large;
  out.isolated = found.isolated;
  out.kept = found.kept;
  out.group_count = found.group_count;
  out.max_size = found.max_size;
  out.radius = found.radius;
  out.min_group_count = found.min_group_count;
  return out;
}

}  // namespace

extern "C" {

StippleStatus stipple_cloud_select_box(const StippleCloud* cloud, const double cloud_to_box[16],
                                       uint32_t side, uint8_t* mask, uint64_t mask_count,
                                       uint64_t* kept_count) {
  return guarded([&] {
    const SplatCloud& splats = *require(cloud, "cloud").cloud;
    const StippleSide kept_side = enumValue<StippleSide>(side, STIPPLE_SIDE_OUTSIDE, "side");
    const Mat4d matrix = matrixFrom(cloud_to_box, "cloud_to_box");
    requireMask(mask, mask_count, splats);
    withThreads(cloud->context->thread_count,
                [&] { deliverMask(insideBox(splats, matrix), kept_side, mask, kept_count); });
  });
}

StippleStatus stipple_cloud_select_mesh_start(const StippleCloud* cloud,
                                              const double cloud_to_mesh[16],
                                              const StippleMesh* mesh, uint32_t side, uint8_t* mask,
                                              uint64_t mask_count, uint64_t* kept_count,
                                              StippleJob** job) {
  return guarded([&] {
    const auto splats = require(cloud, "cloud").cloud;
    const std::shared_ptr<const TriMesh> triangles = require(mesh, "mesh").mesh;
    const StippleSide kept_side = enumValue<StippleSide>(side, STIPPLE_SIDE_OUTSIDE, "side");
    const Mat4d matrix = matrixFrom(cloud_to_mesh, "cloud_to_mesh");
    requireMask(mask, mask_count, *splats);
    require(job, "job") = startJob(cloud->context, [=](Progress& progress) -> JobResult {
      std::vector<uint8_t> inside = insideMesh(*triangles, splats->positions, matrix, &progress);
      progress.throwIfCancelled();
      deliverMask(std::move(inside), kept_side, mask, kept_count);
      return {};
    });
  });
}

void stipple_floater_options_init(StippleFloaterOptions* options) {
  if (!options) return;
  const FloaterOptions defaults;
  *options = {};
  options->struct_size = sizeof(StippleFloaterOptions);
  options->by_opacity = defaults.by_opacity ? 1 : 0;
  options->by_size = defaults.by_size ? 1 : 0;
  options->by_connectivity = defaults.by_connectivity ? 1 : 0;
  options->min_opacity = defaults.min_opacity;
}

StippleStatus stipple_cloud_select_floaters_start(const StippleCloud* cloud,
                                                  const StippleFloaterOptions* options,
                                                  uint8_t* mask, uint64_t mask_count,
                                                  StippleFloaterReport* report, StippleJob** job) {
  return guarded([&] {
    const auto splats = require(cloud, "cloud").cloud;
    const FloaterOptions settings = floaterOptions(options);
    requireMask(mask, mask_count, *splats);
    require(job, "job") = startJob(cloud->context, [=](Progress& progress) -> JobResult {
      FloaterReport found;
      const std::vector<uint8_t> kept_mask = withoutFloaters(*splats, settings, found, &progress);
      progress.throwIfCancelled();
      if (report) deliver(report, reportFrom(found), "report");
      deliverMask(kept_mask, STIPPLE_SIDE_INSIDE, mask, nullptr);
      return {};
    });
  });
}

StippleStatus stipple_cloud_keep(const StippleCloud* cloud, const uint8_t* mask,
                                 uint64_t mask_count, StippleCloud** kept_cloud) {
  return guarded([&] {
    const SplatCloud& splats = *require(cloud, "cloud").cloud;
    requireMask(mask, mask_count, splats);
    require(kept_cloud, "kept");
    withThreads(cloud->context->thread_count, [&] {
      *kept_cloud = new StippleCloud{
          cloud->context, std::make_shared<const SplatCloud>(kept(splats, {mask, splats.size()}))};
    });
  });
}

StippleStatus stipple_cloud_thin(const StippleCloud* cloud, uint64_t count, uint64_t seed,
                                 StippleCloud** thinned_cloud) {
  return guarded([&] {
    const SplatCloud& splats = *require(cloud, "cloud").cloud;
    require(thinned_cloud, "thinned");
    withThreads(cloud->context->thread_count, [&] {
      *thinned_cloud = new StippleCloud{
          cloud->context, std::make_shared<const SplatCloud>(thinned(splats, count, seed))};
    });
  });
}

StippleStatus stipple_cloud_merge(const StippleInstance* instances, uint64_t count, uint32_t frame,
                                  StippleCloud** merged_cloud) {
  return guarded([&] {
    if (count < 1) fail(ErrorCode::kInvalidArgument, "count is 0; at least 1 cloud is needed");
    const Frame label = enumValue<Frame>(frame, kLastFrame, "frame");
    const Instances placed = instancesFrom(instances, count);
    require(merged_cloud, "merged");
    const Context& context = instances[0].cloud->context;
    context->requireMemory(mergeMemoryBound(placed.list), "the merged cloud");
    withThreads(context->thread_count, [&] {
      *merged_cloud =
          new StippleCloud{context, std::make_shared<const SplatCloud>(merged(placed.list, label))};
    });
  });
}

void stipple_ground_plane_options_init(StippleGroundPlaneOptions* options) {
  if (!options) return;
  const GroundPlaneOptions defaults;
  *options = {};
  options->struct_size = sizeof(StippleGroundPlaneOptions);
  Eigen::Map<Vec3d>(options->up) = defaults.up;
  options->max_tilt = defaults.max_tilt;
  options->seed = defaults.seed;
}

StippleStatus stipple_cloud_ground_plane(const StippleCloud* cloud, const double cloud_to_world[16],
                                         const StippleGroundPlaneOptions* options,
                                         StippleGroundPlane* plane) {
  return guarded([&] {
    const SplatCloud& splats = *require(cloud, "cloud").cloud;
    const Mat4d matrix = matrixFrom(cloud_to_world, "cloud_to_world");
    const GroundPlaneOptions settings = groundPlaneOptions(options);
    GroundPlane found;
    withThreads(cloud->context->thread_count,
                [&] { found = groundPlane(splats, matrix, settings); });
    StippleGroundPlane out = {};
    Eigen::Map<Vec3d>(out.normal) = found.plane.normal;
    out.offset = found.plane.offset;
    Eigen::Map<Mat4d>(out.matrix) = levelling(found.plane);
    out.considered_count = found.considered_count;
    out.inlier_count = found.inlier_count;
    out.tolerance = found.tolerance;
    Eigen::Map<Vec3d>(out.extent_min) = found.extent_min;
    Eigen::Map<Vec3d>(out.extent_max) = found.extent_max;
    deliver(plane, out, "plane");
  });
}

StippleStatus stipple_level_points(const double points[9], const double up[3], double matrix[16]) {
  return guarded([&] {
    require(points, "points");
    require(up, "up");
    deliverMatrix(levelling(planeThrough(vectorFrom(points), vectorFrom(points + 3),
                                         vectorFrom(points + 6), vectorFrom(up))),
                  matrix);
  });
}

StippleStatus stipple_scale_points(const double points[6], double length, double matrix[16]) {
  return guarded([&] {
    require(points, "points");
    deliverMatrix(scalingTo(vectorFrom(points), vectorFrom(points + 3), length), matrix);
  });
}

}  // extern "C"
