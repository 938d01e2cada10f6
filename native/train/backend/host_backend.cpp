#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "splat/render/render_backward.h"
#include "train/backend/render_backend.h"
#include "train/optimiser/splat_activation.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 14;
constexpr uint32_t kMaxSide = 65536;

struct Target {
  uint32_t width;
  uint32_t height;
  std::vector<float> pixels;  ///< [H,W,3]
};

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

class HostBackend final : public RenderBackend {
 public:
  explicit HostBackend(std::unique_ptr<ViewPass> pass) : pass_(std::move(pass)) {}

  void upload(const SplatCloud& cloud) override {
    validate(cloud, "splats");
    RawSplats raw = rawSplats(cloud);
    RawSplats zeros = zerosLike(raw);
    hold({std::move(raw), zeros, std::move(zeros), {}, 0});
  }

  void restore(const TrainingState& state) override {
    if (state.splats.sh_degree < 0 || state.splats.sh_degree > kMaxShDegree) {
      fail(ErrorCode::kInvalidArgument,
           "harmonic degree is " + std::to_string(state.splats.sh_degree) + "; 0 to 4 is allowed");
    }
    requireLike(state.splats, state.splats, "splats");
    requireLike(state.splats, state.first_moments, "first moments");
    requireLike(state.splats, state.second_moments, "second moments");
    if (state.kept_gradients.size() > 0) {
      requireLike(state.splats, state.kept_gradients, "kept gradients");
    }
    hold(state);
  }

  void parameterise(const Parameterisation* how) override {
    if (how != how_) by_raw_ = {};  // the same at another time keeps its room
    how_ = how;
    changed();
  }

  size_t splatCount() const override { return held_.splats.size(); }
  SplatCloud download() const override {
    SplatCloud cloud = activated(held_.splats);
    if (how_) how_->activate(held_.splats, cloud);
    return cloud;
  }
  const TrainingState& state() const override { return held_; }
  const RawSplats& splats() const override { return held_.splats; }
  const RawSplats& firstMoments() const override { return held_.first_moments; }
  const RawSplats& secondMoments() const override { return held_.second_moments; }

  uint64_t memoryBytes() const override {
    uint64_t floats = cloud_.scales.capacity() + cloud_.opacities.capacity() + factors_.capacity() +
                      aside_.capacity();
    for (const auto* values :
         {&by_.positions, &by_.rotations, &by_.scales, &by_.opacities, &by_.sh}) {
      floats += values->capacity();
    }
    for (const RawSplats* splats : {&held_.splats, &held_.first_moments, &held_.second_moments,
                                    &held_.kept_gradients, &by_raw_}) {
      for (size_t i = 0; i < arrayCount(*splats); ++i) {
        floats += arrayOf(*splats, static_cast<RawArray>(i)).capacity();
      }
    }
    for (const Target& target : targets_) floats += target.pixels.capacity();
    return floats * sizeof(float) + pass_->memoryBytes();
  }

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

  void weighOpacities(std::vector<float> factors) override {
    if (!factors.empty()) requireCount(factors.size(), splatCount(), "opacity factors");
    for (size_t i = 0; i < factors.size(); ++i) {
      if (factors[i] >= 0 && std::isfinite(factors[i])) continue;
      fail(ErrorCode::kInvalidArgument, "the opacity factor of splat " + std::to_string(i) +
                                            " is " + std::to_string(factors[i]) +
                                            "; 0 and more is allowed");
    }
    factors_ = std::move(factors);
  }

  void forward(const Camera& camera, const RenderOptions& options, Progress* progress) override {
    forget();  // an image that fails half-way is of no splats
    activate();
    weigh();
    const Lent lent(*this);
    pass_->forward(cloud_, camera, options, progress);
    width_ = camera.width;
    height_ = camera.height;
  }

  ImageLossValue loss(uint32_t target, const ImageLossOptions& options,
                      std::span<const float> weights) override {
    if (target >= targets_.size()) {
      fail(ErrorCode::kInvalidArgument, "target is " + std::to_string(target) + "; there are " +
                                            std::to_string(targets_.size()));
    }
    const Target& wanted = targets_[target];
    const bool is_drawn = width_ > 0;  // else the pass says what is missing
    if (is_drawn && (wanted.width != width_ || wanted.height != height_)) {
      fail(ErrorCode::kInvalidArgument,
           "target " + std::to_string(target) + " is " + std::to_string(wanted.width) + " x " +
               std::to_string(wanted.height) + " pixels; the image is " + std::to_string(width_) +
               " x " + std::to_string(height_));
    }
    return loss(wanted.pixels, options, weights);
  }

  ImageLossValue loss(std::span<const float> target, const ImageLossOptions& options,
                      std::span<const float> weights) override {
    takeBack();
    return pass_->loss(target, weights, options);
  }

