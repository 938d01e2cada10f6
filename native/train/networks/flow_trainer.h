#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/progress.h"
#include "data/tensor_table.h"
#include "train/networks/example_gradients.h"
#include "train/networks/trained_flow.h"
#include "train/networks/trainer_run.h"
#include "train/optimiser/weight_optimiser.h"

namespace stipple {

/// An object as a flow network learns it: a latent whose tokens are in order, with the camera of
/// the image, and what the image shows.
struct FlowObject {
  Latent latent;
  ImageCondition condition;
};

/// Objects, each of which may be seen by several images. Several threads ask at the same time.
class FlowSource {
 public:
  virtual ~FlowSource() = default;
  virtual size_t count() const = 0;
  /// In: draw: which of its images, any number.
  virtual FlowObject object(size_t index, uint64_t draw) const = 0;
};

struct FlowSchedule {
  size_t batch = 8;            ///< objects of a step, >= 1
  double image_dropout = 0.1;  ///< 0..1, share of examples without an image
  double time_mean = 0;        ///< times are 1 / (1 + exp(-N(mean, 1)))
  WeightOptimiserOptions optimiser;
};

/// Errors: kInvalidArgument with the option, its value and what is allowed.
void validate(const FlowSchedule& schedule);
void validate(const FlowSizes& sizes);

struct FlowStep {
  uint64_t step = 0;  ///< from 0 on
  double loss = 0;    ///< mean squared error of the velocity, over its examples
  WeightStep weights;
};

/// Trains a flow network. Everything that is drawn is keyed by seed and step, so that a training
/// that was stopped goes on bit for bit.
class FlowTrainer {
 public:
  /// Errors: kInvalidArgument: validate(); a source without objects; fewer objects in a step than
  /// there are processes; kUnavailable (requirePrecision()).
  FlowTrainer(const FlowSizes& sizes, const FlowSchedule& schedule, uint64_t seed,
              std::shared_ptr<const FlowSource> objects, TrainerRun run = {});

  /// Begins with other weights, before the first step. In: values, of the layout.
  void start(std::vector<float> values);

  const ParameterLayout& layout() const { return layout_; }
  const std::vector<float>& values() const { return values_; }
  /// The mean of weights over steps.
  std::vector<float> meanValues() const;
  /// All tensors by their published names.
  TensorTable tensors(std::span<const float> values) const;
  bool isDone() const { return taken_ >= schedule_.optimiser.total_steps; }
  /// One step. Errors: those of the source and of the exchange, kCancelled; then nothing has
  /// changed.
  FlowStep step(Progress* progress = nullptr);
  /// The mean squared error of weights at `draws` times, images and noises for each object that are
  /// keyed by the seed: for comparing weights and sets of objects.
  double loss(std::span<const float> values, const FlowSource& objects, size_t draws, uint64_t seed,
              Progress* progress = nullptr) const;

  /// All that it knows, for a checkpoint, "flow." before its names.
  TensorTable state() const;
  /// Errors: kFormat for tensors that are missing, of another size, or not finite; then nothing has
  /// changed.
  void resume(const TensorTable& state);

 private:
  struct Drawn;
  Drawn drawn(FlowObject object, uint64_t key) const;

  ParameterLayout layout_;
  FlowSchedule schedule_;
  uint64_t seed_;
  std::shared_ptr<const FlowSource> objects_;
  std::shared_ptr<GradientExchange> exchange_;
  TrainedFlow flow_;
  std::vector<float> values_, gradients_;
  ExampleGradients example_gradients_;
  std::optional<WeightOptimiser> optimiser_;
  uint64_t taken_ = 0;
};

}  // namespace stipple
