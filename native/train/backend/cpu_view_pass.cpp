#include <algorithm>
#include <cstddef>
#include <iterator>
#include <span>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "splat/render/render_backward.h"
#include "train/backend/view_pass.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 14;

/// On this processor, with native/splat and train/optimiser/image_loss.
class CpuViewPass final : public ViewPass {
 public:
  CpuViewPass();

  void forward(const SplatCloud& cloud, const Camera& camera, const RenderOptions& options,
               Progress* progress = nullptr) override;
  ImageLossValue loss(std::span<const float> target, std::span<const float> weights,
                      const ImageLossOptions& options) override;
  void setLossGradient(std::span<const float> gradient) override;
  BackwardSummary backward(const StatisticRequest& request, double transmittance_weight = 0,
                           Progress* progress = nullptr) override;
  ShownWeights shownWeights(Progress* progress = nullptr) override;
  std::span<const float> image() override;
  std::span<const float> statistic(Statistic statistic) override;
  void swapGradients(SplatCloud& gradients) override;
  void lendStatistics(ViewStatistics& statistics) override;
  void forget() override { stage_ = Stage::kSplats; }
  uint64_t memoryBytes() const override;

 private:
  /// What has been done since the splats changed last; each pass needs the one before it.
  enum class Stage { kSplats, kDrawn, kLoss, kGradients };
  void requireStage(Stage least, const char* message) const;
  SplatGradients& gradients() { return backward_.instances[0]; }

  std::span<const float> errorsOf(const StatisticRequest& request);
  std::span<const float> residual();
  double meanTransmittance() const;

  Stage stage_ = Stage::kSplats;
  const SplatCloud* cloud_ = nullptr;
  const Camera* camera_ = nullptr;
  RenderWorkspace workspace_;
  RenderResult drawn_;
  ImageLoss loss_;
  double loss_value_ = 0;
  std::span<const float> target_;         ///< [H,W,3] of the last loss
  std::span<const float> weights_;        ///< [H,W] the same
  std::span<const float> loss_gradient_;  ///< [H,W,4] of the last loss, or the caller's
  bool has_error_maps_ = false;           ///< whether the last backward pass was asked for them
  bool has_drawn_splats_ = false;         ///< the same
  std::vector<float> own_gradient_;       ///< [H,W,4]
  std::vector<float> residual_;           ///< [H,W,3]
  std::vector<float> made_errors_;        ///< [H,W] of StatisticRequest::errors_of
  BackwardWorkspace workspace_of_backward_;
  BackwardResult backward_;
  std::vector<uint8_t> visible_;  ///< [N]
  std::vector<float> unhidden_;   ///< [N]
};

CpuViewPass::CpuViewPass() {
  workspace_.keepForBackward(true);
}

void CpuViewPass::forward(const SplatCloud& cloud, const Camera& camera,
                          const RenderOptions& options, Progress* progress) {
  stage_ = Stage::kSplats;  // of an image that fails half-way nothing may be used
  cloud_ = &cloud;
  camera_ = &camera;
  const SplatInstance instance{&cloud};
  renderTiled({&instance, 1}, camera, options, workspace_, drawn_, progress);
  stage_ = Stage::kDrawn;
}

ImageLossValue CpuViewPass::loss(std::span<const float> target, std::span<const float> weights,
                                 const ImageLossOptions& options) {
  requireStage(Stage::kDrawn, "a loss needs an image; call forward first");
  const size_t pixel_count = size_t{drawn_.width} * drawn_.height;
  requireCount(target.size(), pixel_count * 3, "the target");
  if (!weights.empty()) requireCount(weights.size(), pixel_count, "weights");
  stage_ = Stage::kDrawn;
  own_gradient_.resize(pixel_count * 4);
  const ImageLossValue value =
      loss_.evaluate(drawn_.width, drawn_.height, {drawn_.colour.data(), PixelLayout::kRgba},
                     {target.data(), PixelLayout::kRgb}, weights.empty() ? nullptr : weights.data(),
                     {own_gradient_.data(), PixelLayout::kRgba}, options);
  target_ = target;
  weights_ = weights;
  loss_gradient_ = own_gradient_;
  loss_value_ = value.loss;
  stage_ = Stage::kLoss;
  return value;
}

void CpuViewPass::setLossGradient(std::span<const float> gradient) {
  requireStage(Stage::kDrawn, "a derivative needs an image; call forward first");
  target_ = weights_ = {};
  loss_gradient_ = gradient;
  loss_value_ = 0;
  stage_ = Stage::kLoss;
}

BackwardSummary CpuViewPass::backward(const StatisticRequest& request, double transmittance_weight,
                                      Progress* progress) {
  requireStage(Stage::kLoss, "derivatives need a loss of the image; call loss first");
  const size_t pixel_count = size_t{drawn_.width} * drawn_.height;
  BackwardInput input;
  input.colour_gradient = loss_gradient_;
  if (request.contributions) {
    input.residual = residual();
    input.residual_weights = weights_;
  }
  input.edge_weights = request.edge_weights;
  input.errors = errorsOf(request);
  if (request.error_maps) {
    requireCount(loss_.structureErrors().size(), pixel_count, "the loss's error map");
  }
  input.with_blending_weights = request.blending_weights;
  input.with_screen_gradients = request.screen_gradients;
  input.with_absolute_screen_gradients = request.absolute_screen_gradients;
  input.with_covered = request.covered;
  double regularisation = 0;
  if (transmittance_weight != 0) {
    regularisation = transmittance_weight * meanTransmittance();
    input.coverage_gradient =
        -transmittance_weight / static_cast<double>(drawn_.transmittance.size());
  }
  stage_ = Stage::kLoss;
  renderBackward(workspace_, drawn_, input, workspace_of_backward_, backward_, UINT64_MAX,
                 progress);
  has_error_maps_ = request.error_maps;
  has_drawn_splats_ = request.drawn_splats;
  stage_ = Stage::kGradients;
  return {backward_.camera, backward_.background, backward_.visible_count, regularisation};
}

