#include "splat/render/draw_order.h"

#include <utility>

#include "api/camera.h"
#include "api/conversions.h"
#include "api/job.h"

using namespace stipple;
using namespace stipple::api;

static_assert(STIPPLE_DRAW_GEOMETRY_FLOATS == kDrawGeometryFloats);
static_assert(STIPPLE_DRAW_ROW_FLOATS == kDrawRowFloats);
static_assert(STIPPLE_MAX_DRAW_ROWS == kMaxDrawRows);

namespace {

[[noreturn]] void failCapacity(const char* name, uint64_t capacity, uint64_t count) {
  fail(ErrorCode::kBufferTooSmall, std::string(name) + " is " + std::to_string(capacity) + "; " +
                                       std::to_string(count) + " splats need room");
}

}  // namespace

extern "C" {

StippleStatus stipple_cloud_pack(const StippleCloud* cloud, float* geometry, uint64_t capacity) {
  return guarded([&] {
    const SplatCloud& splats = *require(cloud, "cloud").cloud;
    if (capacity < splats.size()) failCapacity("capacity", capacity, splats.size());
    if (splats.size() > 0) packDrawGeometry(splats, &require(geometry, "geometry"));
  });
}

StippleStatus stipple_renderer_order_start(StippleRenderer* renderer,
                                           const StippleInstance* instances, uint64_t count,
                                           const StippleCamera* camera,
                                           const StippleDrawOrderBuffers* buffers,
                                           StippleJob** job) {
  return guarded([&] {
    require(renderer, "renderer");
    require(job, "job");
    Instances placed = instancesFrom(instances, count);
    const Camera view = cameraFrom(camera);
    const StippleDrawOrderBuffers out = complete(buffers, "buffers");
    const uint64_t splats = splatCount(placed);
    if ((out.order || out.rows) && out.capacity < splats) {
      failCapacity("buffers->capacity", out.capacity, splats);
    }
    DrawOrderOutput output;
    output.order = out.order;
    output.rows = out.rows;
    output.sh_degree_limit =
        enumValue<int>(out.sh_degree_limit, kMaxShDegree, "buffers->sh_degree_limit");
    std::vector<uint64_t> first_rows;
    if (out.rows && count > 0) {
      const uint64_t* given = &require(out.first_rows, "buffers->first_rows");
      first_rows.assign(given, given + count);
    }
    output.first_rows = first_rows;
    validateDrawOrder(placed.list, view, output);
    renderer->context->requireMemory(drawOrderMemoryBound(splats), "ordering these splats");
    *job = startJob(renderer->context,
                    [shared = renderer->renderer, placed = std::move(placed), view, output,
                     first_rows = std::move(first_rows)](Progress& progress) mutable {
                      output.first_rows = first_rows;
                      shared->order(placed, view, output, progress);
                      return JobResult{};
                    });
  });
}

StippleStatus stipple_renderer_order_memory_bound(const StippleRenderer* renderer,
                                                  const StippleInstance* instances, uint64_t count,
                                                  uint64_t* bytes) {
  return guarded([&] {
    require(renderer, "renderer");
    require(bytes, "bytes") = drawOrderMemoryBound(splatCount(instancesFrom(instances, count)));
  });
}

}  // extern "C"
