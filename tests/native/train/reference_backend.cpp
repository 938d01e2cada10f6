#include "reference_backend.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "base/error.h"
#include "splat/reference_backward.h"

namespace stipple::testing {

namespace {

constexpr float kPoison = std::numeric_limits<float>::quiet_NaN();
using Doubles = std::vector<double>;

[[noreturn]] void refuse(const char* what) {
  fail(ErrorCode::kInvalidArgument, std::string("the reference does not know ") + what);
}

void poison(std::vector<float>& values) {
  std::fill(values.begin(), values.end(), kPoison);
}

std::vector<float> rounded(const Doubles& values) {
  return {values.begin(), values.end()};
}

/// The loss of image_loss.h and its derivative by the image, from the textbook's formulas.
class DoubleLoss {
 public:
  DoubleLoss(uint32_t width, uint32_t height, const Doubles& rgba, std::span<const float> target,
             std::span<const float> weights)
      : width_(width), height_(height), rgba_(rgba), target_(target), weights_(weights) {
    double total = 0;
    for (int k = 0; k < 11; ++k) total += window_[k] = std::exp(-(k - 5) * (k - 5) / 4.5);
    for (double& value : window_) value /= total;
  }

  ImageLossValue evaluate(double share, Doubles& gradient) const {
    const size_t pixel_count = size_t{width_} * height_;
    gradient.assign(pixel_count * 4, 0.0);
    double sum = 0;
    for (size_t p = 0; p < pixel_count; ++p) sum += weightAt(p);
    const double unit = 1 / (3 * sum);
    ImageLossValue value;
    value.ssim = 0;
    for (size_t c = 0; c < 3; ++c) {
      Doubles by_mean(pixel_count), by_square(pixel_count), by_product(pixel_count);
      for (size_t p = 0; p < pixel_count; ++p) {
        value.ssim += unit * similarityAt(p, c, -share * unit, by_mean, by_square, by_product);
        const double difference = imageAt(p, c) - targetAt(p, c);
        value.l1 += unit * weightAt(p) * std::abs(difference);
        const double sign = difference > 0 ? 1.0 : difference < 0 ? -1.0 : 0.0;
        gradient[p * 4 + c] += (1 - share) * unit * weightAt(p) * sign;
      }
      for (size_t p = 0; p < pixel_count; ++p) {
        aroundEach(p, [&](size_t q, double w) {
          gradient[p * 4 + c] +=
              w * (by_mean[q] + 2 * imageAt(p, c) * by_square[q] + targetAt(p, c) * by_product[q]);
        });
      }
    }
    value.loss = (1 - share) * value.l1 + share * (1 - value.ssim);
    return value;
  }

 private:
  double weightAt(size_t p) const {
    return weights_.empty() ? 1.0 : static_cast<double>(weights_[p]);
  }
  double imageAt(size_t p, size_t c) const { return rgba_[p * 4 + c]; }
  double targetAt(size_t p, size_t c) const { return static_cast<double>(target_[p * 3 + c]); }

  template <typename Visit>
  void aroundEach(size_t p, const Visit& visit) const {
    const long x = static_cast<long>(p % width_), y = static_cast<long>(p / width_);
    for (long j = -5; j <= 5; ++j) {
      for (long i = -5; i <= 5; ++i) {
        if (y + j < 0 || x + i < 0 || y + j >= height_ || x + i >= width_) continue;
        visit(static_cast<size_t>((y + j) * width_ + x + i), window_[j + 5] * window_[i + 5]);
      }
    }
  }

  /// Weighted similarity of a pixel, and its derivatives by the window's sums, times `factor`.
  double similarityAt(size_t p, size_t c, double factor, Doubles& by_mean, Doubles& by_square,
                      Doubles& by_product) const {
    double mx = 0, my = 0, xx = 0, yy = 0, xy = 0;
    aroundEach(p, [&](size_t q, double w) {
      const double a = imageAt(q, c), b = targetAt(q, c);
      mx += w * a;
      my += w * b;
      xx += w * a * a;
      yy += w * b * b;
      xy += w * a * b;
    });
    const double c1 = 1e-4, c2 = 9e-4;
    const double a1 = 2 * mx * my + c1, a2 = 2 * (xy - mx * my) + c2;
    const double b1 = mx * mx + my * my + c1, b2 = xx - mx * mx + yy - my * my + c2;
    const double similarity = a1 * a2 / (b1 * b2), scale = factor * weightAt(p);
    by_mean[p] = scale * (2 * my * (a2 - a1) / (b1 * b2) - similarity * 2 * mx * (1 / b1 - 1 / b2));
    by_square[p] = -scale * similarity / b2;
    by_product[p] = scale * 2 * a1 / (b1 * b2);
    return weightAt(p) * similarity;
  }

