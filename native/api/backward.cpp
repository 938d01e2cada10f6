#include <algorithm>
#include <iterator>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "api/camera.h"
#include "api/conversions.h"
#include "api/job.h"
#include "base/parallel.h"
#include "splat/render/render_backward.h"
#include "train/optimiser/image_loss.h"

using namespace stipple;
using namespace stipple::api;

namespace {

/// The caller's buffers, each for the array of kGradientArrays in its place. What comes after
/// those is for density control alone.
constexpr float* StippleSplatGradients::*kBuffers[] = {
    &StippleSplatGradients::positions,
    &StippleSplatGradients::rotations,
    &StippleSplatGradients::scales,
    &StippleSplatGradients::opacities,
    &StippleSplatGradients::sh,
    &StippleSplatGradients::contributions,
    &StippleSplatGradients::blending_weights,
    &StippleSplatGradients::edge_weights,
    &StippleSplatGradients::screen_gradients,
    &StippleSplatGradients::absolute_screen_gradients,
    &StippleSplatGradients::screen_gradient_norms,
    &StippleSplatGradients::errors,
    &StippleSplatGradients::largest_errors};
static_assert(kGradientArrays[std::size(kBuffers) - 1].values == &SplatGradients::largest_errors);

using Buffers = std::vector<StippleSplatGradients>;

/// The caller's buffers [count], each with room for its cloud.
Buffers buffersFrom(const StippleSplatGradients* gradients, const Instances& placed) {
  Buffers made;
  if (placed.list.empty()) return made;
  require(gradients, "gradients");
  for (size_t i = 0; i < placed.list.size(); ++i) {
    const std::string name = "gradients[" + std::to_string(i) + "]";
    made.push_back(complete(gradients + i, name.c_str()));
    const size_t count = placed.list[i].cloud->size();
    if (made.back().capacity < count) {
      fail(ErrorCode::kBufferTooSmall, name + ".capacity is " +
                                           std::to_string(made.back().capacity) + " splats; " +
                                           std::to_string(count) + " are needed");
    }
  }
  return made;
}

bool isWanted(const Buffers& buffers, float* StippleSplatGradients::*buffer) {
  return std::any_of(buffers.begin(), buffers.end(),
                     [&](const StippleSplatGradients& one) { return one.*buffer != nullptr; });
}

/// The picture that a statistic needs; empty where the statistic is not wanted.
std::span<const float> pictureFor(bool wanted, const float* values, size_t count,
                                  const char* picture, const char* statistic) {
  if (!wanted) return {};
  if (!values) {
    fail(ErrorCode::kInvalidArgument, std::string("input->") + picture +
                                          " is NULL; it must be given where " + statistic +
                                          " are wanted");
  }
  return {values, count};
}

/// Asks for those statistics only that have a buffer.
BackwardInput inputFrom(const StippleBackwardInput* input, const Buffers& buffers,
                        const Camera& view) {
  const StippleBackwardInput given = complete(input, "input");
  const size_t pixel_count = static_cast<size_t>(view.width) * view.height;
  const auto wanted = [&](float* StippleSplatGradients::*buffer) {
    return isWanted(buffers, buffer);
  };
  BackwardInput made;
  made.colour_gradient = {&require(given.colour_gradient, "input->colour_gradient"),
                          pixel_count * 4};
  made.residual = pictureFor(wanted(&StippleSplatGradients::contributions), given.residual,
                             pixel_count * 3, "residual", "contributions");
  if (!made.residual.empty() && given.residual_weights) {
    made.residual_weights = {given.residual_weights, pixel_count};
  }
  made.edge_weights = pictureFor(wanted(&StippleSplatGradients::edge_weights), given.edge_weights,
                                 pixel_count, "edge_weights", "edge weights");
  made.errors = pictureFor(
      wanted(&StippleSplatGradients::errors) || wanted(&StippleSplatGradients::largest_errors),
      given.errors, pixel_count, "errors", "errors");
  if (given.depth_gradient) made.depth_gradient = {given.depth_gradient, pixel_count};
  made.with_blending_weights = wanted(&StippleSplatGradients::blending_weights);
  made.with_screen_gradients = wanted(&StippleSplatGradients::screen_gradients);
  made.with_absolute_screen_gradients = wanted(&StippleSplatGradients::absolute_screen_gradients) ||
                                        wanted(&StippleSplatGradients::screen_gradient_norms);
  return made;
}

void deliverGradients(const BackwardResult& made, const Buffers& buffers,
                      StippleBackwardResult* result) {
  for (size_t i = 0; i < buffers.size(); ++i) {
    for (size_t k = 0; k < std::size(kBuffers); ++k) {
      float* out = buffers[i].*kBuffers[k];
      const std::vector<float>& values = made.instances[i].*kGradientArrays[k].values;
      if (out) std::copy(values.begin(), values.end(), out);
    }
  }
  if (!result) return;
  StippleBackwardResult out = {};
  std::copy(made.camera.begin(), made.camera.end(), out.camera);
  std::copy(made.background.begin(), made.background.end(), out.background);
  out.visible_count = made.visible_count;
  deliver(result, out, "result");
}

/// In: channels of a StippleImageLossOptions, name of the field.
PixelLayout layoutOf(uint32_t channels, const char* name) {
  if (channels != 3 && channels != 4) {
    fail(ErrorCode::kInvalidArgument,
         std::string(name) + " is " + std::to_string(channels) + "; 3 or 4 is allowed");
  }
  return channels == 4 ? PixelLayout::kRgba : PixelLayout::kRgb;
}

void requireSides(uint32_t width, uint32_t height) {
  constexpr uint32_t kMaxSide = 65536;
  if (width < 1 || height < 1 || width > kMaxSide || height > kMaxSide) {
    fail(ErrorCode::kInvalidArgument, "the image is " + std::to_string(width) + " x " +
                                          std::to_string(height) +
                                          " pixels; each side must be 1 to 65536");
  }
}

}  // namespace

