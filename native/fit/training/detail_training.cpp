// Based on: Nam et al., Generative Densification, CVPR 2025: training of the densification layers.
#include "fit/training/detail_training.h"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <system_error>
#include <utility>

#include "base/error.h"
#include "base/random.h"
#include "base/stopwatch.h"
#include "fit/training/history_tensors.h"
#include "io/assets/checkpoint.h"
#include "io/assets/weight_file.h"
#include "io/reports/training_report.h"
#include "train/loop/picture_store.h"

namespace stipple {

namespace {

/// Objects that are learned from and choose the state that is kept.
constexpr size_t kChoosingObjects = 4;
constexpr double kReadShare = 0.02, kStepsShare = 0.98;

class DetailWork {
 public:
  DetailWork(std::shared_ptr<const BackendFactory> backends, const TrainingConfig& config,
             const DetailPaths& paths, std::shared_ptr<GradientExchange> exchange,
             const TrainingObserver& observer, Progress& progress)
      : backends_(std::move(backends)),
        config_(config),
        paths_(paths),
        exchange_(std::move(exchange)),
        observer_(observer),
        progress_(progress),
        settings_(settingsJson(config)) {}

  void read();
  void restore();
  void requireAlike();
  void takeSteps();
  std::vector<TrainingMeasure> finish();
  void save();
  bool hasBegun() const { return !history_.records.empty(); }

 private:
  bool leads() const { return exchange_->rank() == 0; }
  void measure();
  void show() {
    observer_.change([&](TrainingStatus& status) { tellOf(history_, watch_.seconds(), status); });
  }

