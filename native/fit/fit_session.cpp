#include "fit/fit_session.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/number_text.h"
#include "data/views/view_check.h"
#include "fit/clip_cuts.h"
#include "fit/fit_memory.h"
#include "fit/fit_settings.h"
#include "fit/fit_views.h"
#include "fit/key_frame_folder.h"
#include "io/assets/checkpoint.h"
#include "io/reports/fit_report.h"
#include "model/field_splats.h"
#include "model/motion_splats.h"
#include "model/moving_budgets.h"
#include "model/relay_splats.h"
#include "model/scaffold_splats.h"
#include "train/anchors/relay_model.h"
#include "train/anchors/scaffold_model.h"
#include "train/loop/explicit_model.h"
#include "train/loop/field_model.h"
#include "train/loop/moving_splats.h"

namespace stipple {

namespace {

TrainerOptions trainerOptions(const FitOptions& options) {
  TrainerOptions trainer;
  trainer.iterations = options.iterations;
  trainer.background = options.background;
  trainer.seed = options.seed;
  trainer.max_splats = isOfAnchors(options.model) ? 0 : options.max_splats;
  trainer.picture_bytes = options.picture_bytes;
  trainer.ssim_share = options.ssim_share;
  trainer.coarse_to_fine = options.model == FitKind::kExplicit && options.coarse_to_fine;
  trainer.measure_interval = options.measure_interval;
  if (options.checkpoint_path.empty()) return trainer;
  trainer.checkpoint_interval = options.checkpoint_interval;
  trainer.checkpoint_seconds = options.checkpoint_seconds;
  return trainer;
}

FieldModelOptions fieldOptions(const FitOptions& options) {
  FieldModelOptions field;
  field.least_anchors = options.least_anchors;
  field.most_anchors = options.most_anchors;
  field.gaussians_per_anchor = options.gaussians_per_anchor;
  field.sh_degree = static_cast<int>(options.sh_degree);
  field.antialias = options.antialias;
  field.ssim_share = options.ssim_share;
  field.density_gradient = options.density_gradient;
  field.jitter = options.jitter;
  field.shell = options.shell;
  field.seed = options.seed;
  return field;
}

ScaffoldModelOptions scaffoldOptions(const FitOptions& options) {
  ScaffoldModelOptions scaffold;
  scaffold.most_anchors = options.most_anchors;
  scaffold.start_anchors = std::min(options.start_splats, options.most_anchors);
  scaffold.gaussians_per_anchor = options.gaussians_per_anchor;
  scaffold.sh_degree = static_cast<int>(options.sh_degree);
  scaffold.antialias = options.antialias;
  scaffold.ssim_share = options.ssim_share;
  scaffold.seed = options.seed;
  return scaffold;
}

/// One key frame every so many whole frames, at least one, in the middle of the clip.
KeyFrameClip keyFrameClip(const FitOptions& options, const ViewSource& views) {
  const MotionClip clip = clipOfViews(views);
  const double frames = std::round(options.key_frame_spacing * clip.frames_per_second);
  KeyFrameClip keys;
  keys.begin = clip.begin;
  keys.frames_per_second = clip.frames_per_second;
  keys.frame_count = clip.frame_count;
  keys.spacing = static_cast<uint32_t>(std::clamp(frames, 1.0, double{1} * clip.frame_count));
  keys.first_key = firstKeyOf(keys);
  keys.blend = options.key_frame_blend;
  return keys;
}

std::unique_ptr<FitModel> relayModel(const BackendFactory& backends, const ViewSource& views,
                                     const FitViews& split, const FitOptions& options,
                                     Progress* progress) {
  RelayModelOptions relay;
  relay.anchors = scaffoldOptions(options);
  relay.clip = keyFrameClip(options, views);
  relay.grows_by_level = options.growth_by_level;
  relay.level_quantiles = {options.middle_level_rank, options.high_level_rank};
  relay.level_weights = {options.middle_level_weight, options.high_level_weight};
  relay.iterations = options.iterations;
  std::shared_ptr<KeyFrameStore> store = std::make_shared<MemoryKeyFrames>();
  if (!options.checkpoint_path.empty()) {
    store = std::make_shared<KeyFrameFolder>(options.checkpoint_path);
  }
  if (!options.resume) store->clear();
  return makeRelayModel(backends, views, split.training, relay, std::move(store), progress);
}

ExplicitModelOptions explicitOptions(const FitOptions& options, const ViewSource& views) {
  ExplicitModelOptions model;
  model.strategy = options.strategy;
  model.start_splats = options.start_splats;
  model.max_splats = options.max_splats;
  model.sh_degree = static_cast<int>(options.sh_degree);
  model.antialias = options.antialias;
  model.ssim_share = options.ssim_share;
  model.seed = options.seed;
  model.iterations = options.iterations;
  if (options.model == FitKind::kMotion) model.clip = clipOfViews(views);
  return model;
}

std::unique_ptr<FitModel> makeModel(const BackendFactory& backends, const ViewSource& views,
                                    const FitViews& split, const FitOptions& options,
                                    const SplatCloud* start, Progress* progress) {
  if (start != nullptr) {
    return makeExplicitModel(backends, *start, explicitOptions(options, views));
  }
  if (options.model == FitKind::kField) {
    return makeFieldModel(backends, views, split.training, fieldOptions(options), progress);
  }
  if (options.model == FitKind::kScaffold) {
    return makeScaffoldModel(backends, views, split.training, scaffoldOptions(options), progress);
  }
  if (options.model == FitKind::kRelay) {
    return relayModel(backends, views, split, options, progress);
  }
  return makeExplicitModel(backends, views, split.training, explicitOptions(options, views),
                           progress);
}

FitOptions preparedOptions(const FitOptions& options, const ViewSource& views) {
  requireFitOptions(options);
  FitOptions held = resolved(options);
  if (moves(held.model)) clipOfViews(views);  // says now what times are missing
  holdToMemory(held, views);
  return held;
}

/// In: options: what was asked for; held: after max_bytes.
void requireStart(const SplatCloud& start, const ViewSource& views, const FitOptions& options,
                  const FitOptions& held) {
  if (options.model != FitKind::kExplicit) {
    fail(ErrorCode::kInvalidArgument,
         "only a fit of explicit splats that stand still can begin with splats");
  }
  if (start.size() == 0) {
    fail(ErrorCode::kInvalidArgument, "there are no splats to begin with; at least one is needed");
  }
  if (start.colour_space != views.colourSpace()) {
    fail(ErrorCode::kInvalidArgument,
         "the splats to begin with and the views have different colour spaces; they must be "
         "composited in one");
  }
  const std::string count = "there are " + std::to_string(start.size()) + " splats to begin with; ";
  if (start.size() > options.max_splats) {
    fail(ErrorCode::kInvalidArgument, count + "max_splats allows " +
                                          std::to_string(options.max_splats) +
                                          ": raise it, or begin with fewer");
  }
  if (start.size() > held.max_splats) {
    fail(ErrorCode::kMemoryLimit,
         count + "max_bytes has room for " + std::to_string(held.max_splats));
  }
}

/// A place that cannot be written to is a note when a checkpoint is: it may be there by then.
void requireNothingLost(const std::string& checkpoint_path) {
  try {
    requireCheckpointPlace(checkpoint_path);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kIo) throw;
  }
}

}  // namespace

