#include <algorithm>
#include <cstddef>
#include <iterator>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "splat/render_backward.h"
#include "train/render_backend.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 14;
constexpr uint32_t kMaxSide = 65536;

struct Target {
  uint32_t width;
  uint32_t height;
  std::vector<float> pixels;  ///< [H,W,3]
};

/// What has been done since the splats changed last; each pass needs the one before it.
enum class Stage { kSplats, kDrawn, kLoss, kGradients };

/// The arrays of Statistic, in its order.
constexpr const GradientArray* kStatistics =
    std::find_if(std::begin(kGradientArrays), std::end(kGradientArrays),
                 [](const GradientArray& array) { return array.is_statistic; });
static_assert(std::end(kGradientArrays) - kStatistics ==
              static_cast<ptrdiff_t>(Statistic::kLargestErrors) + 1);

/// Arrays of one checkpoint, which must belong together.
void requireLike(const RawSplats& splats, const RawSplats& others, const char* what) {
  SplatEdit as_edit;  // holds arrays to each other, and every number to be finite
  as_edit.append = others;
  validate(as_edit, splats);
  if (others.size() != splats.size()) {
    fail(ErrorCode::kInvalidArgument, std::string(what) + " are of " +
                                          std::to_string(others.size()) + " splats; there are " +
                                          std::to_string(splats.size()));
  }
}

class CpuBackend final : public RenderBackend {
 public:
  CpuBackend() { workspace_.keepForBackward(true); }

  const char* name() const override { return "cpu"; }

  void upload(const SplatCloud& cloud) override {
    validate(cloud, "splats");
    RawSplats raw = rawSplats(cloud);
    RawSplats zeros = zerosLike(raw);
    hold({std::move(raw), zeros, std::move(zeros), 0});
  }

  void restore(const TrainingState& state) override {
    if (state.splats.sh_degree < 0 || state.splats.sh_degree > kMaxShDegree) {
      fail(ErrorCode::kInvalidArgument,
           "harmonic degree is " + std::to_string(state.splats.sh_degree) + "; 0 to 4 is allowed");
    }
    requireLike(state.splats, state.splats, "splats");
    requireLike(state.splats, state.first_moments, "first moments");
    requireLike(state.splats, state.second_moments, "second moments");
    hold(state);
  }

  size_t splatCount() const override { return held_.splats.size(); }
  SplatCloud download() const override { return activated(held_.splats); }
  TrainingState state() const override { return held_; }

  uint32_t addTarget(uint32_t width, uint32_t height, std::span<const float> pixels) override {
    const size_t needed = static_cast<size_t>(width) * height * 3;
    if (width < 1 || height < 1 || width > kMaxSide || height > kMaxSide) {
      fail(ErrorCode::kInvalidArgument, "the target is " + std::to_string(width) + " x " +
                                            std::to_string(height) +
                                            " pixels; each side must be 1 to 65536");
    }
    requireCount(pixels.size(), needed, "the target");
    requireFinite(pixels.data(), needed, 3, "target: pixel");
    targets_.push_back({width, height, {pixels.begin(), pixels.end()}});
    return static_cast<uint32_t>(targets_.size() - 1);
  }

  void forward(const Camera& camera, const RenderOptions& options, Progress* progress) override {
    activate();
    stage_ = Stage::kSplats;  // of a picture that fails half-way nothing may be used
    const Lent lent(*this);
    const SplatInstance instance{&cloud_};
    renderTiled({&instance, 1}, camera, options, workspace_, picture_, progress);
    stage_ = Stage::kDrawn;
  }

