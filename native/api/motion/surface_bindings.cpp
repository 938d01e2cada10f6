#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "api/guard.h"
#include "api/handles.h"
#include "api/job.h"
#include "base/parallel.h"
#include "motion/surface_binding.h"

using namespace stipple;
using namespace stipple::api;

namespace {

std::vector<float> placesFrom(const float* values, uint64_t vertex_count, const char* name) {
  const size_t length = requireTriples(vertex_count, "vertex_count");
  const float* begin = length == 0 ? values : &require(values, name);
  return {begin, begin + length};
}

}  // namespace

extern "C" {

StippleStatus stipple_cloud_bind_start(const StippleCloud* cloud, const float* rest,
                                       uint64_t vertex_count, const uint32_t* triangles,
                                       uint64_t triangle_count, uint32_t reach, StippleJob** job) {
  return guarded([&] {
    const std::shared_ptr<const SplatCloud> splats = require(cloud, "cloud").cloud;
    const size_t corners = requireTriples(triangle_count, "triangle_count");
    const auto followed = enumValue<BindingReach>(reach, STIPPLE_BIND_AROUND, "reach");
    require(job, "job");
    cloud->context->requireMemory(
        bindingMemoryBound(splats->size(), vertex_count, triangle_count, followed),
        "binding these splats");
    std::vector<float> places = placesFrom(rest, vertex_count, "rest");
    if (corners > 0) require(triangles, "triangles");
    *job = startJob(cloud->context,
                    [splats, followed, places = std::move(places),
                     indices = std::vector<uint32_t>(triangles, triangles + corners)](
                        Progress& progress) -> JobResult {
                      return std::make_shared<const SurfaceBinding>(
                          bindToSurface(splats->positions, places, indices, followed, &progress));
                    });
  });
}

StippleStatus stipple_job_binding(const StippleJob* job, StippleBinding** binding) {
  return guarded([&] {
    const auto& made =
        jobResult<std::shared_ptr<const SurfaceBinding>>(require(job, "job"), "binding");
    require(binding, "binding") = new StippleBinding{job->context, made};
  });
}

void stipple_binding_free(StippleBinding* binding) {
  delete binding;
}

StippleStatus stipple_binding_info(const StippleBinding* binding, StippleBindingInfo* info) {
  return guarded([&] {
    const SurfaceBinding& made = *require(binding, "binding").binding;
    StippleBindingInfo out = {};
    out.influences = made.influences;
    out.splat_count = made.size();
    out.vertex_count = made.rest.size() / 3;
    out.triangle_count = made.triangles.size() / 3;
    out.topology = made.topology;
    deliver(info, out, "info");
  });
}

StippleStatus stipple_cloud_carry(const StippleCloud* cloud, const StippleBinding* binding,
                                  const float* deformed, uint64_t vertex_count,
                                  StippleCloud** carried) {
  return guarded([&] {
    const SplatCloud& splats = *require(cloud, "cloud").cloud;
    const SurfaceBinding& bound = *require(binding, "binding").binding;
    const size_t length = requireTriples(vertex_count, "vertex_count");
    if (length > 0) require(deformed, "deformed");
    require(carried, "carried");
    const Context& context = cloud->context;
    context->requireMemory(carriedMemoryBound(splats, bound), "these splats on a mesh");
    withThreads(context->thread_count, [&] {
      *carried = new StippleCloud{context, std::make_shared<const SplatCloud>(
                                               carriedSplats(splats, bound, {deformed, length}))};
    });
  });
}

}  // extern "C"
