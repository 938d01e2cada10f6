#pragma once

#include <memory>

#include "splat/render/image_renderer.h"
#include "train/loop/render_backend.h"
#include "train/loop/view_pass.h"

namespace stipple {

/// Makes everything that draws splats and differentiates their images, for one kind of processor. A
/// context holds one and passes it down: nobody who fits, judges or draws splats makes his own.
/// May be called by several threads; what it makes is of one each.
class BackendFactory : public ImageRendererFactory {
 public:
  virtual std::unique_ptr<ViewPass> makeViewPass() const = 0;
  virtual std::unique_ptr<RenderBackend> makeRenderBackend() const = 0;
};

/// On this processor.
std::shared_ptr<const BackendFactory> cpuBackends();

}  // namespace stipple
