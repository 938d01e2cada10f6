#include "fit/training/training_status.h"

#include <algorithm>

namespace stipple {

namespace {

constexpr size_t kPaceSteps = 50;

}  // namespace

void tellOf(const TrainingHistory& history, double seconds, TrainingStatus& status) {
  const size_t count = history.records.size();
  size_t recent = 0;  // of the present part, whose loss is of other things than the last one's
  while (recent < std::min(count, kPaceSteps) &&
         history.records[count - 1 - recent].part == history.records[count - 1].part) {
    ++recent;
  }
  double loss = 0, structure = 0, pace = 0;
  for (size_t i = count - recent; i < count; ++i) {
    const TrainingRecord& record = history.records[i];
    loss += static_cast<double>(record.loss) / static_cast<double>(recent);
    structure += static_cast<double>(record.structure) / static_cast<double>(recent);
    pace += static_cast<double>(record.seconds) / static_cast<double>(recent);
  }
  status.step = count;
  status.loss = loss;
  status.structure = structure;
  status.seconds = seconds;
  status.seconds_left = pace * static_cast<double>(status.steps - count);
  status.skipped = static_cast<uint64_t>(
      std::count_if(history.records.begin(), history.records.end(),
                    [](const TrainingRecord& record) { return record.is_skipped; }));
  status.best_step = history.best_step;
  if (!history.measures.empty()) status.psnr = history.measures.back().psnr;
}

}  // namespace stipple
