#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/progress.h"
#include "data/tensor_table.h"
#include "train/detail/detail_model.h"
#include "train/networks/density_autoencoder.h"
#include "train/networks/example_gradients.h"
#include "train/networks/trainer_run.h"
#include "train/optimiser/weight_optimiser.h"

namespace stipple {

/// Objects with views, each as coarse splats of any number. Several threads ask at the same time.
class DetailSource {
 public:
  virtual ~DetailSource() = default;
  virtual size_t count() const = 0;
  /// Before black.
  virtual const ObjectViews& views(size_t index) const = 0;
  /// In: splats: at most as many.
  virtual SplatCloud coarse(size_t index, uint64_t splats) const = 0;
};

struct DetailSchedule {
  size_t batch = 1;             ///< objects of a step, >= 1
  uint64_t least_splats = 256;  ///< of coarse clouds, drawn evenly in doublings from here
  uint64_t most_splats = 1024;  ///< to here
  double least_share = 0.25;    ///< of them that become finer, drawn evenly from here to 1
  size_t views = 4;             ///< that the network is told of
  size_t seen = 4;              ///< that the loss looks at, drawn from all
  double ssim = 0.2;            ///< of 1 - SSIM, beside L1 with a weight of 1
  WeightOptimiserOptions optimiser;
};

/// Errors: kInvalidArgument with the option, its value and what is allowed.
void validate(const DetailSchedule& schedule);

struct DetailStep {
  uint64_t step = 0;                  ///< from 0 on
  double loss = 0, l1 = 0, ssim = 0;  ///< means over its examples
  WeightStep weights;
};

/// Views as the network is told of them.
std::vector<DetailView> detailViews(const ObjectViews& views, const std::vector<size_t>& chosen);

/// Trains a network that adds detail. Everything that is drawn is keyed by seed and step, so that a
/// training that was stopped goes on bit for bit.
class DetailTrainer {
 public:
  /// Errors: kInvalidArgument: validate(); a source without objects; fewer objects in a step than
  /// there are processes; kUnavailable (requirePrecision()).
  DetailTrainer(const DetailModelSizes& sizes, const DetailSchedule& schedule, uint64_t seed,
                std::shared_ptr<const DetailSource> objects,
                std::shared_ptr<const BackendFactory> backends, TrainerRun run = {});

  const DetailModel& model() const { return model_; }
  const std::vector<float>& values() const { return values_; }
  /// The mean of weights over steps.
  std::vector<float> meanValues() const;
  bool isDone() const { return taken_ >= schedule_.optimiser.total_steps; }
  /// One step. Errors: those of the source and of the exchange, kCancelled; then nothing has
  /// changed.
  DetailStep step(Progress* progress = nullptr);

  /// All that it knows, for a checkpoint, "detail." before its names.
  TensorTable state() const;
  /// Errors: kFormat for tensors that are missing, of another size, or not finite; then nothing has
  /// changed.
  void resume(const TensorTable& state);

 private:
  /// Of an example, times its share of the step.
  struct Losses {
    double loss = 0, l1 = 0, ssim = 0;
  };
  Losses addExample(size_t index, uint64_t key, double share, std::span<float> gradients,
                    Progress* progress) const;

  DetailModel model_;
  DetailSchedule schedule_;
  uint64_t seed_;
  std::shared_ptr<const DetailSource> objects_;
  std::shared_ptr<const BackendFactory> backends_;
  std::shared_ptr<GradientExchange> exchange_;
  std::vector<float> values_, gradients_;
  ExampleGradients example_gradients_;
  std::optional<WeightOptimiser> optimiser_;
  uint64_t taken_ = 0;
};

}  // namespace stipple
