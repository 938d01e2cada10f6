#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "api/conversions.h"
#include "api/guard.h"
#include "api/handles.h"
#include "api/job.h"
#include "fit/registration/register_to.h"
#include "io/views/ply_points.h"

using namespace stipple;
using namespace stipple::api;

namespace {

RegistrationOptions optionsFrom(const StippleMeshAdaptOptions* options) {
  StippleMeshAdaptOptions defaults;
  stipple_mesh_adapt_options_init(&defaults);
  const StippleMeshAdaptOptions given = completed(options, defaults, "options");
  RegistrationOptions made;
  made.adapter.density =
      enumValue<MeshDensity>(given.density, STIPPLE_MESH_DENSITY_ADAPTIVE, "options->density");
  made.alignment =
      enumValue<PreAlignment>(given.alignment, STIPPLE_MESH_ALIGN_SIMILARITY, "options->alignment");
  made.adapter.steps = given.steps;
  made.adapter.strength = given.strength;
  made.adapter.adaptive_factor = given.adaptive_factor;
  made.adapter.smoothness = given.smoothness;
  made.adapter.step_size = given.step_size;
  made.weights = {given.position_weight, given.normal_weight, given.landmark_weight,
                  given.symmetric_weight};
  made.target_count = given.target_count;
  made.samples_per_point = given.samples_per_point;
  made.report_count = given.report_count;
  made.lands_on_target =
      enumValue<uint32_t>(given.lands_on_target, 1, "options->lands_on_target") == 1;
  made.seed = given.seed;
  made.sharp_angle = given.sharp_angle;
  made.picture_side = given.picture_side;
  made.picture_drawing = enumValue<PictureDrawing>(
      given.picture_drawing, STIPPLE_PICTURE_DRAWING_SPLATS, "options->picture_drawing");
  if (requireTriples(given.landmark_count, "options->landmark_count") > 0) {
    made.landmarks = landmarksOf(
        {&require(given.landmark_vertices, "options->landmark_vertices"), given.landmark_count},
        {&require(given.landmark_places, "options->landmark_places"), 3 * given.landmark_count});
  }
  validate(made);
  return made;
}

TargetSource sourceFrom(const StippleMeshAdaptTarget* target) {
  const StippleMeshAdaptTarget given = complete(target, "target");
  if ((given.mesh != nullptr) + (given.cloud != nullptr) + (given.points != nullptr) +
          (given.points_path_utf8 != nullptr) + (given.views != nullptr) !=
      1) {
    fail(ErrorCode::kInvalidArgument,
         "target has several of mesh, cloud, points, the path of points and views, or none; "
         "exactly one "
         "must be given");
  }
  TargetSource source;
  if (given.mesh) source.mesh = given.mesh->mesh;
  if (given.cloud) source.cloud = given.cloud->cloud;
  if (given.views) source.views = sourceOf(*given.views);
  if (given.points) {
    const size_t numbers = requireTriples(given.point_count, "target->point_count");
    source.points.assign(given.points, given.points + numbers);
    if (given.normals) source.normals.assign(given.normals, given.normals + numbers);
  }
  if (given.points_path_utf8) {
    PointSet points = readPlyPoints(given.points_path_utf8, true);
    source.points = std::move(points.positions);
    source.normals = std::move(points.normals);
  }
  return source;
}

RegistrationWatch& watchOf(StippleJob* job) {
  if (!require(job, "job").adaptation) {
    fail(ErrorCode::kInvalidArgument, "this job does not adapt a mesh");
  }
  return *job->adaptation;
}

}  // namespace

