#include <cstddef>
#include <utility>

#include "api/camera.h"
#include "api/guard.h"
#include "api/handles.h"
#include "api/instances.h"
#include "api/job.h"
#include "api/render_settings.h"
#include "base/parallel.h"
#include "math/colour.h"
#include "splat/render/accurate_render.h"

using namespace stipple;
using namespace stipple::api;

namespace {

/// Applies `curve` to the colours of premultiplied pixels, in place.
template <typename Curve>
void changeColour(float* colour, size_t pixel_count, const Curve& curve) {
  parallelFor(pixel_count, 1 << 14, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      float* pixel = colour + i * 4;
      const float alpha = pixel[3];
      if (alpha <= 0.0f) continue;
      for (int c = 0; c < 3; ++c) pixel[c] = curve(pixel[c] / alpha) * alpha;
    }
  });
}

/// Premultiplied display values → premultiplied scene linear values, in place.
void lineariseColour(float* colour, size_t pixel_count) {
  changeColour(colour, pixel_count, [](float value) { return srgbToLinear(value); });
}

template <typename From, typename To>
void copyTo(const std::vector<From>& values, To* out) {
  if (!out) return;
  for (size_t i = 0; i < values.size(); ++i) out[i] = static_cast<To>(values[i]);
}

/// From the splats to the picture, in place: their colours times `light`, then the surface.
template <typename Weight>
void finishLayers(float* colour, const RenderSettings& settings,
                  const std::vector<Weight>& surface_weight, size_t pixel_count) {
  const float* surface = settings.options.surface.colour;
  const float* light = settings.splat_light;
  parallelFor(pixel_count, 1 << 14, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      float* pixel = colour + i * 4;
      for (size_t c = 0; light && c < 3; ++c) pixel[c] *= light[i * 3 + c];
      if (!surface) continue;
      const float weight = static_cast<float>(surface_weight[i]);
      for (size_t c = 0; c < 4; ++c) pixel[c] += weight * surface[i * 4 + c];
    }
  });
}

bool followsRays(StippleRenderMethod method) {
  return method == STIPPLE_RENDER_RAYS || method == STIPPLE_RENDER_YARDSTICK;
}

RayOptions raysOf(StippleRenderMethod method) {
  return method == STIPPLE_RENDER_YARDSTICK ? rayYardstick() : RayOptions{};
}

/// In: is_light, whether the colours have been linearised where that was wanted.
template <typename Result>
void deliverPicture(const Result& picture, const RenderSettings& settings,
                    const StippleRenderBuffers& buffers, bool is_light = false) {
  copyTo(picture.colour, buffers.colour);
  copyTo(picture.depth, buffers.depth);
  copyTo(picture.median_depth, buffers.median_depth);
  copyTo(picture.counts, buffers.counts);
  copyTo(picture.transmittance, buffers.transmittance);
  copyTo(picture.normal, buffers.normal);
  copyTo(picture.objects, buffers.object_index);
  if (!buffers.colour) return;
  const size_t pixel_count = static_cast<size_t>(picture.width) * picture.height;
  if (is_light && settings.averages_light) {
    changeColour(buffers.colour, pixel_count, [](float value) { return linearToSrgb(value); });
  } else if (!is_light && settings.linearise) {
    lineariseColour(buffers.colour, pixel_count);
  }
  if (settings.options.surface.colour || settings.splat_light) {
    finishLayers(buffers.colour, settings, picture.surface_weight, pixel_count);
  }
}

/// In the renderer's own memory, or in new where another job of the same renderer is using that.
void renderAccurateTo(RendererMemory& memory, Instances placed, const Camera& view,
                      const RenderSettings& settings, const StippleRenderBuffers& out,
                      Progress& progress) {
  memory.cuts.cut(placed, settings.budget_share, &progress);
  const std::unique_lock<std::mutex> lock(memory.mutex, std::try_to_lock);
  if (lock.owns_lock()) {
    memory.images->render(placed.list, view, settings.options, settings.accuracy, memory.result,
                          &progress);
    deliverPicture(memory.result, settings, out);
  } else {
    RenderResult result;
    memory.backends->makeImageRenderer()->render(placed.list, view, settings.options,
                                                 settings.accuracy, result, &progress);
    deliverPicture(result, settings, out);
  }
}

/// One of the pictures of an average.
void drawPicture(ImageRenderer& images, const RenderSettings& settings,
                 std::span<const SplatInstance> instances, const Camera& camera,
                 const RenderOptions& options, RenderResult& result, Progress* progress) {
  if (followsRays(settings.method)) {
    result = renderRays(instances, camera, options, raysOf(settings.method), progress);
  } else if (settings.method == STIPPLE_RENDER_REFERENCE) {
    const ReferenceResult drawn = renderReference(instances, camera, options, progress);
    result.width = drawn.width;
    result.height = drawn.height;
    const auto take = [](const auto& from, auto& to) {
      to.resize(from.size());
      copyTo(from, to.data());
    };
    take(drawn.colour, result.colour);
    take(drawn.depth, result.depth);
    take(drawn.median_depth, result.median_depth);
    take(drawn.counts, result.counts);
    take(drawn.surface_weight, result.surface_weight);
    take(drawn.transmittance, result.transmittance);
    take(drawn.normal, result.normal);
    take(drawn.objects, result.objects);
  } else {
    images.render(instances, camera, options, settings.accuracy, result, progress);
  }
}