  uint32_t width_, height_;
  const Doubles& rgba_;
  std::span<const float> target_, weights_;
  double window_[11];
};

class ReferenceImages final : public ImageRenderer {
 public:
  void render(std::span<const SplatInstance> instances, const Camera& camera,
              const RenderOptions& options, const RenderAccuracy&, RenderResult& result,
              Progress* progress) override {
    const ReferenceResult drawn = renderReference(instances, camera, options, progress);
    result = {};
    result.width = drawn.width;
    result.height = drawn.height;
    result.colour = rounded(drawn.colour);
    result.depth = rounded(drawn.depth);
  }
  void order(std::span<const SplatInstance> instances, const Camera& camera,
             const DrawOrderOutput& output, Progress* progress) override {
    DrawOrderWorkspace workspace;  // whole numbers: the definition is the code
    orderForDrawing(instances, camera, output, workspace, progress);
  }
  uint64_t memoryBytes() const override { return 0; }
};

class ReferencePass final : public ViewPass {
 public:
  void forward(const SplatCloud& cloud, const Camera& camera, const RenderOptions& options,
               Progress* progress) override {
    poisonCopies();
    for (const double value : options.background) {
      if (value != 0) refuse("backgrounds other than black");
    }
    cloud_ = cloud;  // the caller's may be gone where it lies elsewhere
    camera_ = &camera;
    options_ = options;
    const SplatInstance instance{&cloud_};
    image_ = renderReference({&instance, 1}, camera, options, progress).colour;
  }

  ImageLossValue loss(std::span<const float> target, std::span<const float> weights,
                      const ImageLossOptions& options) override {
    poisonCopies();
    target_.assign(target.begin(), target.end());
    weights_.assign(weights.begin(), weights.end());
    const DoubleLoss loss(camera_->width, camera_->height, image_, target_, weights_);
    const ImageLossValue value = loss.evaluate(options.ssim_share, gradient_);
    loss_ = value.loss;
    return value;
  }

  void setLossGradient(std::span<const float> gradient) override {
    poisonCopies();
    gradient_.assign(gradient.begin(), gradient.end());
    target_.clear();
    loss_ = 0;
  }

  BackwardSummary backward(const StatisticRequest& request, double transmittance_weight,
                           Progress*) override {
    poisonCopies();
    if (transmittance_weight != 0) refuse("losses of transmittance");
    if (request.screen_gradients || request.absolute_screen_gradients || request.covered ||
        request.structure_errors || request.error_maps || request.errors_of ||
        !request.errors.empty() || !request.edge_weights.empty()) {
      refuse("this statistic");
    }
    std::vector<float> residual(image_.size() / 4 * 3, 0.0f);
    for (size_t i = 0; i < target_.size(); ++i) {
      residual[i] = static_cast<float>(image_[i / 3 * 4 + i % 3] - static_cast<double>(target_[i]));
    }
    if (request.contributions && !weights_.empty()) refuse("contributions with masks");
    by_ = backwardReference(cloud_, *camera_, options_, rounded(gradient_), residual);
    const SplatInstance instance{&cloud_};
    visible_.assign(cloud_.size(), 0);
    for (const ReferenceSplat& splat :
         visibleInOrder(placeScene({&instance, 1}, *camera_, options_))) {
      visible_[splat.index] = 1;
    }
    request_ = request;
    BackwardSummary summary;
    summary.visible_count =
        static_cast<uint64_t>(std::count(visible_.begin(), visible_.end(), uint8_t{1}));
    return summary;
  }