extern "C" {

void stipple_mesh_adapt_options_init(StippleMeshAdaptOptions* options) {
  if (!options) return;
  const RegistrationOptions defaults;
  *options = {};
  options->struct_size = sizeof(StippleMeshAdaptOptions);
  options->density = static_cast<uint32_t>(defaults.adapter.density);
  options->alignment = static_cast<uint32_t>(defaults.alignment);
  options->steps = defaults.adapter.steps;
  options->samples_per_point = defaults.samples_per_point;
  options->target_count = defaults.target_count;
  options->report_count = defaults.report_count;
  options->seed = defaults.seed;
  options->sharp_angle = defaults.sharp_angle;
  options->picture_side = defaults.picture_side;
  options->picture_drawing = static_cast<uint32_t>(defaults.picture_drawing);
  options->strength = defaults.adapter.strength;
  options->adaptive_factor = defaults.adapter.adaptive_factor;
  options->smoothness = defaults.adapter.smoothness;
  options->step_size = defaults.adapter.step_size;
  options->position_weight = defaults.weights.position;
  options->normal_weight = defaults.weights.normal;
  options->landmark_weight = defaults.weights.landmark;
  options->symmetric_weight = defaults.weights.symmetric;
}

StippleStatus stipple_mesh_adapt_start(const StippleMesh* given,
                                       const StippleMeshAdaptTarget* target,
                                       const StippleMeshAdaptOptions* options, StippleJob** job) {
  return guarded([&] {
    const std::shared_ptr<const TriMesh> mesh = require(given, "given").mesh;
    TargetSource source = sourceFrom(target);
    RegistrationOptions chosen = optionsFrom(options);
    require(job, "job");
    given->context->requireMemory(
        registerToMemoryBound(*mesh, source, chosen, *given->context->backends),
        "adapting the mesh");
    auto watch = std::make_shared<RegistrationWatch>();
    *job = startJob(
        given->context,
        [mesh, watch, backends = given->context->backends, source = std::move(source),
         chosen = std::move(chosen)](Progress& progress) -> JobResult {
          return std::make_shared<const RegisteredMesh>(
              registerTo(*mesh, source, chosen, *backends, &progress, watch.get()));
        },
        nullptr, nullptr, watch);
  });
}

StippleStatus stipple_mesh_adapt_memory_bound(const StippleMesh* given,
                                              const StippleMeshAdaptTarget* target,
                                              const StippleMeshAdaptOptions* options,
                                              uint64_t* bytes) {
  return guarded([&] {
    const TriMesh& mesh = *require(given, "given").mesh;
    require(bytes, "bytes") = registerToMemoryBound(mesh, sourceFrom(target), optionsFrom(options),
                                                    *given->context->backends);
  });
}

StippleStatus stipple_mesh_adapt_preview(StippleJob* job, StippleMesh** mesh) {
  return guarded([&] {
    require(mesh, "mesh");
    std::shared_ptr<TriMesh> newest = watchOf(job).takeShape();
    *mesh = newest ? new StippleMesh{job->context, std::move(newest)} : nullptr;
  });
}

StippleStatus stipple_mesh_adapt_finish(StippleJob* job) {
  return guarded([&] { watchOf(job).finish(); });
}

StippleStatus stipple_job_adapt_report(const StippleJob* job, StippleMeshAdaptReport* report) {
  return guarded([&] {
    const auto& made = jobResult<std::shared_ptr<const RegisteredMesh>>(require(job, "job"),
                                                                        "report of an adaptation");
    const RegistrationReport& from = made->report;
    StippleMeshAdaptReport out = {};
    out.is_measured = from.is_measured ? 1 : 0;
    out.has_normals = from.after.has_normals ? 1 : 0;
    out.turned_normals = from.turned_normals ? 1 : 0;
    out.place_count = from.place_count;
    out.loose_count = from.loose_count;
    out.step_count = from.step_count;
    out.picture_before = from.picture_before;
    out.picture_after = from.picture_after;
    out.loss = from.loss;
    out.distance_before = from.before.distance;
    out.distance_after = from.after.distance;
    out.squared_before = from.before.squared;
    out.squared_after = from.after.squared;
    out.normals_before = from.before.normals;
    out.normals_after = from.after.normals;
    deliver(report, out, "report");
  });
}

}  // extern "C"