  std::shared_ptr<const BackendFactory> backends_;
  const TrainingConfig& config_;
  const DetailPaths& paths_;
  std::shared_ptr<GradientExchange> exchange_;
  const TrainingObserver& observer_;
  Progress& progress_;
  std::string settings_;
  std::shared_ptr<const Collection> collection_;
  ObjectSplit split_;
  std::shared_ptr<const FittedObjects> fitted_;
  std::unique_ptr<DetailTrainer> trainer_;
  std::unique_ptr<DetailMeasure> judge_;
  TrainingHistory history_;
  std::vector<float> best_;  ///< weights; empty: nothing was measured yet
  double best_psnr_ = -std::numeric_limits<double>::infinity();
  bool checkpoint_failed_ = false;
  Stopwatch watch_;
};

void DetailWork::read() {
  observer_.enter("Reading the collection");
  progress_.enterPart(0, kReadShare);
  collection_ = std::make_shared<const Collection>(config_.collection, config_.objects, &progress_);
  for (const std::string& text : collection_->notes()) observer_.note(text);
  split_ = splitObjects(collection_->count(), config_.held_out);
  if (split_.held_out.empty() && config_.held_out > 0) {
    observer_.note("The collection has " + std::to_string(collection_->count()) +
                   " objects, too few to hold any out; quality is of objects that are learned "
                   "from.");
  }
  observer_.change([&](TrainingStatus& status) {
    status.objects = split_.learned_from.size();
    status.held_out = split_.held_out.size();
  });
  observer_.enter("Fitting objects");
  fitted_ = std::make_shared<const FittedObjects>(backends_, collection_, config_, *exchange_,
                                                  &progress_);
  trainer_ = std::make_unique<DetailTrainer>(
      config_.detail.sizes, config_.detail.schedule, config_.seed,
      std::make_shared<const FittedShare>(fitted_, split_.learned_from), backends_,
      TrainerRun{exchange_, config_.precision});
  judge_ = std::make_unique<DetailMeasure>(*backends_, *fitted_, config_.detail.schedule.views);
  history_.measured_on_held_out = !split_.held_out.empty();
  history_.part_names = {"detail"};
}

void DetailWork::restore() {
  const Checkpoint checkpoint = readCheckpoint(paths_.checkpoint);
  const std::string difference = firstDifference(settings_, checkpoint.settings_json);
  if (!difference.empty()) {
    fail(ErrorCode::kInvalidArgument, paths_.checkpoint + " is of another training: " + difference);
  }
  try {
    takeHistory(checkpoint.tensors, *collection_, history_, best_, best_psnr_);
    trainer_->resume(checkpoint.tensors);
  } catch (const Error& error) {
    fail(error.code(), paths_.checkpoint + ": " + error.what());
  }
  observer_.change([&](TrainingStatus& status) { status.resumed_step = history_.records.size(); });
}

void DetailWork::requireAlike() {
  requireSameTraining(*exchange_, settings_, *collection_, history_.records.size());
}

void DetailWork::measure() {
  if (!leads()) return;
  const std::vector<float> values = trainer_->meanValues();
  const uint64_t splats = config_.detail.schedule.most_splats;
  TrainingMeasure made =
      judge_->measure(trainer_->model(), values, evenly(split_.judging(), config_.measured_objects),
                      splats, false, &progress_);
  made.step = history_.records.size();
  made.training_psnr =
      judge_
          ->measure(trainer_->model(), values, evenly(split_.learned_from, kChoosingObjects),
                    splats, false, &progress_)
          .psnr;
  history_.measures.push_back(made);
  if (made.training_psnr < best_psnr_) return;
  best_psnr_ = made.training_psnr;
  best_ = values;
  history_.best_step = made.step;
}

void DetailWork::save() {
  if (!leads()) return;
  TensorTable tensors = trainer_->state();
  putHistory(history_, *collection_, best_, best_psnr_, tensors);
  try {
    writeCheckpoint(settings_, tensors, paths_.checkpoint);
    checkpoint_failed_ = false;
  } catch (const Error& error) {
    if (!checkpoint_failed_) {
      observer_.note(std::string("A checkpoint could not be written: ") + error.what() + ".");
    }
    checkpoint_failed_ = true;
  }
}

void DetailWork::takeSteps() {
  observer_.enter("Detail");
  const uint64_t steps = config_.detail.schedule.optimiser.total_steps;
  while (!trainer_->isDone()) {
    const uint64_t taken = history_.records.size();
    const double now = kReadShare + (kStepsShare - kReadShare) * static_cast<double>(taken) /
                                        static_cast<double>(steps);
    progress_.enterPart(now, now);
    progress_.advance(0, "Learning");
    const Stopwatch one;
    const DetailStep done = trainer_->step(&progress_);
    TrainingRecord record;
    record.is_skipped = done.weights.is_skipped;
    record.loss = static_cast<float>(done.loss);
    record.l1 = static_cast<float>(done.l1);
    record.ssim = static_cast<float>(done.ssim);
    record.learning_rate = static_cast<float>(done.weights.learning_rate);
    record.gradient_norm = static_cast<float>(done.weights.gradient_norm);
    record.seconds = static_cast<float>(one.seconds());
    history_.records.push_back(record);
    const uint64_t count = taken + 1;
    if (count % config_.measure_interval == 0 || trainer_->isDone()) measure();
    show();
    if (count % config_.checkpoint_interval == 0) save();
  }
}

std::vector<TrainingMeasure> DetailWork::finish() {
  observer_.enter("Measuring");
  progress_.enterPart(kStepsShare, 1);
  const std::vector<float> values = best_.empty() ? trainer_->meanValues() : best_;
  const DetailSchedule& schedule = config_.detail.schedule;
  std::vector<uint64_t> budgets;
  for (uint64_t splats = schedule.most_splats; splats >= schedule.least_splats; splats /= 2) {
    budgets.insert(budgets.begin(), splats);
  }
  for (size_t i = 0; i < budgets.size(); ++i) {
    progress_.advance(static_cast<double>(i) / static_cast<double>(budgets.size()), "Measuring");
    TrainingMeasure made =
        judge_->measure(trainer_->model(), values, split_.judging(), budgets[i], true, &progress_);
    made.step = history_.best_step;
    made.training_psnr =
        judge_
            ->measure(trainer_->model(), values, evenly(split_.learned_from, kChoosingObjects),
                      budgets[i], false, &progress_)
            .psnr;
    history_.by_budget.push_back(made);
  }
  writeTrainedWeights(trainer_->model().tensors(values), settings_, paths_.weights);
  writeTrainingReport(settings_, history_, paths_.report);
  return history_.by_budget;
}

}  // namespace

TrainingMeasure DetailMeasure::measure(const DetailModel& model, std::span<const float> values,
                                       const std::vector<size_t>& objects, uint64_t splats,
                                       bool compares, Progress* progress) {
  constexpr double kBlack[3] = {0, 0, 0};
  TrainingMeasure mean;
  mean.objects = objects.size();
  const double share = 1 / static_cast<double>(objects.size());
  for (const size_t object : objects) {
    if (progress != nullptr) progress->throwIfCancelled();
    const ObjectViews& views = *objects_.collection().object(object)->views;
    std::vector<size_t> all, others;
    for (size_t i = 0; i < views.count(); ++i) all.push_back(i);
    const std::vector<size_t> told = evenly(all, told_);
    for (const size_t view : all) {
      if (std::find(told.begin(), told.end(), view) == told.end()) others.push_back(view);
    }
    if (others.empty()) others = all;
    const SplatCloud coarse = objects_.coarse(object, splats);
    const CoarseEvidence evidence =
        gatherEvidence(backends_, coarse, detailViews(views, told), coarse.size(), progress);
    DetailModel::Tape tape;
    const SplatCloud fine = model.forward(values, coarse, evidence, tape);
    PictureStore pictures(objects_.collection().views(object), 0);
    const FitMeasure seen = views_.measure(fine, pictures, others, kBlack);
    mean.psnr += share * seen.psnr;
    mean.ssim += share * seen.ssim;
    mean.anchors = std::max<uint64_t>(mean.anchors, fine.size());
    mean.coarse_splats = std::max<uint64_t>(mean.coarse_splats, coarse.size());
    if (!compares) continue;
    mean.coarse_psnr += share * views_.measure(coarse, pictures, others, kBlack).psnr;
    const SplatCloud cut = objects_.coarse(object, fine.size());
    mean.cut_psnr += share * views_.measure(cut, pictures, others, kBlack).psnr;
  }
  return mean;
}

std::vector<TrainingMeasure> trainDetail(std::shared_ptr<const BackendFactory> backends,
                                         const TrainingConfig& config, const DetailPaths& paths,
                                         bool resumes,
                                         const std::shared_ptr<GradientExchange>& exchange,
                                         const TrainingObserver& observer, Progress& progress) {
  DetailWork work(std::move(backends), config, paths, exchange, observer, progress);
  work.read();
  if (resumes) work.restore();
  work.requireAlike();
  std::vector<TrainingMeasure> by_budget;
  try {
    work.takeSteps();
    if (exchange->rank() == 0) by_budget = work.finish();
  } catch (const Error&) {
    if (work.hasBegun()) work.save();
    throw;
  }
  if (exchange->rank() != 0) return by_budget;
  std::error_code ignored;
  std::filesystem::remove(paths.checkpoint, ignored);
  return by_budget;
}

}  // namespace stipple