  ImageLossValue loss(uint32_t target, const ImageLossOptions& options,
                      std::span<const float> weights) override {
    requireStage(Stage::kDrawn, "a loss needs a picture; call forward first");
    if (target >= targets_.size()) {
      fail(ErrorCode::kInvalidArgument, "target is " + std::to_string(target) + "; there are " +
                                            std::to_string(targets_.size()));
    }
    const Target& wanted = targets_[target];
    if (wanted.width != picture_.width || wanted.height != picture_.height) {
      fail(ErrorCode::kInvalidArgument,
           "target " + std::to_string(target) + " is " + std::to_string(wanted.width) + " x " +
               std::to_string(wanted.height) + " pixels; the picture is " +
               std::to_string(picture_.width) + " x " + std::to_string(picture_.height));
    }
    const size_t pixel_count = static_cast<size_t>(wanted.width) * wanted.height;
    if (!weights.empty()) requireCount(weights.size(), pixel_count, "weights");
    stage_ = Stage::kDrawn;
    colour_gradient_.resize(pixel_count * 4);
    const ImageLossValue value = image_loss_.evaluate(
        wanted.width, wanted.height, {picture_.colour.data(), PixelLayout::kRgba},
        {wanted.pixels.data(), PixelLayout::kRgb}, weights.empty() ? nullptr : weights.data(),
        {colour_gradient_.data(), PixelLayout::kRgba}, options);
    target_ = target;
    stage_ = Stage::kLoss;
    return value;
  }

  BackwardSummary backward(const BackwardRequest& request, Progress* progress) override {
    requireStage(Stage::kLoss, "derivatives need a loss of the picture; call loss first");
    BackwardInput input;
    input.colour_gradient = colour_gradient_;
    if (request.with_contributions) {
      subtractTarget();
      input.residual = residual_;
      input.residual_weights = request.contribution_weights;
    }
    input.edge_weights = request.edge_weights;
    input.errors = request.errors;
    input.with_blending_weights = request.with_blending_weights;
    input.with_screen_gradients = request.with_screen_gradients;
    stage_ = Stage::kLoss;
    const Lent lent(*this);
    renderBackward(workspace_, picture_, input, backward_workspace_, gradients_, UINT64_MAX,
                   progress);
    throughActivations();
    stage_ = Stage::kGradients;
    return {gradients_.camera, gradients_.background, gradients_.visible_count};
  }

  void step(const StepOptions& options) override {
    requireStage(Stage::kGradients, "a step needs derivatives; call backward first");
    SplatGradients& by = gradients_.instances[0];
    constexpr size_t kFirst = 3;  // numbers of the constant harmonic
    std::vector<AdamGroup> groups;
    const auto add = [&](ParameterGroup group, RawArray array, const std::vector<float>& gradients,
                         size_t offset, size_t length) {
      const double rate = options.learning_rates[static_cast<size_t>(group)];
      if (rate == 0 || splatCount() == 0 || length == 0) return;
      groups.push_back({arrayOf(held_.splats, array).data() + offset, gradients.data() + offset,
                        arrayOf(held_.first_moments, array).data() + offset,
                        arrayOf(held_.second_moments, array).data() + offset, splatCount(), length,
                        rate, rowLength(held_.splats, array)});
    };
    add(ParameterGroup::kPositions, RawArray::kPositions, by.positions, 0, 3);
    add(ParameterGroup::kRotations, RawArray::kRotations, by.rotations, 0, 4);
    add(ParameterGroup::kLogScales, RawArray::kLogScales, by.scales, 0, 3);
    add(ParameterGroup::kLogits, RawArray::kLogits, by.opacities, 0, 1);
    add(ParameterGroup::kShFirst, RawArray::kSh, by.sh, 0, kFirst);
    add(ParameterGroup::kShOthers, RawArray::kSh, by.sh, kFirst, held_.splats.shStride() - kFirst);
    adamStep(groups, held_.step + 1, options.adam);
    ++held_.step;
    changed();
  }

  void edit(const SplatEdit& edit) override {
    validate(edit, held_.splats);
    TrainingState next = held_;  // so that a failure half-way changes nothing
    applyEdit(edit, false, next.splats);
    applyEdit(edit, true, next.first_moments);
    applyEdit(edit, true, next.second_moments);
    held_ = std::move(next);
    changed();
  }

  std::vector<float> picture() const override {
    requireStage(Stage::kDrawn, "there is no picture; call forward first");
    return picture_.colour;
  }

  RawSplats gradients() const override {
    requireStage(Stage::kGradients, "there are no derivatives; call backward first");
    const SplatGradients& by = gradients_.instances[0];
    RawSplats raw = zerosLike(held_.splats);
    raw.positions = by.positions;
    raw.rotations = by.rotations;
    raw.log_scales = by.scales;
    raw.logits = by.opacities;
    raw.sh = by.sh;
    return raw;
  }

