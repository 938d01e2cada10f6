// Based on: DeG, density-sampled Gaussians (arXiv 2605.16355), the stages of its training.
#include "fit/training/training_session.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <system_error>
#include <utility>

#include "base/error.h"
#include "base/random.h"
#include "base/stopwatch.h"
#include "fit/training/autoencoder_measure.h"
#include "fit/training/detail_training.h"
#include "fit/training/flow_objects.h"
#include "fit/training/history_tensors.h"
#include "io/assets/checkpoint.h"
#include "io/assets/weight_file.h"
#include "io/bytes/input_file.h"
#include "io/reports/training_report.h"
#include "nn/matrix_backend.h"
#include "train/networks/example_gradients.h"

namespace stipple {

namespace {

namespace fs = std::filesystem;

constexpr uint64_t kLongestConfig = uint64_t{1} << 20;  // bytes
/// Objects that are learned from and choose the state that is kept.
constexpr size_t kChoosingObjects = 4;
/// Shares of the whole work.
constexpr double kReadShare = 0.02, kStepsShare = 0.98;

[[noreturn]] void refuse(const std::string& message) {
  fail(ErrorCode::kInvalidArgument, message);
}

std::string inFolder(const std::string& folder, const char* name) {
  return (fs::path(folder) / name).string();
}

/// Whether the autoencoder is learned, not only the flow.
bool learnsParts(const TrainingConfig& config) {
  return config.start.empty() || config.says_parts;
}

/// Whether latents are those of the training that this one starts with.
bool keepsEncoder(const TrainingConfig& config) {
  return !learnsParts(config) ||
         std::all_of(config.parts.begin(), config.parts.end(),
                     [](const AutoencoderSchedule& part) { return part.keeps_encoder; });
}

TrainingConfig readConfig(const std::string& path) {
  const fs::path folder = fs::path(path).parent_path();
  TrainingConfig config =
      parseTrainingConfig(readTextFile(path, kLongestConfig), path, folder.string());
  if (config.start.empty()) return config;
  std::map<std::string, std::string> metadata;
  openWeightFile(config.start, &metadata);
  if (metadata.count(kTrainedKey) == 0) {
    refuse(config.start + ", which the training is to start with, is not of a training of ours");
  }
  takeStart(metadata[kTrainedKey], config);
  if (keepsEncoder(config)) config.latents = latentsOf(metadata);
  return config;
}

/// The config of a file, with what it begins with.
TrainingConfig readWholeConfig(const std::string& path) {
  TrainingConfig config = readConfig(path);
  const std::string& start = config.flow.start;
  if (start.empty()) return config;
  if (config.latents.empty()) {
    refuse(
        "a flow that is learned further fits the latents of its encoder: \"start\" has to name "
        "weights with that one, which all parts have to keep");
  }
  std::map<std::string, std::string> metadata;
  // Weights of the autoencoder that was learned before it have the same settings.
  if (!openWeightFile(start, &metadata).has("shift_table")) {
    refuse("'" + start + "', which the flow is to start with, is not of a flow");
  }
  if (metadata.count(kTrainedKey) == 0 || latentsOf(metadata) != config.latents) {
    refuse("'" + start + "', which the flow is to start with, was not learned of the latents of '" +
           config.start + "'");
  }
  takeFlowStart(metadata[kTrainedKey], config);
  return config;
}

uint64_t stepCount(const TrainingConfig& config) {
  uint64_t steps = 0;
  for (const AutoencoderSchedule& part : config.parts) steps += part.optimiser.total_steps;
  if (!learnsParts(config)) steps = 0;
  if (config.learns_detail) steps += config.detail.schedule.optimiser.total_steps;
  return steps + config.flow.schedule.optimiser.total_steps;
}

/// "Structure" of "structure".
std::string stageTitle(AutoencoderStage stage) {
  std::string title = stageName(stage);
  title[0] = static_cast<char>(title[0] - 'a' + 'A');
  return title;
}

TrainingRecord recordOf(const AutoencoderStep& step, double seconds) {
  TrainingRecord record;
  record.part = static_cast<uint32_t>(step.part);
  record.is_skipped = step.weights.is_skipped;
  record.loss = static_cast<float>(step.losses.total);
  record.structure = static_cast<float>(step.losses.structure);
  record.divergence = static_cast<float>(step.losses.divergence);
  record.l1 = static_cast<float>(step.losses.l1);
  record.ssim = static_cast<float>(step.losses.ssim);
  record.learning_rate = static_cast<float>(step.weights.learning_rate);
  record.gradient_norm = static_cast<float>(step.weights.gradient_norm);
  record.seconds = static_cast<float>(seconds);
  return record;
}

void requireResults(const std::string& out, bool resumes) {
  const std::string checkpoint = trainingCheckpointPath(out);
  const bool is_left = fs::exists(checkpoint);
  if (is_left && !resumes) {
    refuse("'" + checkpoint +
           "' is left from a training that was stopped; resume it, or remove the file");
  }
  if (!is_left && resumes) refuse("'" + checkpoint + "', to go on from, is not there");
  std::error_code error;
  fs::create_directories(out, error);
  if (error) fail(ErrorCode::kIo, "the folder '" + out + "' cannot be made: " + error.message());
  // What goes on reads its checkpoint, and says more of one that is damaged.
  if (!resumes) requireCheckpointPlace(checkpoint);
  requireTrainedWeightsPlace(trainedDetailPath(out));
  requireTrainedWeightsPlace(trainedWeightsPath(out));
  requireTrainedWeightsPlace(trainedFlowPath(out));
  requireTrainingReportPlace(trainingReportPath(out));
}

/// Bytes of a step. In: numbers of the weights, bytes of an example, examples of a step.
uint64_t stepBytes(uint64_t weights, uint64_t example, uint64_t batch) {
  // Weights, derivatives, two moments, the best, a mean in double, and a checkpoint of most.
  constexpr uint64_t kWeightBytes = 5 * 4 + 8 + 24;
  return weights * kWeightBytes + examplesAtOnce(batch) * (example + weights * sizeof(float));
}

}  // namespace

std::string trainedWeightsPath(const std::string& out) {
  return inFolder(out, "weights.safetensors");
}
std::string trainedFlowPath(const std::string& out) {
  return inFolder(out, "flow.safetensors");
}
std::string trainedDetailPath(const std::string& out) {
  return inFolder(out, "detail.safetensors");
}
std::string trainingCheckpointPath(const std::string& out) {
  return inFolder(out, "checkpoint.stipple.safetensors");
}
std::string trainingReportPath(const std::string& out) {
  return inFolder(out, "report.json");
}

/// What run() has.
struct TrainingSession::Work {
  Work(TrainingSession& owner, Progress& given) : session(owner), progress(given) {}