  BackwardSummary backward(const StatisticRequest& request, Regulariser* regulariser,
                           Progress* progress) override {
    takeBack();
    const Lent lent(*this);
    BackwardSummary summary =
        pass_->backward(request, regulariser ? regulariser->transmittanceWeight() : 0.0, progress);
    pass_->swapGradients(by_);
    has_gradients_ = true;
    if (is_weighed_) weighGradients();
    if (regulariser && regulariser->readsSplats()) {
      summary.regularisation += regulariser->evaluate(cloud_, spansOf(by_));
    }
    if (how_) {
      throughActivations(held_.splats, cloud_, *how_, by_, by_raw_);
    } else {
      throughActivations(cloud_, by_);
    }
    are_kept_ = false;
    return summary;
  }

  void step(const StepOptions& options) override {
    requireGradients("a step needs derivatives; call backward first");
    // Those that were kept count, these too.
    if (held_.kept_gradients.size() > 0) addToKept();
    constexpr size_t kFirst = 3;  // numbers of the constant harmonic
    groups_.clear();
    addGroup(options, ParameterGroup::kPositions, RawArray::kPositions, 0, 3);
    addGroup(options, ParameterGroup::kRotations, RawArray::kRotations, 0, 4);
    addGroup(options, ParameterGroup::kLogScales, RawArray::kLogScales, 0, 3);
    addGroup(options, ParameterGroup::kLogits, RawArray::kLogits, 0, 1);
    addGroup(options, ParameterGroup::kShFirst, RawArray::kSh, 0, kFirst);
    addGroup(options, ParameterGroup::kShOthers, RawArray::kSh, kFirst,
             held_.splats.shStride() - kFirst);
    const size_t extra_count = how_ ? held_.splats.extra_lengths.size() : 0;
    for (size_t k = 0; k < std::min(extra_count, options.extra_rates.size()); ++k) {
      addGroup(options.extra_rates[k], extraArray(k), 0, held_.splats.extra_lengths[k]);
    }
    adamStep(groups_, held_.step + 1, options.adam);
    ++held_.step;
    held_.kept_gradients = {};
    changed();
  }

  void keepGradients() override {
    requireGradients("there are no derivatives to keep; call backward first");
    addToKept();
    forget();
  }

  void edit(const SplatEdit& edit) override {
    validate(edit, held_.splats);
    std::vector<EditTarget> targets = {
        {&held_.splats, false}, {&held_.first_moments, true}, {&held_.second_moments, true}};
    if (held_.kept_gradients.size() > 0) targets.push_back({&held_.kept_gradients, true});
    applyEdit(edit, targets);
    changed();
  }

  std::vector<float> picture() const override {
    const std::span<const float> image = pass_->image();
    return {image.begin(), image.end()};
  }

  RawSplats gradients() const override {
    requireGradients("there are no derivatives; call backward first");
    RawSplats raw = how_ ? by_raw_ : zerosLike(held_.splats);
    raw.sh = by_.sh;
    if (how_) return raw;
    raw.positions = by_.positions;
    raw.rotations = by_.rotations;
    raw.log_scales = by_.scales;
    raw.logits = by_.opacities;
    return raw;
  }

  std::vector<float> statistic(Statistic statistic) const override {
    const std::span<const float> seen = pass_->statistic(statistic);
    if (seen.empty() && splatCount() > 0) {
      fail(ErrorCode::kInvalidArgument,
           std::string(arrayOf(statistic).name) + " were not asked for in the last backward pass");
    }
    return {seen.begin(), seen.end()};
  }

  void lendStatistics(ViewStatistics& statistics) override {
    pass_->lendStatistics(statistics);
    if (statistics.splats.scales.empty()) return;
    // Without a parameterisation the cloud has these two only while it is drawn.
    statistics.splats.positions = held_.splats.positions;
    statistics.splats.rotations = held_.splats.rotations;
  }

 private:
  /// Positions, rotations and harmonics are the same numbers raw and stored: while splats are
  /// drawn, the cloud has the arrays. With a parameterisation it has positions and rotations of its
  /// own.
  class Lent {
   public:
    explicit Lent(HostBackend& backend) : backend_(backend) { exchange(); }
    ~Lent() { exchange(); }
    Lent(const Lent&) = delete;
    Lent& operator=(const Lent&) = delete;

   private:
    void exchange() {
      backend_.cloud_.sh.swap(backend_.held_.splats.sh);
      if (backend_.how_) return;
      backend_.cloud_.positions.swap(backend_.held_.splats.positions);
      backend_.cloud_.rotations.swap(backend_.held_.splats.rotations);
    }
    HostBackend& backend_;
  };

  void hold(TrainingState state) {
    held_ = std::move(state);
    cloud_ = {};
    cloud_.sh_degree = held_.splats.sh_degree;
    cloud_.colour_space = held_.splats.colour_space;
    cloud_.antialias = held_.splats.antialias;
    changed();
  }