  std::vector<float> statistic(Statistic statistic) const override {
    requireStage(Stage::kGradients, "there are no statistics; call backward first");
    const GradientArray& array = kStatistics[static_cast<size_t>(statistic)];
    const std::vector<float>& seen = gradients_.instances[0].*array.values;
    if (seen.empty() && splatCount() > 0) {
      fail(ErrorCode::kInvalidArgument,
           std::string(array.name) + " were not asked for in the last backward pass");
    }
    return seen;
  }

 private:
  /// Positions, rotations and harmonics are the same numbers raw and stored: while splats are
  /// drawn, the cloud has the arrays.
  class Lent {
   public:
    explicit Lent(CpuBackend& backend) : backend_(backend) { exchange(); }
    ~Lent() { exchange(); }
    Lent(const Lent&) = delete;
    Lent& operator=(const Lent&) = delete;

   private:
    void exchange() {
      backend_.cloud_.positions.swap(backend_.held_.splats.positions);
      backend_.cloud_.rotations.swap(backend_.held_.splats.rotations);
      backend_.cloud_.sh.swap(backend_.held_.splats.sh);
    }
    CpuBackend& backend_;
  };

  static void requireCount(size_t seen, size_t needed, const char* what) {
    if (seen != needed) {
      fail(ErrorCode::kInvalidArgument, std::string(what) + " holds " + std::to_string(seen) +
                                            " values; " + std::to_string(needed) + " are needed");
    }
  }

  void requireStage(Stage least, const char* message) const {
    if (stage_ < least) fail(ErrorCode::kInvalidArgument, message);
  }

  void hold(TrainingState state) {
    held_ = std::move(state);
    cloud_ = {};
    cloud_.sh_degree = held_.splats.sh_degree;
    cloud_.colour_space = held_.splats.colour_space;
    cloud_.antialias = held_.splats.antialias;
    changed();
  }

  void changed() {
    is_activated_ = false;
    stage_ = Stage::kSplats;
  }

  void activate() {
    if (is_activated_) return;
    const RawSplats& raw = held_.splats;
    cloud_.scales.resize(raw.log_scales.size());
    cloud_.opacities.resize(raw.logits.size());
    parallelFor(raw.log_scales.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) cloud_.scales[i] = activatedScale(raw.log_scales[i]);
    });
    parallelFor(raw.logits.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) cloud_.opacities[i] = activatedOpacity(raw.logits[i]);
    });
    is_activated_ = true;
  }

  /// Derivatives by stored scales and opacities become those by raw ones.
  void throughActivations() {
    SplatGradients& by = gradients_.instances[0];
    parallelFor(by.scales.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) by.scales[i] *= cloud_.scales[i];
    });
    parallelFor(by.opacities.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        by.opacities[i] *= cloud_.opacities[i] * (1.0f - cloud_.opacities[i]);
      }
    });
  }

  void subtractTarget() {
    const std::vector<float>& target = targets_[target_].pixels;
    residual_.resize(target.size());
    parallelFor(target.size() / 3, kGrain, [&](size_t begin, size_t end) {
      for (size_t pixel = begin; pixel < end; ++pixel) {
        for (size_t c = 0; c < 3; ++c) {
          residual_[pixel * 3 + c] = picture_.colour[pixel * 4 + c] - target[pixel * 3 + c];
        }
      }
    });
  }

  TrainingState held_;
  SplatCloud cloud_;  ///< stored scales and opacities; the rest only while it is drawn
  bool is_activated_ = false;
  std::vector<Target> targets_;

  Stage stage_ = Stage::kSplats;
  RenderWorkspace workspace_;
  RenderResult picture_;
  ImageLoss image_loss_;
  uint32_t target_ = 0;
  std::vector<float> colour_gradient_;  ///< [H,W,4]
  std::vector<float> residual_;         ///< [H,W,3]
  BackwardWorkspace backward_workspace_;
  BackwardResult gradients_;  ///< by raw scales and opacities once a pass is done
};

}  // namespace

std::unique_ptr<RenderBackend> makeCpuBackend() {
  return std::make_unique<CpuBackend>();
}

}  // namespace stipple