FitSession::FitSession(std::shared_ptr<const BackendFactory> backends,
                       std::shared_ptr<const ViewSource> views, const FitOptions& options,
                       std::shared_ptr<const SplatCloud> start)
    : backends_(std::move(backends)),
      views_(std::move(views)),
      options_(preparedOptions(options, *views_)),
      start_(std::move(start)),
      split_(splitAsTold(*views_, options_.holdout)) {
  if (start_) requireStart(*start_, *views_, options, options_);
  if (!options_.checkpoint_path.empty() && !options_.resume) {
    requireNothingLost(options_.checkpoint_path);
  }
  figures_.iterations = options_.iterations;
}

uint64_t FitSession::memoryBound() const {
  return fitMemoryBound(options_, *views_);
}

uint64_t FitSession::memoryBound(const ViewSource& views, const FitOptions& options) {
  return fitMemoryBound(preparedOptions(options, views), views);
}

std::unique_ptr<Trainer> FitSession::prepared(Progress& progress) {
  const FitSettings settings = settingsOf(options_, *views_, start_.get());
  settings_json_ = stipple::settingsJson(settings);
  // A checkpoint that does not fit is told before anything is loaded.
  std::optional<Checkpoint> checkpoint;
  if (options_.resume) {
    checkpoint = readCheckpoint(options_.checkpoint_path);
    requireSameSettings(checkpoint->settings_json, settings, options_.checkpoint_path);
  }
  for (const std::string& text : views_->notes()) note(text);
  const std::string held_out = heldOutCameras(*views_, split_);
  if (!held_out.empty()) note(held_out);
  if (options_.model == FitKind::kRelay) noteCut();
  for (const std::string& warning : checkViews(*views_, {}, &progress)) note(warning);
  auto trainer = std::make_unique<Trainer>(
      *backends_, views_, split_,
      makeModel(*backends_, *views_, split_, options_, start_.get(), &progress),
      trainerOptions(options_));
  if (!checkpoint) return trainer;
  try {
    trainer->restore(checkpoint->tensors);
  } catch (const Error& error) {
    fail(error.code(), options_.checkpoint_path + ": " + error.what());
  }
  return trainer;
}

