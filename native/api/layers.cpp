#include <algorithm>
#include <optional>
#include <span>
#include <vector>

#include "api/guard.h"
#include "api/handles.h"
#include "base/parallel.h"

using namespace stipple;
using namespace stipple::api;

namespace {

uint64_t pixelsOf(const StippleLayers& handle) {
  return uint64_t{handle.layers.width()} * handle.layers.height();
}

/// What the caller has of each pixel of the layers.
std::span<const float> pixelValues(const StippleLayers& handle, const float* values,
                                   uint64_t channels, const char* name) {
  return {&require(values, name), pixelsOf(handle) * channels};
}

std::span<float> pixelValues(const StippleLayers& handle, float* values, uint64_t channels,
                             const char* name) {
  return {&require(values, name), pixelsOf(handle) * channels};
}

/// Runs `body` within the thread limit of the layers' context.
template <typename Body>
void withLayers(const StippleLayers& handle, const Body& body) {
  withThreads(handle.context->thread_count, body);
}

}  // namespace

extern "C" {

StippleStatus stipple_layers_create(StippleContext* context, uint32_t width, uint32_t height,
                                    const float* combined, const float* depth, const float* shadow,
                                    StippleLayers** layers) {
  return guarded([&] {
    require(context, "context");
    require(combined, "combined");
    require(depth, "depth");
    require(layers, "layers");
    context->state->requireMemory(MeshLayers::memoryBound(width, height), "the layers of an image");
    const size_t pixels = size_t{width} * height;
    withThreads(context->state->thread_count, [&] {
      *layers = new StippleLayers{
          context->state,
          MeshLayers(width, height, {combined, pixels * 4}, {depth, pixels},
                     shadow ? std::span(shadow, pixels * 3) : std::span<const float>())};
    });
  });
}

void stipple_layers_free(StippleLayers* layers) {
  delete layers;
}

StippleStatus stipple_layers_hold_out(StippleLayers* layers, const float* depth,
                                      const float* opacity) {
  return guarded([&] {
    StippleLayers& handle = require(layers, "layers");
    handle.layers.holdOut(pixelValues(handle, depth, 1, "depth"),
                          pixelValues(handle, opacity, 1, "opacity"));
  });
}

StippleStatus stipple_layers_take_world(StippleLayers* layers, const float* seen,
                                        const float* plain) {
  return guarded([&] {
    StippleLayers& handle = require(layers, "layers");
    const std::span<const float> light = pixelValues(handle, seen, 3, "seen");
    std::optional<std::vector<float>> colour;
    if (plain) colour.emplace(plain, plain + 3);
    withLayers(handle, [&] { handle.layers.takeWorld(light, colour); });
  });
}

StippleStatus stipple_layers_take_shadow(StippleLayers* layers, const float* shadow) {
  return guarded([&] {
    StippleLayers& handle = require(layers, "layers");
    const std::span<const float> light = pixelValues(handle, shadow, 3, "shadow");
    withLayers(handle, [&] { handle.layers.takeShadow(light); });
  });
}

StippleStatus stipple_layers_light_before(StippleLayers* layers, const float* before,
                                          const float* whole) {
  return guarded([&] {
    StippleLayers& handle = require(layers, "layers");
    const std::span<const float> some = pixelValues(handle, before, 4, "before");
    const std::span<const float> all = pixelValues(handle, whole, 4, "whole");
    withLayers(handle, [&] { handle.layers.lightBefore(some, all); });
  });
}

StippleStatus stipple_layers_info(const StippleLayers* layers, StippleLayersInfo* info) {
  return guarded([&] {
    const MeshLayers& given = require(layers, "layers").layers;
    StippleLayersInfo out = {};
    out.has_light = given.light().empty() ? 0 : 1;
    out.has_shadows = given.hasShadows() ? 1 : 0;
    out.has_opacity = given.hasHoldouts() ? 1 : 0;
    out.width = given.width();
    out.height = given.height();
    deliver(info, out, "info");
  });
}

StippleStatus stipple_layers_surface(const StippleLayers* layers,
                                     const StippleLayersBuffers* buffers) {
  return guarded([&] {
    const StippleLayers& handle = require(layers, "layers");
    const StippleLayersBuffers out = complete(buffers, "buffers");
    const MeshLayers& given = handle.layers;
    if (out.light && given.light().empty()) {
      fail(ErrorCode::kInvalidArgument,
           "buffers->light is given, and the layers have no shadow; it must be NULL");
    }
    const auto give = [](const std::vector<float>& values, float* to) {
      std::copy(values.begin(), values.end(), to);
    };
    withLayers(handle, [&] {
      if (out.depth) give(given.surfaceDepth(), out.depth);
      if (out.opacity) give(given.hidden(), out.opacity);
    });
    if (out.colour) give(given.colour(), out.colour);
    if (out.light) give(given.light(), out.light);
  });
}

StippleStatus stipple_layers_matte(const StippleLayers* layers, const float* catcher_depth,
                                   float margin, float* depth, float* opacity) {
  return guarded([&] {
    const StippleLayers& handle = require(layers, "layers");
    const std::span<const float> catchers = pixelValues(handle, catcher_depth, 1, "catcher_depth");
    const std::span<float> nearest = pixelValues(handle, depth, 1, "depth");
    const std::span<float> hidden = pixelValues(handle, opacity, 1, "opacity");
    withLayers(handle, [&] { handle.layers.matteOf(catchers, margin, nearest, hidden); });
  });
}

StippleStatus stipple_layers_compose(const StippleLayers* layers, float* colour, float* depth,
                                     const float* transmittance) {
  return guarded([&] {
    const StippleLayers& handle = require(layers, "layers");
    const std::span<float> pixels = pixelValues(handle, colour, 4, "colour");
    const std::span<float> depths = pixelValues(handle, depth, 1, "depth");
    const std::span<const float> through = pixelValues(handle, transmittance, 1, "transmittance");
    withLayers(handle, [&] { handle.layers.compose(pixels, depths, through); });
  });
}

}  // extern "C"
