#include "fit/training/history_tensors.h"

#include <string>

#include "base/error.h"

namespace stipple {

namespace {

constexpr char kRecords[] = "history.records", kMeasures[] = "history.measures";
constexpr char kBestStep[] = "history.best_step", kBestPsnr[] = "history.best_psnr";
constexpr char kBest[] = "history.best_weights", kObjects[] = "history.objects";
constexpr uint64_t kRecordWidth = 10, kMeasureWidth = 6;

/// Names of all objects, one after the other, with zeros between them.
std::vector<uint8_t> namesOf(const Collection& collection) {
  std::vector<uint8_t> bytes;
  for (size_t i = 0; i < collection.count(); ++i) {
    const std::string& name = collection.name(i);
    bytes.insert(bytes.end(), name.begin(), name.end());
    bytes.push_back(0);
  }
  return bytes;
}

template <class T>
const std::vector<T>& require(const TensorTable& tensors, const char* name, uint64_t width) {
  const auto found = tensors.find(name);
  const auto* values =
      found == tensors.end() ? nullptr : std::get_if<std::vector<T>>(&found->second.values);
  if (values == nullptr || values->size() % width != 0) {
    fail(ErrorCode::kFormat,
         std::string("the checkpoint has no tensor '") + name + "' of a training");
  }
  return *values;
}

}  // namespace

void putHistory(const TrainingHistory& history, const Collection& collection,
                const std::vector<float>& best, double best_psnr, TensorTable& tensors) {
  std::vector<float> records;
  for (const TrainingRecord& r : history.records) {
    records.insert(records.end(),
                   {static_cast<float>(r.part), r.is_skipped ? 1.0f : 0.0f, r.loss, r.structure,
                    r.divergence, r.l1, r.ssim, r.learning_rate, r.gradient_norm, r.seconds});
  }
  std::vector<double> measures;
  for (const TrainingMeasure& m : history.measures) {
    measures.insert(measures.end(),
                    {static_cast<double>(m.step), static_cast<double>(m.anchors),
                     static_cast<double>(m.objects), m.psnr, m.ssim, m.training_psnr});
  }
  tensors[kRecords] = {{history.records.size(), kRecordWidth}, std::move(records)};
  tensors[kMeasures] = {{history.measures.size(), kMeasureWidth}, std::move(measures)};
  tensors[kBestStep] = {{1}, std::vector<uint64_t>{history.best_step}};
  tensors[kBestPsnr] = {{1}, std::vector<double>{best_psnr}};
  tensors[kBest] = {{best.size()}, best};
  std::vector<uint8_t> names = namesOf(collection);
  tensors[kObjects] = {{names.size()}, std::move(names)};
}

void takeHistory(const TensorTable& tensors, const Collection& collection, TrainingHistory& history,
                 std::vector<float>& best, double& best_psnr) {
  if (require<uint8_t>(tensors, kObjects, 1) != namesOf(collection)) {
    fail(ErrorCode::kInvalidArgument,
         "it is of a training with other objects; the collection has changed since");
  }
  const std::vector<float>& records = require<float>(tensors, kRecords, kRecordWidth);
  for (size_t i = 0; i < records.size(); i += kRecordWidth) {
    const float* r = &records[i];
    history.records.push_back(
        {static_cast<uint32_t>(r[0]), r[1] != 0, r[2], r[3], r[4], r[5], r[6], r[7], r[8], r[9]});
  }
  const std::vector<double>& measures = require<double>(tensors, kMeasures, kMeasureWidth);
  for (size_t i = 0; i < measures.size(); i += kMeasureWidth) {
    const double* m = &measures[i];
    history.measures.push_back({static_cast<uint64_t>(m[0]), static_cast<uint64_t>(m[1]),
                                static_cast<uint64_t>(m[2]), m[3], m[4], m[5]});
  }
  const std::vector<uint64_t>& best_step = require<uint64_t>(tensors, kBestStep, 1);
  const std::vector<double>& psnr = require<double>(tensors, kBestPsnr, 1);
  if (best_step.size() != 1 || psnr.size() != 1) {
    fail(ErrorCode::kFormat, "the checkpoint does not say which state was the best");
  }
  history.best_step = best_step.front();
  best_psnr = psnr.front();
  best = require<float>(tensors, kBest, 1);
}

}  // namespace stipple
