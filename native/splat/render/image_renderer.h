#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "base/progress.h"
#include "splat/render/accurate_render.h"
#include "splat/render/draw_order.h"
#include "splat/render/render.h"

namespace stipple {

/// Draws images of placed splats, and orders splats for who draws them by himself. It keeps its
/// memory from one image to the next, and nothing that it knows of splats: a cloud may hold others
/// in the next call, at the same address. One call at a time.
/// Errors of both: those of renderAccurate and orderForDrawing, which say what a call gives.
/// Determinism: the same calls give the same bits, for any number of threads.
class ImageRenderer {
 public:
  virtual ~ImageRenderer() = default;

  virtual void render(std::span<const SplatInstance> instances, const Camera& camera,
                      const RenderOptions& options, const RenderAccuracy& accuracy,
                      RenderResult& result, Progress* progress = nullptr) = 0;

  virtual void order(std::span<const SplatInstance> instances, const Camera& camera,
                     const DrawOrderOutput& output, Progress* progress = nullptr) = 0;

  virtual uint64_t memoryBytes() const = 0;  ///< held now, about
};

/// Makes image renderers, for one kind of processor. May be called by several threads.
class ImageRendererFactory {
 public:
  virtual ~ImageRendererFactory() = default;
  virtual std::unique_ptr<ImageRenderer> makeImageRenderer() const = 0;

  /// Upper bounds of the bytes of the host that one call of render() and of order() allocates. Who
  /// says nothing else is held to what this processor's own take.
  virtual RenderMemory imageMemory(std::span<const SplatInstance> instances, const Camera& camera,
                                   const RenderOptions& options,
                                   const RenderAccuracy& accuracy) const;
  virtual uint64_t orderMemory(uint64_t splat_count) const;
};

/// On this processor, with native/splat.
std::unique_ptr<ImageRenderer> makeCpuImageRenderer();

}  // namespace stipple
