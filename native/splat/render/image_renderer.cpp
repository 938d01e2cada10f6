#include "splat/render/image_renderer.h"

namespace stipple {

namespace {

class CpuImageRenderer final : public ImageRenderer {
 public:
  void render(std::span<const SplatInstance> instances, const Camera& camera,
              const RenderOptions& options, const RenderAccuracy& accuracy, RenderResult& result,
              Progress* progress) override {
    renderAccurate(instances, camera, options, accuracy, workspace_, result, progress);
  }

  void order(std::span<const SplatInstance> instances, const Camera& camera,
             const DrawOrderOutput& output, Progress* progress) override {
    orderForDrawing(instances, camera, output, order_workspace_, progress);
  }

  uint64_t memoryBytes() const override { return workspace_.bytes() + order_workspace_.bytes(); }

 private:
  RenderWorkspace workspace_;
  DrawOrderWorkspace order_workspace_;
};

}  // namespace

RenderMemory ImageRendererFactory::imageMemory(std::span<const SplatInstance> instances,
                                               const Camera& camera, const RenderOptions& options,
                                               const RenderAccuracy& accuracy) const {
  return accurateMemory(instances, camera, options, accuracy);
}

uint64_t ImageRendererFactory::orderMemory(uint64_t splat_count) const {
  return drawOrderMemoryBound(splat_count);
}

std::unique_ptr<ImageRenderer> makeCpuImageRenderer() {
  return std::make_unique<CpuImageRenderer>();
}

}  // namespace stipple
