#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "base/progress.h"
#include "data/training_history.h"
#include "fit/training/training_config.h"
#include "fit/training/training_status.h"
#include "train/backend/backend_factory.h"
#include "train/networks/gradient_exchange.h"

namespace stipple {

/// Where a training writes, in the folder of its results.
std::string trainedWeightsPath(const std::string& out);
std::string trainedFlowPath(const std::string& out);
std::string trainedDetailPath(const std::string& out);
std::string trainingCheckpointPath(const std::string& out);
std::string trainingReportPath(const std::string& out);

/// One training of the density autoencoder, or of detail, from its config to its weights: it reads
/// the collection, holds objects out, goes on from a checkpoint or begins, measures, keeps the
/// best. run() works on one thread; all else may be called by others at any time. Of several
/// processes that learn together the one of rank 0 measures and writes; to the folder of results
/// the others look for a checkpoint to go on from, and else not at all.
class TrainingSession {
 public:
  /// Reads the config. Errors: kIo; those of parseTrainingConfig(); kInvalidArgument where a
  /// checkpoint is left and `resumes` is false, or none is there and it is true, and where a file
  /// of another kind stands where results go; kUnavailable (requirePrecision()). In: exchange: with
  /// the other processes; null: there are none.
  TrainingSession(std::shared_ptr<const BackendFactory> backends, const std::string& config_path,
                  bool resumes, std::shared_ptr<GradientExchange> exchange = nullptr);

  /// About what run() allocates with as many threads as a call from here uses, bytes.
  uint64_t memoryBound() const;

  /// The whole work. Where it ends early, also while the result is measured or written, a
  /// checkpoint of the last step is left. Errors: those of Collection; of a checkpoint that cannot
  /// be read (kFormat), or is of a training with other settings or objects (kInvalidArgument, with
  /// the first that differs); kCancelled; of an image that is gone; kIo where weights or report
  /// cannot be written; of the exchange, and kInvalidArgument where the processes have other
  /// settings, objects or checkpoints. A checkpoint that cannot be written is a note. Threads and
  /// determinism: the same bits for any number of threads, and wherever it was stopped.
  void run(Progress& progress);

  const TrainingConfig& config() const { return config_; }
  TrainingStatus status() const;
  /// The text lives as long as the session. Errors: kInvalidArgument for an index out of range.
  const char* noteAt(size_t index) const;
  /// What the result is worth at a budget. Errors: as noteAt().
  TrainingMeasure budgetAt(size_t index) const;

 private:
  struct Work;

  void runDetail(Progress& progress);
  void note(const std::string& text);
  void enter(const std::string& stage);
  bool leads() const { return exchange_->rank() == 0; }

  std::shared_ptr<const BackendFactory> backends_;
  TrainingConfig config_;
  bool resumes_;
  std::shared_ptr<GradientExchange> exchange_;

  mutable std::mutex mutex_;  ///< of what follows
  TrainingStatus status_;
  std::deque<std::string> notes_;  ///< texts stay where they are
  std::vector<TrainingMeasure> by_budget_;
};

}  // namespace stipple
