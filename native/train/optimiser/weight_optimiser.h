#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace stipple {

/// Of networks; the defaults are those of the released training.
struct WeightOptimiserOptions {
  double learning_rate = 1e-4;  ///< > 0, at its highest
  double beta1 = 0.9, beta2 = 0.999;
  double epsilon = 1e-8;
  double weight_decay = 0;        ///< >= 0, AdamW: p *= 1 - rate decay before each step
  uint64_t warm_up = 200;         ///< steps over which the rate rises from 0
  uint64_t total_steps = 100000;  ///< the rate falls as a cosine from there to that step
  double least_share = 0.01;      ///< 0..1, of the rate that is left then
  double most_norm = 1;           ///< > 0: longer gradients are cut to that length
  uint64_t clip_buffer = 0;       ///< lengths that are kept; once there are as many, gradients are
                                  ///< cut at a percentile of them, too; 0: not so
  double clip_percentile = 95;    ///< 0..100
  double mean_decay = 0.9999;     ///< 0..1, of the mean of weights that is used in the end
};

/// Errors: kInvalidArgument with the option, its value and what is allowed.
void validate(const WeightOptimiserOptions& options);

/// The share of the learning rate of a step, from 0 on: linear to 1 over the warm-up, then half a
/// cosine. That of step 0 is 0 where there is a warm-up, so that only moments move.
double rateShare(const WeightOptimiserOptions& options, uint64_t step);

/// What a step did.
struct WeightStep {
  double learning_rate = 0;
  double gradient_norm = 0;  ///< before it was cut
  double most_norm = 0;      ///< what it was cut to
  double clip_scale = 0;     ///< by which it was multiplied, 0..1
  bool is_skipped = false;   ///< the gradient was not finite: nothing has changed
};

/// AdamW with warm-up, cosine, cut gradients and a mean of weights. Sources: D. Kingma, J. Ba,
/// Adam, ICLR 2015; I. Loshchilov, F. Hutter, Decoupled Weight Decay Regularization, ICLR 2019;
/// docs/methods/density_autoencoder.md.
class WeightOptimiser {
 public:
  /// All that it knows, for checkpoints.
  struct State {
    std::vector<float> first, second;  ///< [n] moments
    std::vector<double> mean;          ///< [n] of weights; double, as one step moves it by 1e-4 of
                                       ///< what a weight moved
    std::vector<float> norms;          ///< the last clip_buffer lengths of gradients, as a ring
    uint64_t steps = 0;                ///< those that were taken
    uint64_t skipped = 0;              ///< those that were not
    double most_norm = 0;              ///< of the next step
  };

  /// In: values [n], which the mean begins with. Errors: kInvalidArgument (validate()).
  WeightOptimiser(const WeightOptimiserOptions& options, std::span<const float> values);
  /// Goes on from a state. Errors: kInvalidArgument for arrays that do not fit together.
  WeightOptimiser(const WeightOptimiserOptions& options, State state);

  const State& state() const { return state_; }
  /// In: gradient [n]; it is cut in place. Out: values [n].
  /// Threads and determinism: parallel; same bits for any number of threads.
  WeightStep step(std::span<float> gradient, std::span<float> values);

 private:
  WeightOptimiserOptions options_;
  State state_;
};

}  // namespace stipple