  ShownWeights shownWeights(Progress*) override {
    poisonCopies();
    const std::vector<float> gradient(image_.size(), 0.0f);
    const std::vector<float> residual(image_.size() / 4 * 3, 0.0f);
    by_ = backwardReference(cloud_, *camera_, options_, gradient, residual);
    const SplatInstance instance{&cloud_};
    std::vector<float> unhidden(cloud_.size(), 0.0f);
    for (const ReferenceSplat& splat :
         visibleInOrder(placeScene({&instance, 1}, *camera_, options_))) {
      const Footprint<double>& f = splat.projected.footprint;
      unhidden[splat.index] =
          static_cast<float>(2 * std::numbers::pi * f.opacity / (f.l00 * f.l11));
    }
    return {copy(by_.blending_weights), copy(std::move(unhidden))};
  }

  std::span<const float> image() override { return copy(rounded(image_)); }
  std::span<const float> statistic(Statistic statistic) override {
    if (statistic == Statistic::kContributions && request_.contributions) {
      return copy(by_.contributions);
    }
    if (statistic == Statistic::kBlendingWeights && request_.blending_weights) {
      return copy(by_.blending_weights);
    }
    return {};
  }
  void swapGradients(SplatCloud& gradients) override {
    gradients.positions.swap(by_.positions);
    gradients.rotations.swap(by_.rotations);
    gradients.scales.swap(by_.scales);
    gradients.opacities.swap(by_.opacities);
    gradients.sh.swap(by_.sh);
  }
  void lendStatistics(ViewStatistics& statistics) override {
    const size_t view = statistics.view;
    statistics = {};
    statistics.view = view;
    statistics.width = camera_->width;
    statistics.height = camera_->height;
    statistics.camera = camera_;
    statistics.loss = loss_;
    statistics.visible = visible_;
    for (const Statistic one : {Statistic::kContributions, Statistic::kBlendingWeights}) {
      statistics.arrays[static_cast<size_t>(one)] = statistic(one);
    }
    const auto splats = [&](const std::vector<float>& values) {
      return copy(request_.drawn_splats ? values : std::vector<float>(values.size(), kPoison));
    };
    statistics.splats = {splats(cloud_.positions), splats(cloud_.rotations), splats(cloud_.scales),
                         splats(cloud_.opacities)};
  }
  void forget() override { poisonCopies(); }
  uint64_t memoryBytes() const override { return 0; }

  const SplatGradients& gradients() const { return by_; }
  void poisonCopies() {
    for (auto& values : copies_) poison(*values);
  }

 private:
  std::span<const float> copy(std::vector<float> values) {
    copies_.push_back(std::make_unique<std::vector<float>>(std::move(values)));
    return *copies_.back();
  }

  SplatCloud cloud_;
  const Camera* camera_ = nullptr;
  RenderOptions options_;
  Doubles image_, gradient_;  ///< [H,W,4]
  std::vector<float> target_, weights_;
  double loss_ = 0;
  StatisticRequest request_;
  SplatGradients by_;
  std::vector<uint8_t> visible_;
  std::vector<std::unique_ptr<std::vector<float>>> copies_;  ///< kept, so that NaN can be read
};

/// Arrays of RawSplats in double.
using DoubleSplats = std::array<Doubles, kRawArrayCount>;

class ReferenceBackend final : public RenderBackend {
 public:
  void upload(const SplatCloud& cloud) override {
    TrainingState state;
    state.splats = rawSplats(cloud);
    state.first_moments = state.second_moments = zerosLike(state.splats);
    restore(state);
  }
  void restore(const TrainingState& state) override {
    poisonCopies();
    if (!state.splats.extra_lengths.empty()) refuse("parameters of a strategy");
    shape_ = rowsOf(state.splats, {});
    count_ = state.splats.size();
    step_ = state.step;
    take(state.splats, raw_);
    take(state.first_moments, first_);
    take(state.second_moments, second_);
    has_kept_ = false;
  }
  void parameterise(const Parameterisation* how) override {
    if (how) refuse("parameterisations");
  }

  size_t splatCount() const override { return count_; }
  SplatCloud download() const override { return cloudOf(); }
  const TrainingState& state() const override {
    give(raw_, state_.splats);
    give(first_, state_.first_moments);
    give(second_, state_.second_moments);
    state_.kept_gradients = {};
    state_.step = step_;
    return state_;
  }
  const RawSplats& splats() const override { return give(raw_, splats_); }
  const RawSplats& firstMoments() const override { return give(first_, first_copy_); }
  const RawSplats& secondMoments() const override { return give(second_, second_copy_); }
  uint64_t memoryBytes() const override { return 0; }

