#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace stipple {

/// Whether derivatives are found of a multiple of the loss, so that small ones do not vanish where
/// networks keep them in 16 bits.
enum class LossScaling {
  kNone,
  kDynamic,  ///< a step that is taken raises the multiple a little, one that is not halves it
};

/// Of networks; the defaults are those of the released training, but for the scale of losses, which
/// does nothing where derivatives are float32.
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
  LossScaling loss_scaling = LossScaling::kNone;
  double loss_scale_start = 20;      ///< 0..100, log2 of the multiple of the first step
  double loss_scale_growth = 0.001;  ///< 0..1, what a step that is taken adds to it
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
  double loss_scale = 1;     ///< that the gradient came with
  bool is_skipped = false;   ///< the gradient was not finite: nothing has changed
};

/// AdamW with warm-up, cosine, cut gradients, a mean of weights and a scale of losses. Sources: D.
/// Kingma, J. Ba, Adam, ICLR 2015; I. Loshchilov, F. Hutter, Decoupled Weight Decay Regularization,
/// ICLR 2019; P. Micikevicius et al., Mixed Precision Training, ICLR 2018, section 3.2;
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
    double loss_scale_log2 = 0;        ///< of the next step, >= 0; 0 where there is no scale
  };

  /// In: values [n], which the mean begins with. Errors: kInvalidArgument (validate()).
  WeightOptimiser(const WeightOptimiserOptions& options, std::span<const float> values);
  /// Goes on from a state. Errors: kInvalidArgument for arrays that do not fit together.
  WeightOptimiser(const WeightOptimiserOptions& options, State state);

  const State& state() const { return state_; }
  /// What the loss of the next step is to be multiplied by: the power of two below its log2, so
  /// that it rounds nothing; 1 where there is no scale.
  double lossScale() const;
  /// In: gradient [n], of lossScale() times the loss; it is brought to that of the loss and cut in
  /// place. Out: values [n].
  /// Threads and determinism: parallel; same bits for any number of threads.
  WeightStep step(std::span<float> gradient, std::span<float> values);

 private:
  WeightOptimiserOptions options_;
  State state_;
};

}  // namespace stipple
