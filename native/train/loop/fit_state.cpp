#include "train/loop/fit_state.h"

#include <string>

#include "base/error.h"

namespace stipple {

namespace {

constexpr char kIteration[] = "iteration";
constexpr char kBestIteration[] = "history.best_iteration";
constexpr char kRecords[] = "history.records";
constexpr char kCounts[] = "history.splat_counts";
constexpr char kMeasures[] = "history.measures";
constexpr char kHistory[] = "history.";
constexpr char kBest[] = "best.";
constexpr uint64_t kRecordLength = 9;
constexpr uint64_t kMeasureLength = 9;
/// Of checkpoints from before there was moving_psnr, and before that training_psnr: their best
/// state was chosen by the views that psnr is of.
constexpr uint64_t kLeastMeasureLength = 7;

constexpr float FitRecord::*kRecordNumbers[kRecordLength] = {&FitRecord::loss,
                                                             &FitRecord::l1,
                                                             &FitRecord::ssim,
                                                             &FitRecord::render_seconds,
                                                             &FitRecord::backward_seconds,
                                                             &FitRecord::field_seconds,
                                                             &FitRecord::optimiser_seconds,
                                                             &FitRecord::edit_seconds,
                                                             &FitRecord::other_seconds};

bool startsWith(const std::string& text, const char* start) {
  return text.rfind(start, 0) == 0;
}

Tensor whole(uint64_t value) {
  return {{1}, std::vector<uint64_t>{value}};
}

/// Values of a tensor of rows. Errors: kFormat.
template <typename T>
const std::vector<T>& valuesOf(const TensorTable& table, const char* name, uint64_t row_length,
                               uint64_t row_count) {
  const auto found = table.find(name);
  if (found == table.end()) {
    fail(ErrorCode::kFormat, "the checkpoint has no tensor '" + std::string(name) + "'");
  }
  const auto* values = std::get_if<std::vector<T>>(&found->second.values);
  if (!values || values->size() != row_length * row_count) {
    fail(ErrorCode::kFormat, "the checkpoint's tensor '" + std::string(name) +
                                 "' has another type or size than is needed");
  }
  return *values;
}

uint64_t wholeOf(const TensorTable& table, const char* name) {
  return valuesOf<uint64_t>(table, name, 1, 1)[0];
}

}  // namespace

void addFitState(TensorTable& table, uint64_t iteration, const FitHistory& history) {
  std::vector<float> records;
  std::vector<uint32_t> counts;
  records.reserve(history.records.size() * kRecordLength);
  for (const FitRecord& record : history.records) {
    for (const auto number : kRecordNumbers) records.push_back(record.*number);
    counts.push_back(record.splat_count);
  }
  std::vector<double> measures;
  for (const FitMeasure& m : history.measures) {
    measures.insert(measures.end(),
                    {static_cast<double>(m.iteration), static_cast<double>(m.budget),
                     static_cast<double>(m.splat_count), m.psnr, m.foreground_psnr, m.ssim,
                     m.density_entropy, m.training_psnr, m.moving_psnr});
  }
  table[kIteration] = whole(iteration);
  table[kBestIteration] = whole(history.best_iteration);
  table[kRecords] = {{history.records.size(), kRecordLength}, std::move(records)};
  table[kCounts] = {{history.records.size()}, std::move(counts)};
  table[kMeasures] = {{history.measures.size(), kMeasureLength}, std::move(measures)};
}

void addBest(TensorTable& table, const TensorTable& best) {
  for (const auto& [name, tensor] : best) table[kBest + name] = tensor;
}

uint64_t takeFitState(const TensorTable& table, FitHistory& history) {
  const uint64_t iteration = wholeOf(table, kIteration);
  history.best_iteration = wholeOf(table, kBestIteration);
  const auto& records = valuesOf<float>(table, kRecords, kRecordLength, iteration);
  const auto& counts = valuesOf<uint32_t>(table, kCounts, 1, iteration);
  history.records.assign(iteration, {});
  for (size_t i = 0; i < iteration; ++i) {
    for (size_t k = 0; k < kRecordLength; ++k) {
      history.records[i].*kRecordNumbers[k] = records[i * kRecordLength + k];
    }
    history.records[i].splat_count = counts[i];
  }
  const auto found = table.find(kMeasures);
  const uint64_t measure_count =
      found == table.end() || found->second.shape.empty() ? 0 : found->second.shape[0];
  const bool is_shorter = found != table.end() && found->second.shape.size() == 2 &&
                          found->second.shape[1] >= kLeastMeasureLength &&
                          found->second.shape[1] < kMeasureLength;
  const uint64_t length = is_shorter ? found->second.shape[1] : kMeasureLength;
  const auto& measures = valuesOf<double>(table, kMeasures, length, measure_count);
  history.measures.assign(measure_count, {});
  for (size_t i = 0; i < measure_count; ++i) {
    const double* row = &measures[i * length];
    history.measures[i] = {static_cast<uint64_t>(row[0]),
                           static_cast<uint64_t>(row[1]),
                           static_cast<uint64_t>(row[2]),
                           row[3],
                           row[4],
                           row[5],
                           row[6]};
    if (length > 7) history.measures[i].training_psnr = row[7];
    if (length > 8) history.measures[i].moving_psnr = row[8];
  }
  return iteration;
}

std::optional<TensorTable> takeBest(const TensorTable& table) {
  TensorTable best;
  for (const auto& [name, tensor] : table) {
    if (startsWith(name, kBest)) best[name.substr(sizeof(kBest) - 1)] = tensor;
  }
  if (best.empty()) return std::nullopt;
  return best;
}

TensorTable modelState(const TensorTable& table) {
  TensorTable model;
  for (const auto& [name, tensor] : table) {
    if (name == kIteration || startsWith(name, kHistory) || startsWith(name, kBest)) continue;
    model[name] = tensor;
  }
  return model;
}

}  // namespace stipple