  void changed() {
    forget();
    is_activated_ = false;
    factors_.clear();
  }

  /// Image and derivatives are of no splats that there are.
  void forget() {
    takeBack();
    pass_->forget();
    width_ = height_ = 0;
    if (is_weighed_) takeOpacitiesBack();
  }

  /// The opacities that there are go aside until derivatives are known.
  void weigh() {
    if (factors_.empty()) return;
    aside_.resize(factors_.size());
    parallelFor(factors_.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const float opacity = cloud_.opacities[i];
        aside_[i] = std::min(opacity * factors_[i], 1.0f);
        factors_[i] = opacity > 0 ? aside_[i] / opacity : factors_[i];
      }
    });
    cloud_.opacities.swap(aside_);
    is_weighed_ = true;
  }

  /// Derivatives by weighed opacities become those by the ones that there are.
  void weighGradients() {
    parallelFor(factors_.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) by_.opacities[i] *= factors_[i];
    });
    takeOpacitiesBack();
  }

  void takeOpacitiesBack() {
    cloud_.opacities.swap(aside_);
    factors_.clear();
    is_weighed_ = false;
  }

  /// The pass gets its arrays again before it is asked for others.
  void takeBack() {
    if (has_gradients_) pass_->swapGradients(by_);
    has_gradients_ = false;
  }

  void requireGradients(const char* message) const {
    if (!has_gradients_) fail(ErrorCode::kInvalidArgument, message);
  }

  void activate() {
    if (is_activated_) return;
    if (how_) {
      activateWith(held_.splats, *how_, cloud_);
    } else {
      activateShapes(held_.splats, cloud_);
    }
    is_activated_ = true;
  }

  /// Derivatives by an array of the raw splats, of the last backward pass.
  std::span<const float> lastGradient(RawArray array) const {
    if (how_ && array != RawArray::kSh) return arrayOf(by_raw_, array);
    const std::vector<float>* const arrays[] = {&by_.positions, &by_.rotations, &by_.scales,
                                                &by_.opacities, &by_.sh};
    return *arrays[static_cast<size_t>(array)];
  }

  void addGroup(const StepOptions& options, ParameterGroup group, RawArray array, size_t offset,
                size_t length) {
    addGroup(options.learning_rates[static_cast<size_t>(group)], array, offset, length);
  }

  void addGroup(double rate, RawArray array, size_t offset, size_t length) {
    if (rate == 0 || splatCount() == 0 || length == 0) return;
    const float* gradients = held_.kept_gradients.size() > 0
                                 ? arrayOf(held_.kept_gradients, array).data()
                                 : lastGradient(array).data();
    groups_.push_back({arrayOf(held_.splats, array).data() + offset, gradients + offset,
                       arrayOf(held_.first_moments, array).data() + offset,
                       arrayOf(held_.second_moments, array).data() + offset, splatCount(), length,
                       rate, rowLength(held_.splats, array)});
  }

  /// Adds the derivatives of the last backward pass to the kept ones, once.
  void addToKept() {
    if (are_kept_) return;
    if (held_.kept_gradients.size() == 0) held_.kept_gradients = zerosLike(held_.splats);
    for (size_t i = 0; i < (how_ ? arrayCount(held_.splats) : kRawArrayCount); ++i) {
      const RawArray array = static_cast<RawArray>(i);
      const std::span<const float> last = lastGradient(array);
      float* sums = arrayOf(held_.kept_gradients, array).data();
      parallelFor(last.size(), kGrain, [&](size_t begin, size_t end) {
        for (size_t k = begin; k < end; ++k) sums[k] += last[k];
      });
    }
    are_kept_ = true;
  }

  TrainingState held_;
  SplatCloud cloud_;  ///< stored scales and opacities; the rest only while it is drawn
  bool is_activated_ = false;
  const Parameterisation* how_ = nullptr;
  std::vector<Target> targets_;

  std::unique_ptr<ViewPass> pass_;
  std::vector<float> factors_;  ///< of the opacities of the next image, or the one that is drawn
  std::vector<float> aside_;    ///< opacities without them, while is_weighed_
  bool is_weighed_ = false;
  uint32_t width_ = 0, height_ = 0;  ///< drawn last; 0: nothing of the splats that there are
  SplatCloud by_;                    ///< derivatives; scales and opacities are raw without how_
  bool has_gradients_ = false;       ///< by_ has arrays of the pass
  RawSplats by_raw_;                 ///< with how_
  bool are_kept_ = false;            ///< whether the last derivatives are among the kept ones
  std::vector<AdamGroup> groups_;
};

}  // namespace

std::unique_ptr<RenderBackend> makeHostBackend(std::unique_ptr<ViewPass> pass) {
  return std::make_unique<HostBackend>(std::move(pass));
}

std::unique_ptr<RenderBackend> makeCpuBackend() {
  return makeHostBackend(makeCpuViewPass());
}

}  // namespace stipple