ShownWeights CpuViewPass::shownWeights(Progress* progress) {
  requireStage(Stage::kDrawn, "weights need an image; call forward first");
  stage_ = Stage::kDrawn;
  BackwardInput input;
  input.with_blending_weights = true;
  renderBackward(workspace_, drawn_, input, workspace_of_backward_, backward_, UINT64_MAX,
                 progress);
  unhiddenWeights(workspace_, unhidden_);
  return {gradients().blending_weights, unhidden_};
}

std::span<const float> CpuViewPass::image() {
  requireStage(Stage::kDrawn, "there is no image; call forward first");
  return drawn_.colour;
}

std::span<const float> CpuViewPass::statistic(Statistic statistic) {
  requireStage(Stage::kGradients, "there are no statistics; call backward first");
  return gradients().*arrayOf(statistic).values;
}

void CpuViewPass::swapGradients(SplatCloud& gradients) {
  requireStage(Stage::kGradients, "there are no derivatives; call backward first");
  SplatGradients& by = backward_.instances[0];
  gradients.positions.swap(by.positions);
  gradients.rotations.swap(by.rotations);
  gradients.scales.swap(by.scales);
  gradients.opacities.swap(by.opacities);
  gradients.sh.swap(by.sh);
}

void CpuViewPass::lendStatistics(ViewStatistics& statistics) {
  requireStage(Stage::kGradients, "there are no statistics; call backward first");
  visibleFlags(workspace_, visible_);
  const size_t view = statistics.view;
  statistics = {};
  statistics.view = view;
  statistics.width = drawn_.width;
  statistics.height = drawn_.height;
  statistics.camera = camera_;
  statistics.loss = loss_value_;
  statistics.visible = visible_;
  for (size_t i = 0; i < kStatisticCount; ++i) {
    statistics.arrays[i] = gradients().*arrayOf(static_cast<Statistic>(i)).values;
  }
  if (has_drawn_splats_) {
    statistics.splats = {cloud_->positions, cloud_->rotations, cloud_->scales, cloud_->opacities};
  }
  if (has_error_maps_) {
    statistics.errors = {drawn_.width,  drawn_.height, loss_.structureErrors(),
                         drawn_.colour, target_,       weights_};
  }
}

uint64_t CpuViewPass::memoryBytes() const {
  uint64_t floats = drawn_.colour.capacity() + own_gradient_.capacity() + residual_.capacity() +
                    made_errors_.capacity() + visible_.capacity() / sizeof(float) +
                    unhidden_.capacity();
  for (const SplatGradients& gradients : backward_.instances) {
    for (const GradientArray& array : kGradientArrays) {
      floats += (gradients.*array.values).capacity();
    }
  }
  return floats * sizeof(float) + workspace_.bytes() + loss_.workspaceBytes();
}

void CpuViewPass::requireStage(Stage least, const char* message) const {
  if (stage_ < least) fail(ErrorCode::kInvalidArgument, message);
}

std::span<const float> CpuViewPass::errorsOf(const StatisticRequest& request) {
  const int ways = (request.errors_of ? 1 : 0) + (request.structure_errors ? 1 : 0) +
                   (request.errors.empty() ? 0 : 1);
  if (ways > 1) {
    fail(ErrorCode::kInvalidArgument,
         "errors are asked for in " + std::to_string(ways) + " ways; one of them is allowed");
  }
  if (request.errors_of) {
    made_errors_ = request.errors_of(
        {drawn_.width, drawn_.height, loss_.structureErrors(), drawn_.colour, target_, weights_});
    requireCount(made_errors_.size(), drawn_.colour.size() / 4, "the map of errors");
    return made_errors_;
  }
  if (!request.structure_errors) return request.errors;
  const std::span<const float> errors = loss_.structureErrors();
  if (errors.empty()) {
    fail(ErrorCode::kInvalidArgument,
         "structure errors are asked for; the loss must be one with structure errors");
  }
  return errors;
}

/// Image minus target, [H,W,3].
std::span<const float> CpuViewPass::residual() {
  if (target_.empty()) {
    fail(ErrorCode::kInvalidArgument,
         "contributions are asked for; they need a loss against a target");
  }
  residual_.resize(target_.size());
  parallelFor(target_.size() / 3, kGrain, [&](size_t begin, size_t end) {
    for (size_t pixel = begin; pixel < end; ++pixel) {
      for (size_t c = 0; c < 3; ++c) {
        residual_[pixel * 3 + c] = drawn_.colour[pixel * 4 + c] - target_[pixel * 3 + c];
      }
    }
  });
  return residual_;
}

double CpuViewPass::meanTransmittance() const {
  if (drawn_.transmittance.empty()) {
    fail(ErrorCode::kInvalidArgument,
         "the loss has the mean transmittance; the image must be drawn with it");
  }
  double sum = 0;
  for (const float value : drawn_.transmittance) sum += static_cast<double>(value);
  return sum / static_cast<double>(drawn_.transmittance.size());
}

}  // namespace

std::unique_ptr<ViewPass> makeCpuViewPass() {
  return std::make_unique<CpuViewPass>();
}

}  // namespace stipple
