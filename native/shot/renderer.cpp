#include "shot/renderer.h"

#include <utility>

#include "splat/render/accurate_render.h"

namespace stipple {

namespace {

/// How a backend draws it.
RenderAccuracy accuracyOf(const ShotSettings& settings) {
  if (settings.method != ShotMethod::kRays) return settings.accuracy;
  RenderAccuracy rays;
  rays.order = RayOrder::kResponse;
  rays.projection = RayProjection::kRay;
  rays.precision = Precision::kDouble;
  return rays;
}

/// One of the pictures of an average.
void drawMoment(ImageRenderer& images, const ShotSettings& settings,
                std::span<const SplatInstance> instances, const Camera& camera,
                const RenderOptions& options, RenderResult& result, Progress* progress) {
  if (settings.method == ShotMethod::kRaysUnlimited) {
    result = renderRays(instances, camera, options, unlimitedRays(), progress);
  } else if (settings.method == ShotMethod::kReference) {
    narrow(renderReference(instances, camera, options, progress), result);
  } else {
    images.render(instances, camera, options, accuracyOf(settings), result, progress);
  }
}

}  // namespace

Renderer::Renderer(std::shared_ptr<const ImageRendererFactory> images)
    : factory_(std::move(images)),
      images_(factory_->makeImageRenderer()),
      orders_(factory_->makeImageRenderer()) {}

void Renderer::render(Instances instances, const Camera& camera, const ShotSettings& asked,
                      const ShotPasses& passes, Progress& progress) {
  ShotSettings settings = asked;
  std::vector<float> behind;
  if (asked.surroundings.pixels) {
    behind = surroundingsSeen(asked.surroundings, camera);
    settings.background_image = behind.data();
  }
  cuts_.cut(instances, settings.sampling.shutter, settings.budget_share, &progress);
  if (isSampled(settings.sampling)) {
    renderBlurred(instances, camera, settings, passes, progress);
  } else if (settings.method == ShotMethod::kReference) {
    fillPasses(renderReference(instances.list, camera, settings.options, &progress), settings,
               passes);
  } else if (settings.method == ShotMethod::kRaysUnlimited) {
    fillPasses(renderRays(instances.list, camera, settings.options, unlimitedRays(), &progress),
               settings, passes);
  } else {
    renderSharp(instances, camera, settings, passes, progress);
  }
}

void Renderer::renderSharp(const Instances& instances, const Camera& camera,
                           const ShotSettings& settings, const ShotPasses& passes,
                           Progress& progress) {
  const std::unique_lock<std::mutex> lock(mutex_, std::try_to_lock);
  if (lock.owns_lock()) {
    images_->render(instances.list, camera, settings.options, accuracyOf(settings), result_,
                    &progress);
    fillPasses(result_, settings, passes);
  } else {
    RenderResult result;
    factory_->makeImageRenderer()->render(instances.list, camera, settings.options,
                                          accuracyOf(settings), result, &progress);
    fillPasses(result, settings, passes);
  }
}

void Renderer::renderBlurred(const Instances& instances, const Camera& camera,
                             const ShotSettings& settings, const ShotPasses& passes,
                             Progress& progress) {
  const std::unique_lock<std::mutex> lock(mutex_, std::try_to_lock);
  std::unique_ptr<ImageRenderer> own;
  if (!lock.owns_lock()) own = factory_->makeImageRenderer();
  ImageRenderer& images = own ? *own : *images_;
  const DrawMoment draw = [&](std::span<const SplatInstance> placed, const Camera& seen_by,
                              const RenderOptions& options, RenderResult& result,
                              Progress* listener) {
    drawMoment(images, settings, placed, seen_by, options, result, listener);
    if (settings.linearise || settings.averages_light) {
      lineariseColour(result.colour.data(), result.colour.size() / 4);
    }
  };
  RenderResult result;
  renderSampled(instances.list, camera, settings.options, settings.sampling, draw, result,
                &progress);
  fillPasses(result, settings, passes, true);
}

RenderMemory Renderer::memory(const Instances& instances, const Camera& camera,
                              const ShotSettings& settings) const {
  RenderMemory memory =
      settings.method == ShotMethod::kRaysUnlimited
          ? rayMemory(instances.list, camera, settings.options)
          : factory_->imageMemory(instances.list, camera, settings.options, accuracyOf(settings));
  memory.other_bytes +=
      CloudCuts::memoryBound(instances, settings.sampling.shutter, settings.budget_share);
  if (settings.surroundings.pixels) {
    memory.other_bytes += surroundingsSeenBytes(camera);
  }
  if (isSampled(settings.sampling)) {
    memory.other_bytes +=
        renderSampledBytes(instances.list, camera, settings.options, settings.sampling);
  }
  return memory;
}

uint32_t Renderer::sampleCount(const Instances& instances, const Camera& camera,
                               const ShotSettings& settings) {
  const Sampling& sampling = settings.sampling;
  if (sampling.samples > 0) return sampling.samples;
  return isSampled(sampling) ? automaticSamples(instances.list, camera, sampling) : 1;
}

void Renderer::backward(const Instances& instances, const Camera& camera,
                        const RenderOptions& options, const BackwardInput& input,
                        const std::function<void(const BackwardResult&)>& deliver,
                        Progress& progress) {
  const std::unique_lock<std::mutex> lock(mutex_, std::try_to_lock);
  if (lock.owns_lock()) {
    renderBackward(instances.list, camera, options, input, backward_workspace_, backward_result_,
                   UINT64_MAX, &progress);
    progress.throwIfCancelled();
    deliver(backward_result_);
  } else {
    const BackwardResult made =
        renderBackward(instances.list, camera, options, input, UINT64_MAX, &progress);
    progress.throwIfCancelled();
    deliver(made);
  }
}

void Renderer::order(const Instances& instances, const Camera& camera,
                     const DrawOrderOutput& output, Progress& progress) {
  const std::unique_lock<std::mutex> lock(order_mutex_, std::try_to_lock);
  std::unique_ptr<ImageRenderer> own;
  if (!lock.owns_lock()) own = factory_->makeImageRenderer();
  (own ? *own : *orders_).order(instances.list, camera, output, &progress);
}

}  // namespace stipple