void renderSampledTo(RendererMemory& memory, Instances placed, const Camera& view,
                     const RenderSettings& settings, const StippleRenderBuffers& out,
                     Progress& progress) {
  memory.cuts.cut(placed, settings.budget_share, &progress);
  // Another job of the same renderer may be using its memory.
  const std::unique_lock<std::mutex> lock(memory.mutex, std::try_to_lock);
  std::unique_ptr<ImageRenderer> own;
  if (!lock.owns_lock()) own = memory.backends->makeImageRenderer();
  ImageRenderer& images = own ? *own : *memory.images;
  const DrawMoment draw = [&](std::span<const SplatInstance> instances, const Camera& camera,
                              const RenderOptions& options, RenderResult& result,
                              Progress* listener) {
    drawPicture(images, settings, instances, camera, options, result, listener);
    if (settings.linearise || settings.averages_light) {
      lineariseColour(result.colour.data(), result.colour.size() / 4);
    }
  };
  RenderResult result;
  renderSampled(placed.list, view, settings.options, settings.sampling, draw, result, &progress);
  deliverPicture(result, settings, out, true);
}

uint64_t sampledMemory(const Instances& placed, const Camera& view,
                       const RenderSettings& settings) {
  if (!isSampled(settings.sampling)) return 0;
  return renderSampledBytes(placed.list.size(), view, settings.options, settings.sampling);
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
    require(renderer, "renderer") = new StippleRenderer{
        context->state, std::make_shared<RendererMemory>(context->state->backends)};
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
    RenderSettings settings = renderSettings(options, placed);
    const Camera view = cameraFrom(camera);
    validate(view);
    const bool is_tiled = settings.method == STIPPLE_RENDER_TILED;
    const bool is_exact = is_tiled && settings.accuracy.projection == RayProjection::kRay;
    if (!followsRays(settings.method) && !is_exact) {
      requireImagePlane(view, "the affine projection of splats");
    }
    validateLayers(settings, view);
    const StippleRenderBuffers out =
        completeUpTo(buffers, offsetof(StippleRenderBuffers, transmittance), "buffers");
    settings.options.with_depth = out.depth != nullptr;
    settings.options.with_median_depth = out.median_depth != nullptr;
    settings.options.with_counts = out.counts != nullptr;
    settings.options.with_transmittance = out.transmittance != nullptr;
    settings.options.with_normal = out.normal != nullptr;
    settings.options.with_objects = out.object_index != nullptr;
    const RenderMemory memory =
        followsRays(settings.method)
            ? rayMemory(placed.list, view, settings.options)
            : accurateMemory(placed.list, view, settings.options, settings.accuracy);
    const uint64_t bytes = memory.sum() + CloudCuts::memoryBound(placed, settings.budget_share) +
                           sampledMemory(placed, view, settings);
    renderer->context->requirePictureMemory(bytes, "this picture of " + sizeText(view),
                                            memory.pair_bytes);
    *job = startJob(renderer->context, [memory = renderer->memory, placed = std::move(placed),
                                        settings, view, out](Progress& progress) {
      if (isSampled(settings.sampling)) {
        renderSampledTo(*memory, placed, view, settings, out, progress);
      } else if (settings.method == STIPPLE_RENDER_REFERENCE) {
        deliverPicture(renderReference(placed.list, view, settings.options, &progress), settings,
                       out);
      } else if (followsRays(settings.method)) {
        deliverPicture(
            renderRays(placed.list, view, settings.options, raysOf(settings.method), &progress),
            settings, out);
      } else {
        renderAccurateTo(*memory, placed, view, settings, out, progress);
      }
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
    const RenderSettings settings = renderSettings(options, placed);
    const Camera view = cameraFrom(camera);
    validate(view);
    const Sampling& sampling = settings.sampling;
    require(samples, "samples") = sampling.samples > 0 ? sampling.samples
                                  : isSampled(sampling)
                                      ? automaticSamples(placed.list, view, sampling)
                                      : 1;
  });
}

StippleStatus stipple_renderer_memory_bound(const StippleRenderer* renderer,
                                            const StippleInstance* instances, uint64_t count,
                                            const StippleCamera* camera, uint64_t* bytes) {
  return guarded([&] {
    require(renderer, "renderer");
    const Instances placed = instancesFrom(instances, count);
    require(bytes, "bytes") = renderMemoryBound(placed.list, cameraFrom(camera), RenderOptions{});
  });
}

}  // extern "C"
