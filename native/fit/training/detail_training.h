#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/progress.h"
#include "data/training_history.h"
#include "fit/training/detail_objects.h"
#include "fit/training/training_config.h"
#include "fit/training/training_status.h"
#include "train/backend/backend_factory.h"
#include "train/loop/held_out.h"
#include "train/networks/gradient_exchange.h"

namespace stipple {

/// Where a training of detail writes.
struct DetailPaths {
  std::string weights, checkpoint, report;
};

/// What finer splats are like in views that the network was not told of.
class DetailMeasure {
 public:
  /// In: both must outlive this; told: views that the network is told of, spread evenly.
  DetailMeasure(const BackendFactory& backends, const FittedObjects& objects, size_t told)
      : backends_(backends), objects_(objects), told_(told), views_(backends) {}

  /// All of `splats` coarse ones become finer. In: objects: numbers in the collection, at least
  /// one; compares: whether coarse splats and cuts of as many are measured, too. Errors: those of
  /// reading images; kCancelled.
  TrainingMeasure measure(const DetailModel& model, std::span<const float> values,
                          const std::vector<size_t>& objects, uint64_t splats, bool compares,
                          Progress* progress = nullptr);

 private:
  const BackendFactory& backends_;
  const FittedObjects& objects_;
  size_t told_;
  ViewMeasure views_;
};

/// Learns a network that adds detail, from a config that says so: it reads the collection, makes
/// coarse splats, goes on from a checkpoint or begins, measures, keeps the best. Returns what the
/// result is worth, by the number of splats. Errors and what is left of one that ends early: those
/// of TrainingSession::run(), and of FittedObjects.
std::vector<TrainingMeasure> trainDetail(std::shared_ptr<const BackendFactory> backends,
                                         const TrainingConfig& config, const DetailPaths& paths,
                                         bool resumes,
                                         const std::shared_ptr<GradientExchange>& exchange,
                                         const TrainingObserver& observer, Progress& progress);

}  // namespace stipple