/// Anchors that are deformed over a cut show neither shot.
void FitSession::noteCut() {
  const std::optional<ClipCut> cut = findCut(*views_);
  if (!cut) return;
  const MotionClip clip = clipOfViews(*views_);
  const auto frameAt = [&](double seconds) {
    return std::to_string(std::llround((seconds - clip.begin) * clip.frames_per_second));
  };
  note(
      "The images change at once between frame " + frameAt(cut->before) + " (" +
      numberText(cut->before) + " s) and frame " + frameAt(cut->behind) +
      ", as at a cut. Two clips, one up to it and one from it on, will look better than this one.");
}

void FitSession::run(Progress& progress) {
  trainer_ = prepared(progress);
  const auto ends = [this] {
    std::lock_guard<std::mutex> lock(mutex_);
    has_ended_ = true;
  };
  try {
    trainer_->run(*this, &progress);
    mergeMoving(progress);
  } catch (...) {
    ends();
    throw;
  }
  ends();
}

void FitSession::mergeMoving(Progress& progress) {
  const std::optional<MotionCloud> moving = motionResult(trainer_->model());
  if (!moving || moving->size() == 0) return;
  const MovingTreeSource trees = movingTreesByViews(backends_);
  const uint64_t needed = memoryBound() + trees.memoryBoundOf(*moving);
  if (options_.max_bytes > 0 && needed > options_.max_bytes) {
    note("The splats have no tree of budgets, since fit and tree would take " +
         std::to_string(needed) + " bytes; it is built when fewer splats are first asked for.");
    return;
  }
  // The fit itself is done, whatever becomes of this.
  progress.enterPart(1, 1);
  try {
    tree_ = std::make_shared<const MovingTree>(trees.treeOf(*moving, &progress));
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kCancelled) throw;
  }
  progress.enterPart(0, 1);
}

FitStatus FitSession::status() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return {figures_, stage_, split_.held_out.empty(), notes_.size(), preview_iteration_};
}

const char* FitSession::noteAt(uint64_t index) const {
  std::lock_guard<std::mutex> lock(mutex_);
  if (index >= notes_.size()) {
    fail(ErrorCode::kInvalidArgument, "note " + std::to_string(index) +
                                          " was asked for; there are " +
                                          std::to_string(notes_.size()) + ", counted from 0");
  }
  return notes_[index].c_str();
}

