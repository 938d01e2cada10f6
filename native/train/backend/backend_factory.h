#pragma once

#include <memory>

#include "splat/render/image_renderer.h"
#include "train/backend/render_backend.h"
#include "train/backend/view_pass.h"

namespace stipple {

/// Makes everything that draws splats and differentiates their images, for one kind of processor. A
/// context holds one and passes it down: nobody who fits, judges or draws splats makes his own.
/// May be called by several threads; what it makes is of one each.
class BackendFactory : public ImageRendererFactory {
 public:
  virtual std::unique_ptr<ViewPass> makeViewPass() const = 0;
  virtual std::unique_ptr<RenderBackend> makeRenderBackend() const = 0;

  /// Upper bound of the bytes of the host that a view pass allocates for the image of a cloud and
  /// its derivatives, without statistics. Who says nothing else is held to what this processor's
  /// own takes.
  virtual uint64_t passMemory(const SplatCloud& cloud, const Camera& camera,
                              const RenderOptions& options) const;
};

/// On this processor.
std::shared_ptr<const BackendFactory> cpuBackends();

}  // namespace stipple
