#pragma once

#include <memory>

#include "train/backend/backend_factory.h"

namespace stipple::testing {

/// A second way of drawing and fitting, behind the same interfaces as the processor's fast one:
/// everything in double, no tiles, no vectors. Raw numbers, moments, images and derivatives are its
/// own. What it copies out for the host is overwritten by NaN at its next call, and what nobody
/// asked for is NaN from the first: who reads it without having said so gets NaN.
///
/// It draws over black, knows blending weights and contributions alone of the statistics, and no
/// parameterisation of a strategy; it refuses the rest.
class ReferenceBackends final : public BackendFactory {
 public:
  std::unique_ptr<ImageRenderer> makeImageRenderer() const override;
  std::unique_ptr<ViewPass> makeViewPass() const override;
  std::unique_ptr<RenderBackend> makeRenderBackend() const override;

  // How many it has made of each.
  mutable int images = 0, passes = 0, backends = 0;
};

}  // namespace stipple::testing
