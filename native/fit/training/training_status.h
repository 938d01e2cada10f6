#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>

#include "data/training_history.h"

namespace stipple {

/// How a training is doing.
struct TrainingStatus {
  std::string stage;  ///< "Reading the collection", "Structure", ...
  uint64_t step = 0;  ///< that are done, over all parts
  uint64_t steps = 0;
  uint64_t resumed_step = 0;  ///< where it went on from a checkpoint; 0: it began
  uint64_t skipped = 0;       ///< steps whose derivatives were not finite
  uint64_t objects = 0;       ///< that are learned from
  uint64_t held_out = 0;
  uint64_t best_step = 0;  ///< of the result if the training ended now; 0: not measured yet
  double loss = 0;         ///< means of the last 50 steps
  double structure = 0;
  double psnr = 0;  ///< dB, as measured last; NaN: not yet
  double seconds = 0;
  double seconds_left = 0;  ///< by the pace of the last 50 steps
  size_t note_count = 0;
  size_t budget_count = 0;  ///< of budgetAt(), once it has ended
};

/// Tells what the records of a training say of it. In: seconds since it began or went on. Out:
/// status, its stage, notes and objects apart.
void tellOf(const TrainingHistory& history, double seconds, TrainingStatus& status);

/// Whom a part of a training tells how it is doing.
struct TrainingObserver {
  std::function<void(const std::string&)> note, enter;
  std::function<void(const std::function<void(TrainingStatus&)>&)> change;
};

}  // namespace stipple