  uint32_t addTarget(uint32_t, uint32_t, std::span<const float> pixels) override {
    poisonCopies();
    targets_.emplace_back(pixels.begin(), pixels.end());
    return static_cast<uint32_t>(targets_.size() - 1);
  }

  void weighOpacities(std::vector<float> factors) override { factors_ = std::move(factors); }
  void forward(const Camera& camera, const RenderOptions& options, Progress* progress) override {
    poisonCopies();
    cloud_ = cloudOf();
    drawn_factors_ = std::exchange(factors_, {});
    for (size_t i = 0; i < drawn_factors_.size(); ++i) {
      float& opacity = cloud_.opacities[i];
      drawn_factors_[i] = std::min(drawn_factors_[i], 1 / opacity);
      opacity = std::min(opacity * drawn_factors_[i], 1.0f);
    }
    pass_.forward(cloud_, camera, options, progress);
  }
  ImageLossValue loss(uint32_t target, const ImageLossOptions& options,
                      std::span<const float> weights) override {
    return loss(targets_.at(target), options, weights);
  }
  ImageLossValue loss(std::span<const float> target, const ImageLossOptions& options,
                      std::span<const float> weights) override {
    poisonCopies();
    return pass_.loss(target, weights, options);
  }
  BackwardSummary backward(const StatisticRequest& request, Regulariser* regulariser,
                           Progress* progress) override {
    poisonCopies();
    BackwardSummary summary =
        pass_.backward(request, regulariser ? regulariser->transmittanceWeight() : 0.0, progress);
    SplatGradients by = pass_.gradients();
    for (size_t i = 0; i < drawn_factors_.size(); ++i) by.opacities[i] *= drawn_factors_[i];
    if (regulariser && regulariser->readsSplats()) {
      lent_ = cloudOf();
      summary.regularisation += regulariser->evaluate(
          lent_, {by.positions, by.rotations, by.scales, by.opacities, by.sh});
      for (auto* values :
           {&lent_.positions, &lent_.rotations, &lent_.scales, &lent_.opacities, &lent_.sh}) {
        poison(*values);
      }
    }
    const auto assign = [](const std::vector<float>& from, Doubles& to) {
      to.assign(from.begin(), from.end());
    };
    assign(by.positions, by_raw_[0]);
    assign(by.rotations, by_raw_[1]);
    assign(by.scales, by_raw_[2]);
    assign(by.opacities, by_raw_[3]);
    assign(by.sh, by_raw_[4]);
    for (size_t i = 0; i < by_raw_[2].size(); ++i) by_raw_[2][i] *= std::exp(raw_[2][i]);
    for (size_t i = 0; i < by_raw_[3].size(); ++i) {
      const double opacity = 1 / (1 + std::exp(-raw_[3][i]));
      by_raw_[3][i] *= opacity * (1 - opacity);
    }
    return summary;
  }

  void step(const StepOptions& options) override {
    poisonCopies();
    if (has_kept_) keepGradients();
    const DoubleSplats& by = has_kept_ ? kept_ : by_raw_;
    ++step_;
    const double first_share = 1 - std::pow(options.adam.beta1, static_cast<double>(step_));
    const double second_share = 1 - std::pow(options.adam.beta2, static_cast<double>(step_));
    for (size_t array = 0; array < kRawArrayCount; ++array) {
      const size_t row = rowLength(shape_, static_cast<RawArray>(array));
      for (size_t i = 0; i < raw_[array].size(); ++i) {
        const bool is_higher = array == 4 && i % row >= 3;
        const double rate = options.learning_rates[array + (is_higher ? 1 : 0)];
        if (rate == 0) continue;
        double& m = first_[array][i];
        double& v = second_[array][i];
        m += (1 - options.adam.beta1) * (by[array][i] - m);
        v += (1 - options.adam.beta2) * (by[array][i] * by[array][i] - v);
        raw_[array][i] -=
            rate * (m / first_share) / (std::sqrt(v / second_share) + options.adam.epsilon);
      }
    }
    has_kept_ = false;
  }
  void keepGradients() override {
    poisonCopies();
    if (!has_kept_) kept_ = {};
    for (size_t array = 0; array < kRawArrayCount; ++array) {
      kept_[array].resize(by_raw_[array].size(), 0.0);
      for (size_t i = 0; i < kept_[array].size(); ++i) kept_[array][i] += by_raw_[array][i];
    }
    has_kept_ = true;
  }