SeenCloud FitSession::takePreview() {
  preview_is_wanted_ = true;
  std::lock_guard<std::mutex> lock(mutex_);
  return preview_;
}

Trainer& FitSession::ended() const {
  std::lock_guard<std::mutex> lock(mutex_);
  if (!has_ended_ || !trainer_ || trainer_->iteration() == 0) {
    fail(ErrorCode::kInvalidArgument,
         "the fit has no result: it has not ended, or ended before its first step");
  }
  return *trainer_;
}

SeenCloud FitSession::decode(uint64_t budget) const {
  Trainer& trainer = ended();
  std::lock_guard<std::mutex> lock(decode_mutex_);
  SplatCloud cloud = trainer.model().splats(budget);
  return SeenCloud(std::move(cloud), trainer.seen());
}

std::shared_ptr<const SplatModel> FitSession::model() const {
  FitModel& model = ended().model();
  std::optional<FieldResult> learned;
  std::optional<MotionCloud> moving;
  std::shared_ptr<const ScaffoldParameters> scaffold;
  {
    // The density is frozen by the first who asks for it, and a decode may be that one.
    std::lock_guard<std::mutex> lock(decode_mutex_);
    learned = fieldResult(model);
    moving = motionResult(model);
    scaffold = scaffoldResult(model);
  }
  if (options_.model == FitKind::kRelay) return relay();
  if (scaffold) return makeScaffoldSplats(std::move(scaffold), {settings_json_, {}});
  if (moving)
    return makeMotionSplats(std::move(*moving), {settings_json_, {}}, tree_,
                            movingTreesByViews(backends_));
  if (!learned) {
    fail(ErrorCode::kUnsupported, std::string("the ") + model.name() +
                                      " model has no field; its splats can be made a hierarchy");
  }
  return makeFieldSplats(std::make_shared<const OctreeDensity>(std::move(learned->density)),
                         std::move(learned->field), learned->draws, {settings_json_, {}});
}

/// All key frames as they are now.
std::shared_ptr<const SplatModel> FitSession::relay() const {
  std::lock_guard<std::mutex> lock(decode_mutex_);
  return makeRelaySplats(keyFrameClip(options_, *views_), relayResult(ended().model()),
                         {settings_json_, {}});
}

void FitSession::saveReport(const std::string& path) const {
  FitReportHead head;
  head.model = ended().model().name();
  if (!isOfAnchors(options_.model)) head.strategy = options_.strategy;
  head.settings_json = settings_json_;
  requireFitReportPlace(path);
  writeFitReport(head, history(), path);
  writeFitPlots(history(), fitPlotsPath(path));
}

void FitSession::figures(const FitFigures& figures) {
  std::lock_guard<std::mutex> lock(mutex_);
  figures_ = figures;
  if (figures.iteration > 0) stage_ = figures.stage;
}

void FitSession::note(const std::string& text) {
  std::lock_guard<std::mutex> lock(mutex_);
  // The same trouble at every checkpoint is told once.
  for (const std::string& earlier : notes_) {
    if (earlier == text) return;
  }
  notes_.push_back(text);
}

bool FitSession::wantsPreview() {
  return preview_is_wanted_.exchange(false);
}

void FitSession::watchTime(double seconds) {
  requireFinite(seconds, "the time of previews");
  std::lock_guard<std::mutex> lock(mutex_);
  preview_time_ = seconds;
}

std::optional<double> FitSession::previewTime() {
  std::lock_guard<std::mutex> lock(mutex_);
  return preview_time_;
}

void FitSession::preview(SplatCloud cloud, SplatQuantities seen) {
  SeenCloud shared(std::move(cloud), std::move(seen));
  std::lock_guard<std::mutex> lock(mutex_);
  preview_ = std::move(shared);
  preview_iteration_ = trainer_->iteration();
}

void FitSession::save(const TensorTable& table) {
  writeCheckpoint(settings_json_, table, options_.checkpoint_path);
}

}  // namespace stipple
