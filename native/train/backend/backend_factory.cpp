#include "train/backend/backend_factory.h"

#include "splat/render/render_backward.h"

namespace stipple {

namespace {

class CpuBackends final : public BackendFactory {
 public:
  std::unique_ptr<ImageRenderer> makeImageRenderer() const override {
    return makeCpuImageRenderer();
  }
  std::unique_ptr<ViewPass> makeViewPass() const override { return makeCpuViewPass(); }
  std::unique_ptr<RenderBackend> makeRenderBackend() const override { return makeCpuBackend(); }
};

}  // namespace

uint64_t BackendFactory::passMemory(const SplatCloud& cloud, const Camera& camera,
                                    const RenderOptions& options) const {
  const SplatInstance instance{&cloud};
  return backwardMemoryBound({&instance, 1}, camera, options, {});
}

std::shared_ptr<const BackendFactory> cpuBackends() {
  static const std::shared_ptr<const BackendFactory> made = std::make_shared<CpuBackends>();
  return made;
}

}  // namespace stipple
