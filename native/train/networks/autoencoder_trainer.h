#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/progress.h"
#include "data/tensor_table.h"
#include "train/networks/density_autoencoder.h"
#include "train/networks/example_gradients.h"
#include "train/networks/trainer_run.h"
#include "train/optimiser/weight_optimiser.h"

namespace stipple {

/// The objects of a collection, read when they are asked for.
class ObjectSource {
 public:
  virtual ~ObjectSource() = default;
  virtual size_t count() const = 0;
  virtual std::shared_ptr<const TrainingObject> object(size_t index) const = 0;
};

/// A part of a training: what is learned, for how long, and of which sizes of latents and anchors.
struct AutoencoderSchedule {
  AutoencoderStage stage = AutoencoderStage::kStructure;
  size_t batch = 1;              ///< objects of a step, >= 1
  size_t most_tokens = 256;      ///< of a latent
  uint32_t token_halvings = 0;   ///< each step has that many over 2^r tokens, r = 0 to this
  uint64_t least_anchors = 256;  ///< drawn evenly from here
  uint64_t most_anchors = 256;   ///< to here
  size_t views = 4;
  size_t surface = 8192;       ///< points of an object that tell the density of its surface
  bool keeps_encoder = false;  ///< so that latents, and a flow of them, stay as they are
  AutoencoderLossWeights weights;
  WeightOptimiserOptions optimiser;  ///< its total_steps are the steps of this part
};

/// Errors: kInvalidArgument with the option, its value and what is allowed.
void validate(const AutoencoderSchedule& schedule);

/// What a step did.
struct AutoencoderStep {
  uint64_t step = 0;  ///< from 0 on, over all parts
  size_t part = 0;
  AutoencoderLosses losses;  ///< means over its examples
  WeightStep weights;
};

/// Trains a density autoencoder, part by part; each part begins with the weights of the last and an
/// optimiser of its own. All objects are seen once before any is seen again. Everything that is
/// drawn is keyed by seed and step, so that a training that was stopped goes on bit for bit.
/// Several processes each take every so-many-th object of a step, with the keys that it has where
/// one takes all, so that they learn the same but for the order of sums.
class AutoencoderTrainer {
 public:
  /// Errors: kInvalidArgument: validate(); a source without objects; a part that has fewer objects
  /// in a step than there are processes; kUnavailable (requirePrecision()).
  AutoencoderTrainer(const AutoencoderSizes& sizes, std::vector<AutoencoderSchedule> parts,
                     uint64_t seed, std::shared_ptr<const ObjectSource> objects,
                     std::shared_ptr<const BackendFactory> backends, TrainerRun run = {});

  /// Begins with other weights, before the first step. In: values, of the networks' layout.
  void start(std::vector<float> values);

  const DensityAutoencoder& networks() const { return networks_; }
  const std::vector<float>& values() const { return values_; }
  /// The mean of weights over steps, which is what a training is for.
  std::vector<float> meanValues() const;
  bool isDone() const { return part_ >= parts_.size(); }
  size_t part() const { return part_; }  ///< of the next step; the number of parts where it is done
  /// One step. Errors: those of the source and of the exchange, kCancelled; then nothing has
  /// changed.
  AutoencoderStep step(Progress* progress = nullptr);

  /// All that it knows, for a checkpoint.
  TensorTable state() const;
  /// Goes on from a state of a training of the same sizes and parts. Errors: kFormat for tensors
  /// that are missing, of another size, or not finite; then nothing has changed.
  void resume(const TensorTable& state);

 private:
  void beginPart();

  DensityAutoencoder networks_;
  std::vector<AutoencoderSchedule> parts_;
  uint64_t seed_;
  std::shared_ptr<const ObjectSource> objects_;
  std::shared_ptr<const BackendFactory> backends_;
  std::shared_ptr<GradientExchange> exchange_;
  std::vector<float> values_, gradients_;
  ExampleGradients example_gradients_;
  std::optional<WeightOptimiser> optimiser_;
  size_t part_ = 0;
  uint64_t taken_ = 0;    ///< steps, over all parts, skipped ones among them
  uint64_t in_part_ = 0;  ///< of them in this part
  uint64_t seen_ = 0;     ///< objects so far
};

}  // namespace stipple