  void edit(const SplatEdit& edit) override {
    TrainingState moved = state();
    validate(edit, moved.splats);
    const std::vector<EditTarget> targets = {
        {&moved.splats, false}, {&moved.first_moments, true}, {&moved.second_moments, true}};
    applyEdit(edit, targets);
    restore(moved);
  }

  std::vector<float> picture() const override {
    const auto image = const_cast<ReferencePass&>(pass_).image();
    return {image.begin(), image.end()};
  }
  RawSplats gradients() const override {
    RawSplats raw;
    return give(by_raw_, raw);
  }
  std::vector<float> statistic(Statistic statistic) const override {
    const auto values = const_cast<ReferencePass&>(pass_).statistic(statistic);
    return {values.begin(), values.end()};
  }
  void lendStatistics(ViewStatistics& statistics) override { pass_.lendStatistics(statistics); }

 private:
  void poisonCopies() {
    for (RawSplats* copy : {&state_.splats, &state_.first_moments, &state_.second_moments, &splats_,
                            &first_copy_, &second_copy_}) {
      for (size_t k = 0; k < kRawArrayCount; ++k) poison(arrayOf(*copy, static_cast<RawArray>(k)));
    }
    pass_.poisonCopies();
  }
  static void take(const RawSplats& from, DoubleSplats& to) {
    for (size_t k = 0; k < kRawArrayCount; ++k) {
      const std::vector<float>& values = arrayOf(from, static_cast<RawArray>(k));
      to[k].assign(values.begin(), values.end());
    }
  }
  RawSplats& give(const DoubleSplats& from, RawSplats& to) const {
    to.sh_degree = shape_.sh_degree;
    to.colour_space = shape_.colour_space;
    to.antialias = shape_.antialias;
    for (size_t k = 0; k < kRawArrayCount; ++k) {
      arrayOf(to, static_cast<RawArray>(k)) = rounded(from[k]);
    }
    return to;
  }
  /// Rounded once, where it is drawn.
  SplatCloud cloudOf() const {
    SplatCloud cloud;
    cloud.sh_degree = shape_.sh_degree;
    cloud.colour_space = shape_.colour_space;
    cloud.antialias = shape_.antialias;
    cloud.positions = rounded(raw_[0]);
    cloud.rotations = rounded(raw_[1]);
    for (const double x : raw_[2]) cloud.scales.push_back(static_cast<float>(std::exp(x)));
    for (const double x : raw_[3]) {
      cloud.opacities.push_back(static_cast<float>(1 / (1 + std::exp(-x))));
    }
    cloud.sh = rounded(raw_[4]);
    return cloud;
  }

  RawSplats shape_;  ///< no splats: degree, colour space and so on
  size_t count_ = 0;
  uint64_t step_ = 0;
  DoubleSplats raw_, first_, second_, by_raw_, kept_;
  bool has_kept_ = false;
  std::vector<std::vector<float>> targets_;
  SplatCloud cloud_, lent_;
  std::vector<float> factors_, drawn_factors_;
  ReferencePass pass_;
  // Copies for the host.
  mutable TrainingState state_;
  mutable RawSplats splats_, first_copy_, second_copy_;
};

}  // namespace

std::unique_ptr<ImageRenderer> ReferenceBackends::makeImageRenderer() const {
  ++images;
  return std::make_unique<ReferenceImages>();
}

std::unique_ptr<ViewPass> ReferenceBackends::makeViewPass() const {
  ++passes;
  return std::make_unique<ReferencePass>();
}

std::unique_ptr<RenderBackend> ReferenceBackends::makeRenderBackend() const {
  ++backends;
  return std::make_unique<ReferenceBackend>();
}

}  // namespace stipple::testing