  void read();
  void restore();
  void requireAlike();
  void takeSteps();
  void learnFlow();
  void begin(uint64_t taken);
  void measure();
  void save();
  void finish();

  const TrainingConfig& config() const { return session.config_; }
  std::string settings() const { return settingsJson(config()); }
  void show();
  const AutoencoderSchedule& part() const { return config().parts[part_of_next]; }
  bool hasImages() const { return part().stage != AutoencoderStage::kStructure; }

  TrainingSession& session;
  Progress& progress;
  std::shared_ptr<const Collection> collection;
  ObjectSplit split;
  std::unique_ptr<AutoencoderTrainer> trainer;
  std::unique_ptr<AutoencoderMeasure> judge;
  std::unique_ptr<FlowTrainer> flow;  ///< once the autoencoder is done
  TensorTable flow_state;             ///< of a checkpoint; empty: it had not begun
  TrainingHistory history;
  std::vector<float> best;  ///< weights; empty: nothing was measured yet
  double best_psnr = -std::numeric_limits<double>::infinity();
  size_t part_of_next = 0;  ///< part of the step that is taken, or was taken last
  bool checkpoint_failed = false;
  Stopwatch watch;
};

void TrainingSession::Work::read() {
  session.enter("Reading the collection");
  progress.enterPart(0, kReadShare);
  collection = std::make_shared<const Collection>(config().collection, config().objects, &progress);
  for (const std::string& text : collection->notes()) session.note(text);
  split = splitObjects(collection->count(), config().held_out);
  if (split.held_out.empty() && config().held_out > 0) {
    session.note("The collection has " + std::to_string(collection->count()) +
                 " objects, too few to hold any out; quality is of objects that are learned from.");
  }
  trainer = std::make_unique<AutoencoderTrainer>(
      config().sizes, config().parts, config().seed,
      std::make_shared<const CollectionShare>(collection, split.learned_from), session.backends_,
      TrainerRun{learnsParts(config()) ? session.exchange_ : nullptr, config().precision});
  if (!config().start.empty()) {
    trainer->start(trainer->networks().layout().read(openWeightFile(config().start)));
  }
  judge = std::make_unique<AutoencoderMeasure>(*session.backends_, *collection);
  history.measured_on_held_out = !split.held_out.empty();
  for (const AutoencoderSchedule& each : config().parts) {
    history.part_names.emplace_back(stageName(each.stage));
  }
  if (config().flow.isWanted()) history.part_names.emplace_back("flow");
  const std::lock_guard<std::mutex> lock(session.mutex_);
  session.status_.objects = split.learned_from.size();
  session.status_.held_out = split.held_out.size();
}

void TrainingSession::Work::restore() {
  const std::string path = trainingCheckpointPath(config().out);
  const Checkpoint checkpoint = readCheckpoint(path);
  const std::string difference = firstDifference(settings(), checkpoint.settings_json);
  if (!difference.empty()) refuse(path + " is of another training: " + difference);
  TensorTable tensors = checkpoint.tensors;
  try {
    takeHistory(tensors, *collection, history, best, best_psnr);
    trainer->resume(tensors);
    if (tensors.count("flow.weights") != 0) flow_state = std::move(tensors);
  } catch (const Error& error) {
    fail(error.code(), path + ": " + error.what());
  }
  if (!history.records.empty()) {
    part_of_next = std::min<size_t>(history.records.back().part, config().parts.size() - 1);
  }
  const std::lock_guard<std::mutex> lock(session.mutex_);
  session.status_.resumed_step = history.records.size();
}

void TrainingSession::Work::requireAlike() {
  requireSameTraining(*session.exchange_, settings(), *collection, history.records.size());
}

void TrainingSession::Work::show() {
  const std::lock_guard<std::mutex> lock(session.mutex_);
  tellOf(history, watch.seconds(), session.status_);
}

void TrainingSession::Work::measure() {
  if (!session.leads()) return;
  const AutoencoderSchedule& now = part();
  const std::vector<float> values = trainer->meanValues();
  const MeasuredAt at = {now.most_tokens, now.most_anchors, config().seed};
  const std::vector<size_t>& judging = split.judging();
  TrainingMeasure made = judge->measure(trainer->networks(), values,
                                        evenly(judging, config().measured_objects), at, &progress);
  made.step = history.records.size();
  made.training_psnr = judge
                           ->measure(trainer->networks(), values,
                                     evenly(split.learned_from, kChoosingObjects), at, &progress)
                           .psnr;
  history.measures.push_back(made);
  if (made.training_psnr < best_psnr) return;
  best_psnr = made.training_psnr;
  best = values;
  history.best_step = made.step;
}

void TrainingSession::Work::save() {
  if (!session.leads()) return;
  TensorTable tensors = trainer->state();
  if (flow) tensors.merge(flow->state());
  putHistory(history, *collection, best, best_psnr, tensors);
  try {
    writeCheckpoint(settings(), tensors, trainingCheckpointPath(config().out));
    checkpoint_failed = false;
  } catch (const Error& error) {
    if (!checkpoint_failed) {
      session.note(std::string("A checkpoint could not be written: ") + error.what() + ".");
    }
    checkpoint_failed = true;
  }
}

/// What a step tells of itself moves nothing: it would go back and forth.
void TrainingSession::Work::begin(uint64_t taken) {
  const double now = kReadShare + (kStepsShare - kReadShare) * static_cast<double>(taken) /
                                      static_cast<double>(stepCount(config()));
  progress.enterPart(now, now);
  progress.advance(0, "Learning");
}

void TrainingSession::Work::learnFlow() {
  const FlowConfig& wanted = config().flow;
  if (!wanted.isWanted()) return;
  session.enter("Encoding objects");
  // Only who measures knows the best.
  std::vector<float> values = best.empty() ? trainer->meanValues() : best;
  session.exchange_->share(values);
  FlowObjectOptions options;
  options.tokens = config().parts.back().most_tokens;
  options.patches = wanted.patches;
  options.in_order = wanted.in_order != 0;
  begin(history.records.size());
  flow = std::make_unique<FlowTrainer>(
      flowSizes(wanted, config().sizes.latent_width), wanted.schedule, config().seed,
      std::make_shared<const FlowObjects>(collection, split.learned_from, trainer->networks(),
                                          values, options, &progress),
      TrainerRun{session.exchange_, config().precision});
  if (!wanted.start.empty()) {
    flow->start(flow->layout().read(openWeightFile(wanted.start)));
  }
  if (!flow_state.empty()) flow->resume(flow_state);
  flow_state.clear();
  session.enter("Flow");
  while (!flow->isDone()) {
    begin(history.records.size());
    const Stopwatch one;
    const FlowStep done = flow->step(&progress);
    TrainingRecord record;
    record.part = static_cast<uint32_t>(config().parts.size());
    record.is_skipped = done.weights.is_skipped;
    record.loss = static_cast<float>(done.loss);
    record.learning_rate = static_cast<float>(done.weights.learning_rate);
    record.gradient_norm = static_cast<float>(done.weights.gradient_norm);
    record.seconds = static_cast<float>(one.seconds());
    history.records.push_back(record);
    show();
    if (history.records.size() % config().checkpoint_interval == 0) save();
  }
}

void TrainingSession::Work::takeSteps() {
  while (learnsParts(config()) && !trainer->isDone()) {
    const uint64_t taken = history.records.size();
    begin(taken);
    const Stopwatch one;
    const AutoencoderStep done = trainer->step(&progress);
    if (taken == 0 || done.part != part_of_next) {
      session.enter(stageTitle(config().parts[done.part].stage));
    }
    part_of_next = done.part;
    history.records.push_back(recordOf(done, one.seconds()));
    const uint64_t count = taken + 1;
    const bool ends_part = trainer->isDone() || trainer->part() != done.part;
    if (hasImages() && (count % config().measure_interval == 0 || ends_part)) measure();
    show();
    if (count % config().checkpoint_interval == 0) save();
  }
}

void TrainingSession::Work::finish() {
  session.enter("Measuring");
  progress.enterPart(kStepsShare, 1);
  const bool is_measured = !best.empty();
  const std::vector<float>& values = is_measured ? best : trainer->meanValues();
  const AutoencoderSchedule& last = config().parts.back();
  const std::vector<size_t>& judging = split.judging();
  const bool has_images = last.stage != AutoencoderStage::kStructure;
  constexpr int kOctaves = 4;
  for (int octave = kOctaves; octave >= 0 && has_images; --octave) {
    const uint64_t anchors = last.most_anchors >> octave;
    if (anchors == 0) continue;
    progress.advance(static_cast<double>(kOctaves - octave) / (kOctaves + 1), "Measuring");
    const MeasuredAt at = {last.most_tokens, anchors, config().seed};
    TrainingMeasure made = judge->measure(trainer->networks(), values, judging, at, &progress);
    made.step = history.best_step;
    made.training_psnr = judge
                             ->measure(trainer->networks(), values,
                                       evenly(split.learned_from, kChoosingObjects), at, &progress)
                             .psnr;
    history.by_budget.push_back(made);
  }
  writeTrainedWeights(trainer->networks().tensors(values), settings(),
                      trainedWeightsPath(config().out), config().latents);
  if (flow) {
    writeTrainedWeights(flow->tensors(flow->meanValues()), settings(),
                        trainedFlowPath(config().out), config().latents);
  }
  writeTrainingReport(settings(), history, trainingReportPath(config().out));
  const std::lock_guard<std::mutex> lock(session.mutex_);
  session.by_budget_ = history.by_budget;
  session.status_.budget_count = history.by_budget.size();
}

TrainingSession::TrainingSession(std::shared_ptr<const BackendFactory> backends,
                                 const std::string& config_path, bool resumes,
                                 std::shared_ptr<GradientExchange> exchange)
    : backends_(std::move(backends)),
      config_(readWholeConfig(config_path)),
      resumes_(resumes),
      exchange_(exchange ? std::move(exchange) : noExchange()) {
  validate(config_.sizes);
  requirePrecision(config_.precision);
  for (size_t i = 0; i < config_.parts.size() && learnsParts(config_); ++i) {
    requireExamples(*exchange_, config_.parts[i].batch, ("part " + std::to_string(i)).c_str());
  }
  if (config_.flow.isWanted()) {
    requireExamples(*exchange_, config_.flow.schedule.batch, "the flow");
  }
  if (config_.learns_detail) {
    requireExamples(*exchange_, config_.detail.schedule.batch, "the detail network");
  }
  if (leads()) requireResults(config_.out, resumes);
  status_.steps = stepCount(config_);
  status_.psnr = std::numeric_limits<double>::quiet_NaN();
}

uint64_t TrainingSession::memoryBound() const {
  if (config_.learns_detail) {
    const DetailConfig& detail = config_.detail;
    const DetailModel model(detail.sizes);
    // Rows of one child: what up-sampling keeps of it is the widest. Trees are small beside images.
    const uint64_t most = detail.schedule.most_splats;
    const uint64_t rows = model.splatCount(most, most) + most * detail.schedule.views;
    const uint64_t width = detail.sizes.heads * detail.sizes.head_width;
    const uint64_t example = rows * (8 * width + 512) * (detail.sizes.blocks + 1) * sizeof(float);
    return stepBytes(model.layout().size(), example, detail.schedule.batch) +
           config_.objects.image_bytes;
  }
  // Rows of the widest tape, about: what all blocks of the three networks keep of a row.
  uint64_t rows = 0, batch = 1;
  for (const AutoencoderSchedule& part : config_.parts) {
    batch = std::max<uint64_t>(batch, part.batch);
    rows = std::max<uint64_t>(rows, part.most_tokens + part.most_anchors + config_.objects.points);
  }
  const uint64_t width = config_.sizes.heads * config_.sizes.head_width;
  const uint64_t blocks =
      config_.sizes.encoder_blocks + config_.sizes.octree_blocks + config_.sizes.splat_blocks;
  const uint64_t example =
      rows * width * (blocks + 4 * config_.sizes.mlp_ratio + 16) * sizeof(float);
  return stepBytes(DensityAutoencoder(config_.sizes).layout().size(), example, batch) +
         config_.objects.image_bytes;
}

void TrainingSession::runDetail(Progress& progress) {
  const TrainingObserver observer = {[this](const std::string& text) { note(text); },
                                     [this](const std::string& stage) { enter(stage); },
                                     [this](const std::function<void(TrainingStatus&)>& change) {
                                       const std::lock_guard<std::mutex> lock(mutex_);
                                       change(status_);
                                     }};
  const DetailPaths paths = {trainedDetailPath(config_.out), trainingCheckpointPath(config_.out),
                             trainingReportPath(config_.out)};
  const std::vector<TrainingMeasure> by_budget =
      trainDetail(backends_, config_, paths, resumes_, exchange_, observer, progress);
  const std::lock_guard<std::mutex> lock(mutex_);
  by_budget_ = by_budget;
  status_.budget_count = by_budget_.size();
}

void TrainingSession::run(Progress& progress) {
  if (config_.learns_detail) {
    runDetail(progress);
    return;
  }
  Work work(*this, progress);
  work.read();
  if (resumes_) work.restore();
  work.requireAlike();
  try {
    work.takeSteps();
    work.learnFlow();
    if (leads()) work.finish();
  } catch (const Error&) {
    if (!work.history.records.empty()) work.save();
    throw;
  }
  if (!leads()) return;
  std::error_code ignored;
  fs::remove(trainingCheckpointPath(config_.out), ignored);
}

void TrainingSession::note(const std::string& text) {
  const std::lock_guard<std::mutex> lock(mutex_);
  notes_.push_back(text);
  status_.note_count = notes_.size();
}

void TrainingSession::enter(const std::string& stage) {
  const std::lock_guard<std::mutex> lock(mutex_);
  status_.stage = stage;
}

TrainingStatus TrainingSession::status() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return status_;
}

const char* TrainingSession::noteAt(size_t index) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (index >= notes_.size()) {
    refuse("there are " + std::to_string(notes_.size()) + " notes, none of number " +
           std::to_string(index));
  }
  return notes_[index].c_str();
}

TrainingMeasure TrainingSession::budgetAt(size_t index) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (index >= by_budget_.size()) {
    refuse("there are " + std::to_string(by_budget_.size()) + " budgets, none of number " +
           std::to_string(index));
  }
  return by_budget_[index];
}

}  // namespace stipple
