#include "train/optimiser/weight_optimiser.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "base/percentile.h"
#include "train/optimiser/adam.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 14;
/// Added to lengths before they divide.
constexpr double kNoLength = 1e-6;
/// What a gradient that is not finite takes from the log2 of the scale of losses.
constexpr double kScaleFall = 1;
constexpr double kMostScaleStart = 100;

void require(bool is_allowed, const char* name, double value, const char* allowed) {
  if (is_allowed) return;
  fail(ErrorCode::kInvalidArgument, std::string("the ") + name + " is " + std::to_string(value) +
                                        "; " + allowed + " is allowed");
}

double normOf(std::span<const float> gradient) {
  std::vector<double> parts(rangeCount(gradient.size(), kGrain));
  parallelFor(gradient.size(), kGrain, [&](size_t begin, size_t end) {
    double sum = 0;
    for (size_t i = begin; i < end; ++i) {
      sum += static_cast<double>(gradient[i]) * static_cast<double>(gradient[i]);
    }
    parts[begin / kGrain] = sum;
  });
  double sum = 0;
  for (const double part : parts) sum += part;
  return std::sqrt(sum);
}

void scale(double factor, std::span<float> values) {
  if (factor == 1) return;
  const auto by = static_cast<float>(factor);
  parallelFor(values.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) values[i] *= by;
  });
}

}  // namespace

void validate(const WeightOptimiserOptions& options) {
  const auto isShare = [](double value) { return value >= 0 && value <= 1; };
  require(options.learning_rate > 0 && options.learning_rate <= kMaxLearningRate, "learning rate",
          options.learning_rate, "more than 0, and 1000000 at most,");
  require(options.beta1 >= 0 && options.beta1 < 1, "decay of the first moment", options.beta1,
          "0 or more, and less than 1,");
  require(options.beta2 >= 0 && options.beta2 < 1, "decay of the second moment", options.beta2,
          "0 or more, and less than 1,");
  require(options.weight_decay >= 0 && options.weight_decay * options.learning_rate < 1,
          "weight decay", options.weight_decay,
          "0 or more, and less than 1 over the learning rate,");
  require(options.total_steps > options.warm_up, "number of steps",
          static_cast<double>(options.total_steps), "more than the steps of the warm-up");
  require(isShare(options.least_share), "least share of the learning rate", options.least_share,
          "0 to 1");
  require(options.most_norm > 0 && std::isfinite(options.most_norm), "greatest length of gradients",
          options.most_norm, "a finite number above 0");
  require(options.clip_percentile >= 0 && options.clip_percentile <= 100,
          "percentile of lengths of gradients", options.clip_percentile, "0 to 100");
  require(isShare(options.mean_decay), "decay of the mean of weights", options.mean_decay,
          "0 to 1");
  require(options.loss_scale_start >= 0 && options.loss_scale_start <= kMostScaleStart,
          "logarithm of the first scale of losses", options.loss_scale_start, "0 to 100");
  require(isShare(options.loss_scale_growth), "growth of the scale of losses",
          options.loss_scale_growth, "0 to 1");
}

double rateShare(const WeightOptimiserOptions& options, uint64_t step) {
  if (step < options.warm_up) {
    return static_cast<double>(step) / static_cast<double>(options.warm_up);
  }
  const double way = std::min(1.0, static_cast<double>(step - options.warm_up) /
                                       static_cast<double>(options.total_steps - options.warm_up));
  return options.least_share +
         (1 - options.least_share) * 0.5 * (1 + std::cos(std::numbers::pi * way));
}

WeightOptimiser::WeightOptimiser(const WeightOptimiserOptions& options,
                                 std::span<const float> values)
    : options_(options) {
  validate(options_);
  state_.first.assign(values.size(), 0.0f);
  state_.second.assign(values.size(), 0.0f);
  state_.mean.assign(values.begin(), values.end());
  state_.most_norm = options_.most_norm;
  if (options_.loss_scaling == LossScaling::kDynamic) {
    state_.loss_scale_log2 = options_.loss_scale_start;
  }
}

WeightOptimiser::WeightOptimiser(const WeightOptimiserOptions& options, State state)
    : options_(options), state_(std::move(state)) {
  validate(options_);
  const size_t count = state_.mean.size();
  if (state_.first.size() == count && state_.second.size() == count &&
      state_.norms.size() <= options_.clip_buffer) {
    require(state_.loss_scale_log2 >= 0, "logarithm of the scale of losses of a state",
            state_.loss_scale_log2, "0 or more");
    return;
  }
  fail(ErrorCode::kInvalidArgument,
       "the state of an optimiser has " + std::to_string(state_.first.size()) + ", " +
           std::to_string(state_.second.size()) + " and " + std::to_string(count) +
           " numbers and " + std::to_string(state_.norms.size()) +
           " lengths; three times as many numbers, and " + std::to_string(options_.clip_buffer) +
           " lengths at most, are allowed");
}

double WeightOptimiser::lossScale() const {
  if (options_.loss_scaling == LossScaling::kNone) return 1;
  return std::exp2(std::floor(state_.loss_scale_log2));
}

WeightStep WeightOptimiser::step(std::span<float> gradient, std::span<float> values) {
  WeightStep done;
  done.loss_scale = lossScale();
  scale(1 / done.loss_scale, gradient);
  done.gradient_norm = normOf(gradient);
  done.most_norm = state_.most_norm;
  done.learning_rate = options_.learning_rate * rateShare(options_, state_.steps);
  if (!std::isfinite(done.gradient_norm)) {
    done.is_skipped = true;
    ++state_.skipped;
    // A loss that is not finite itself must not take the scale to where derivatives vanish.
    state_.loss_scale_log2 = std::max(0.0, state_.loss_scale_log2 - kScaleFall);
    return done;
  }
  done.clip_scale = std::min(1.0, done.most_norm / (done.gradient_norm + kNoLength));
  scale(done.clip_scale, gradient);
  scale(1 - done.learning_rate * options_.weight_decay, values);
  const AdamGroup group = {values.data(),       gradient.data(),
                           state_.first.data(), state_.second.data(),
                           values.size(),       1,
                           done.learning_rate,  0};
  adamStep({&group, 1}, state_.steps + 1, {options_.beta1, options_.beta2, options_.epsilon});
  parallelFor(values.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const auto value = static_cast<double>(values[i]);
      state_.mean[i] = value + options_.mean_decay * (state_.mean[i] - value);
    }
  });
  if (options_.clip_buffer > 0) {
    const auto norm = static_cast<float>(done.gradient_norm);
    if (state_.norms.size() < options_.clip_buffer) {
      state_.norms.push_back(norm);
    } else {
      state_.norms[state_.steps % options_.clip_buffer] = norm;
    }
    if (state_.norms.size() == options_.clip_buffer) {
      state_.most_norm = std::min(
          options_.most_norm,
          percentile({state_.norms.begin(), state_.norms.end()}, options_.clip_percentile / 100));
    }
  }
  if (options_.loss_scaling == LossScaling::kDynamic) {
    state_.loss_scale_log2 += options_.loss_scale_growth;
  }
  ++state_.steps;
  return done;
}

}  // namespace stipple
