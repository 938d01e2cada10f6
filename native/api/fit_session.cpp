#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

#include "api/fit.h"
#include "base/error.h"
#include "data/views/view_check.h"
#include "io/assets/checkpoint.h"

namespace stipple::api {

namespace {

std::unique_ptr<FitModel> makeModel(const BackendFactory& backends, const ViewSource& views,
                                    const FitViews& split, const FitSettings& settings,
                                    Progress* progress) {
  if (settings.is_field) {
    return makeFieldModel(backends, views, split.training, settings.field_model, progress);
  }
  return makeExplicitModel(backends, views, split.training, settings.explicit_model, progress);
}

}  // namespace

FitSession::FitSession(std::shared_ptr<const BackendFactory> backends,
                       std::shared_ptr<const ViewSource> views, FitViews split,
                       FitSettings settings)
    : backends_(std::move(backends)),
      views_(std::move(views)),
      split_(std::move(split)),
      settings_(std::move(settings)) {
  figures_.iterations = settings_.trainer.iterations;
}

void FitSession::run(Progress& progress) {
  settings_json_ = settingsText(settings_, *views_);
  // A checkpoint that does not fit is told before anything is loaded.
  std::optional<Checkpoint> checkpoint;
  if (settings_.resumes) {
    checkpoint = readCheckpoint(settings_.checkpoint_path);
    requireSameSettings(checkpoint->settings_json, settings_json_, settings_.checkpoint_path);
  }
  for (const std::string& warning : checkViews(*views_, {}, &progress)) note(warning);
  auto trainer = std::make_unique<Trainer>(
      *backends_, views_, split_, makeModel(*backends_, *views_, split_, settings_, &progress),
      settings_.trainer);
  if (checkpoint) {
    try {
      trainer->restore(checkpoint->tensors);
    } catch (const Error& error) {
      fail(error.code(), settings_.checkpoint_path + ": " + error.what());
    }
    checkpoint.reset();
  }
  trainer_ = std::move(trainer);
  const auto ends = [this] {
    std::lock_guard<std::mutex> lock(mutex_);
    has_ended_ = true;
  };
  try {
    trainer_->run(*this, &progress);
  } catch (...) {
    ends();
    throw;
  }
  ends();
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

void FitSession::preview(SplatCloud cloud, SplatQuantities seen) {
  SeenCloud shared(std::move(cloud), std::move(seen));
  std::lock_guard<std::mutex> lock(mutex_);
  preview_ = std::move(shared);
  preview_iteration_ = trainer_->iteration();
}

void FitSession::save(const TensorTable& table) {
  writeCheckpoint(settings_json_, table, settings_.checkpoint_path);
}

StippleFitFigures FitSession::figuresNow() const {
  std::lock_guard<std::mutex> lock(mutex_);
  const double unknown = std::numeric_limits<double>::quiet_NaN();
  StippleFitFigures out = {};
  out.measured_on_training = split_.held_out.empty();
  out.iteration = figures_.iteration;
  out.iterations = figures_.iterations;
  out.splat_count = figures_.splat_count;
  out.best_iteration = figures_.best_iteration;
  out.loss = figures_.loss;
  out.psnr = figures_.psnr.value_or(unknown);
  out.best_psnr = figures_.best_psnr.value_or(unknown);
  out.seconds = figures_.seconds;
  out.seconds_left = figures_.seconds_left;
  out.estimated_seconds = figures_.estimated_seconds.value_or(0);
  out.estimated_bytes = figures_.estimated_bytes.value_or(0);
  out.note_count = notes_.size();
  out.preview_iteration = preview_iteration_;
  std::snprintf(out.stage, sizeof(out.stage), "%s", stage_.c_str());
  return out;
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

ModelParts FitSession::model() const {
  FitModel& model = ended().model();
  std::optional<FieldResult> learned = fieldResult(model);
  if (!learned) {
    fail(ErrorCode::kUnsupported, std::string("the ") + model.name() +
                                      " model has no field; its splats can be made a hierarchy");
  }
  auto notes = std::make_shared<const ModelNotes>(ModelNotes{settings_json_, {}});
  return {
      FieldSource{std::make_shared<const OctreeDensity>(std::move(learned->density)),
                  std::make_shared<const FieldDecoder>(std::move(learned->field)), learned->draws},
      std::move(notes)};
}

}  // namespace stipple::api