extern "C" {

StippleStatus stipple_renderer_backward_start(StippleRenderer* renderer,
                                              const StippleInstance* instances, uint64_t count,
                                              const StippleCamera* camera,
                                              const StippleRenderOptions* options,
                                              const StippleBackwardInput* input,
                                              const StippleSplatGradients* gradients,
                                              StippleBackwardResult* result, StippleJob** job) {
  return guarded([&] {
    require(renderer, "renderer");
    require(job, "job");
    Instances placed = instancesFrom(instances, count);
    const ShotSettings settings = shotFrom(options, placed);
    requireDerivative(settings, placed);
    const Camera view = cameraFrom(camera);
    validate(view);
    requireImagePlane(view, "the backward pass");
    Buffers buffers = buffersFrom(gradients, placed);
    const BackwardInput given = inputFrom(input, buffers, view);
    if (result) complete(result, "result");
    renderer->context->requirePictureMemory(
        backwardMemoryBound(placed.list, view, settings.options, given),
        "the backward pass of an image of " + sizeText(view),
        renderMemory(placed.list, view, settings.options).pair_bytes);
    *job = startJob(renderer->context, [shared = renderer->renderer, placed = std::move(placed),
                                        options = settings.options, view, given,
                                        buffers = std::move(buffers), result](Progress& progress) {
      shared->backward(
          placed, view, options, given,
          [&](const BackwardResult& made) { deliverGradients(made, buffers, result); }, progress);
      return JobResult{};
    });
  });
}

StippleStatus stipple_renderer_backward_memory_bound(const StippleRenderer* renderer,
                                                     const StippleInstance* instances,
                                                     uint64_t count, const StippleCamera* camera,
                                                     const StippleBackwardInput* input,
                                                     const StippleSplatGradients* gradients,
                                                     uint64_t* bytes) {
  return guarded([&] {
    require(renderer, "renderer");
    require(bytes, "bytes");
    const Instances placed = instancesFrom(instances, count);
    const Camera view = cameraFrom(camera);
    validate(view);
    requireImagePlane(view, "the backward pass");
    const Buffers buffers = buffersFrom(gradients, placed);
    *bytes = backwardMemoryBound(placed.list, view, {}, inputFrom(input, buffers, view));
  });
}

void stipple_image_loss_options_init(StippleImageLossOptions* options) {
  if (!options) return;
  *options = {};
  options->struct_size = sizeof(StippleImageLossOptions);
  options->rendered_channels = 4;
  options->target_channels = 3;
  options->ssim_share = ImageLossOptions{}.ssim_share;
}

StippleStatus stipple_image_loss(StippleContext* context, uint32_t width, uint32_t height,
                                 const float* rendered, const float* target, const float* weights,
                                 const StippleImageLossOptions* options, StippleImageLoss* value,
                                 float* gradient) {
  return guarded([&] {
    require(context, "context");
    require(rendered, "rendered");
    require(target, "target");
    complete(value, "value");
    StippleImageLossOptions defaults;
    stipple_image_loss_options_init(&defaults);
    const StippleImageLossOptions given = completed(options, defaults, "options");
    const PixelLayout layout = layoutOf(given.rendered_channels, "options->rendered_channels");
    const PictureView target_view = {target,
                                     layoutOf(given.target_channels, "options->target_channels")};
    requireSides(width, height);
    ImageLossValue made;
    withThreads(context->state->thread_count, [&] {
      made = ImageLoss().evaluate(width, height, {rendered, layout}, target_view, weights,
                                  {gradient, layout}, {given.ssim_share});
    });
    StippleImageLoss out = {};
    out.loss = made.loss;
    out.l1 = made.l1;
    out.ssim = made.ssim;
    deliver(value, out, "value");
  });
}

}  // extern "C"
