#include <cstddef>
#include <utility>

#include "api/camera.h"
#include "api/conversions.h"
#include "api/job.h"

using namespace stipple;
using namespace stipple::api;

namespace {

ShotPasses passesFrom(const StippleRenderBuffers* buffers) {
  const StippleRenderBuffers given =
      completeUpTo(buffers, offsetof(StippleRenderBuffers, transmittance), "buffers");
  return {given.colour,        given.depth,  given.median_depth, given.counts,
          given.transmittance, given.normal, given.object_index};
}

}  // namespace

extern "C" {

void stipple_render_options_init(StippleRenderOptions* options) {
  if (!options) return;
  *options = {};
  options->struct_size = sizeof(StippleRenderOptions);
  options->sh_degree_limit = static_cast<uint32_t>(kMaxShDegree);
}

StippleStatus stipple_renderer_create(StippleContext* context, StippleRenderer** renderer) {
  return guarded([&] {
    require(context, "context");
    require(renderer, "renderer") =
        new StippleRenderer{context->state, std::make_shared<Renderer>(context->state->backends)};
  });
}

void stipple_renderer_free(StippleRenderer* renderer) {
  delete renderer;
}

StippleStatus stipple_renderer_render_start(StippleRenderer* renderer,
                                            const StippleInstance* instances, uint64_t count,
                                            const StippleCamera* camera,
                                            const StippleRenderOptions* options,
                                            const StippleRenderBuffers* buffers, StippleJob** job) {
  return guarded([&] {
    require(renderer, "renderer");
    require(job, "job");
    Instances placed = instancesFrom(instances, count);
    ShotSettings settings = shotFrom(options, placed);
    const Camera view = cameraFrom(camera);
    validate(view);
    validate(settings, view);
    const ShotPasses passes = passesFrom(buffers);
    askForPasses(passes, settings);
    const RenderMemory memory = renderer->renderer->memory(placed, view, settings);
    renderer->context->requirePictureMemory(memory.sum(), "this image of " + sizeText(view),
                                            memory.pair_bytes);
    *job = startJob(renderer->context, [shared = renderer->renderer, placed = std::move(placed),
                                        settings, view, passes](Progress& progress) {
      shared->render(placed, view, settings, passes, progress);
      return JobResult{};
    });
  });
}

StippleStatus stipple_renderer_sample_count(const StippleRenderer* renderer,
                                            const StippleInstance* instances, uint64_t count,
                                            const StippleCamera* camera,
                                            const StippleRenderOptions* options,
                                            uint32_t* samples) {
  return guarded([&] {
    require(renderer, "renderer");
    const Instances placed = instancesFrom(instances, count);
    const ShotSettings settings = shotFrom(options, placed);
    const Camera view = cameraFrom(camera);
    validate(view);
    require(samples, "samples") = Renderer::sampleCount(placed, view, settings);
  });
}

StippleStatus stipple_renderer_memory_bound(const StippleRenderer* renderer,
                                            const StippleInstance* instances, uint64_t count,
                                            const StippleCamera* camera, uint64_t* bytes) {
  return guarded([&] {
    require(renderer, "renderer");
    const Instances placed = instancesFrom(instances, count);
    require(bytes, "bytes") =
        renderer->context->backends->imageMemory(placed.list, cameraFrom(camera), {}, {}).sum();
  });
}

}  // extern "C"
