#include "api/fit.h"

#include <filesystem>
#include <utility>

#include "api/guard.h"
#include "api/job.h"
#include "api/plot.h"
#include "base/parallel.h"
#include "io/reports/fit_report.h"

using namespace stipple;
using namespace stipple::api;

namespace {

/// What a user's choice of quality means.
struct Preset {
  uint64_t iterations;
  uint64_t max_splats;
  uint64_t most_anchors;
  const char* strategy;  // of explicit splats; by docs/methods/fitting.md
};
constexpr Preset kPresets[] = {
    {500, 50000, 8192, "adaptive"},     // fast
    {2000, 150000, 16384, "improved"},  // balanced
    {4000, 500000, 32768, "improved"},  // fine detail
};
constexpr int kDegreeOfExplicit = 3;

StippleFitOptions completedOptions(const StippleFitOptions* options) {
  StippleFitOptions defaults;
  stipple_fit_options_init(&defaults);
  return completed(options, defaults, "options");
}

FitSession& sessionOf(const StippleJob* job) {
  const StippleJob& given = require(job, "job");
  if (!given.fit) fail(ErrorCode::kInvalidArgument, "this job does not fit splats to views");
  return *given.fit;
}

std::string plotPathOf(const std::string& path) {
  return std::filesystem::path(path).replace_extension(".svg").string();
}

}  // namespace

namespace stipple::api {

std::shared_ptr<const ViewSource> sourceOf(const StippleViews& views) {
  if (!views.source) {
    fail(ErrorCode::kInvalidArgument,
         "the views are cameras without pictures; fitting needs pictures");
  }
  return views.source;
}

FitViews splitOf(const StippleViews& views, const ViewSource& source, uint64_t holdout) {
  FitViews split;
  for (size_t v = 0; v < views.notes.size(); ++v) {
    const StippleViewSplit said = views.notes[v].split;
    if (said == STIPPLE_VIEW_SPLIT_TEST) {
      split.held_out.push_back(v);
    } else if (said != STIPPLE_VIEW_SPLIT_VALIDATION) {
      split.training.push_back(v);
    }
  }
  const bool is_said = !split.held_out.empty() && !split.training.empty();
  if (holdout == 0 || !is_said) return splitViews(source, holdout);
  return split;
}

}  // namespace stipple::api

extern "C" {

void stipple_fit_options_init(StippleFitOptions* options) {
  if (!options) return;
  const TrainerOptions trainer;
  const FieldModelOptions field;
  *options = {};
  options->struct_size = sizeof(StippleFitOptions);
  options->background = STIPPLE_FIT_BACKGROUND_RANDOM;
  options->density_gradient = field.density_gradient;
  options->jitter = field.jitter;
  options->holdout = 8;
  options->ssim_share = trainer.ssim_share;
  options->picture_bytes = trainer.picture_bytes;
  options->checkpoint_seconds = 60;
  stipple_fit_options_preset(options, STIPPLE_FIT_EXPLICIT, STIPPLE_FIT_BALANCED);
  options->strategy_utf8 = nullptr;  // so that any model can be set
}

StippleStatus stipple_fit_options_preset(StippleFitOptions* options, uint32_t model,
                                         uint32_t quality) {
  return guarded([&] {
    const bool is_field = enumValue<StippleFitModel>(model, 1, "model") == STIPPLE_FIT_FIELD;
    const Preset& preset =
        kPresets[static_cast<uint32_t>(enumValue<StippleFitQuality>(quality, 2, "quality"))];
    StippleFitOptions chosen = complete(options, "options");
    const FieldModelOptions field;
    chosen.model = model;
    chosen.strategy_utf8 = is_field ? nullptr : preset.strategy;
    chosen.iterations = preset.iterations;
    chosen.max_splats = preset.max_splats;
    chosen.least_anchors = field.least_anchors;
    chosen.most_anchors = preset.most_anchors;
    chosen.gaussians_per_anchor = field.gaussians_per_anchor;
    chosen.sh_degree = static_cast<uint32_t>(is_field ? field.sh_degree : kDegreeOfExplicit);
    chosen.antialias = static_cast<uint32_t>(is_field ? field.antialias : Antialias::kClassic);
    deliver(options, chosen, "options");
  });
}

StippleStatus stipple_fit_start(StippleContext* context, const StippleViews* views,
                                const StippleFitOptions* options, StippleJob** job) {
  return guarded([&] {
    require(context, "context");
    require(views, "views");
    require(job, "job");
    const StippleFitOptions given = completedOptions(options);
    FitSettings settings = fitSettings(given);
    const std::shared_ptr<const ViewSource> source = sourceOf(*views);
    holdToMemory(given.max_bytes, *source, settings);
    context->state->requireMemory(fitMemoryBound(settings, *source), "this fit");
    FitViews split = splitOf(*views, *source, settings.holdout);
    auto session = std::make_shared<FitSession>(context->state->backends, source, std::move(split),
                                                std::move(settings));
    *job = startJob(
        context->state,
        [session](Progress& progress) -> JobResult {
          session->run(progress);
          return {};
        },
        session);
  });
}

StippleStatus stipple_fit_memory_bound(const StippleViews* views, const StippleFitOptions* options,
                                       uint64_t* bytes) {
  return guarded([&] {
    const std::shared_ptr<const ViewSource> source = sourceOf(require(views, "views"));
    const StippleFitOptions given = completedOptions(options);
    FitSettings settings = fitSettings(given);
    holdToMemory(given.max_bytes, *source, settings);
    require(bytes, "bytes") = fitMemoryBound(settings, *source);
  });
}

StippleStatus stipple_fit_figures(const StippleJob* job, StippleFitFigures* figures) {
  return guarded([&] { deliver(figures, sessionOf(job).figuresNow(), "figures"); });
}

StippleStatus stipple_fit_note(const StippleJob* job, uint64_t index, const char** text) {
  return guarded([&] {
    require(text, "text");
    *text = sessionOf(job).noteAt(index);
  });
}

StippleStatus stipple_fit_preview(StippleJob* job, StippleCloud** cloud) {
  return guarded([&] {
    require(cloud, "cloud");
    SeenCloud newest = sessionOf(job).takePreview();
    *cloud = newest.cloud ? new StippleCloud{job->context, newest.cloud, newest.seen} : nullptr;
  });
}

StippleStatus stipple_fit_watch_contributions(StippleJob* job, uint32_t watched) {
  return guarded(
      [&] { sessionOf(job).watchContributions(enumValue<uint32_t>(watched, 1, "watched") == 1); });
}

StippleStatus stipple_fit_cloud(const StippleJob* job, uint64_t budget, StippleCloud** cloud) {
  return guarded([&] {
    require(cloud, "cloud");
    const FitSession& session = sessionOf(job);
    SeenCloud made;
    withThreads(job->context->thread_count, [&] { made = session.decode(budget); });
    *cloud = new StippleCloud{job->context, made.cloud, made.seen};
  });
}

StippleStatus stipple_fit_model(const StippleJob* job, StippleModel** model) {
  return guarded([&] {
    require(model, "model");
    ModelParts parts = sessionOf(job).model();
    *model = new StippleModel{job->context, std::move(parts)};
  });
}

StippleStatus stipple_fit_report_save(const StippleJob* job, const char* path_utf8) {
  return guarded([&] {
    const FitSession& session = sessionOf(job);
    const std::string path = &require(path_utf8, "path_utf8");
    const FitHistory& history = session.ended().history();
    FitReportHead head;
    head.model = session.ended().model().name();
    if (!session.settings().is_field) head.strategy = session.settings().explicit_model.strategy;
    head.settings_json = session.settingsJson();
    writeFitReport(head, history, path);
    writeFitPlots(history, plotPathOf(path));
  });
}

StippleStatus stipple_fit_report_draw(const StippleJob* job, double scale, uint64_t capacity,
                                      float* pixels, uint32_t* width, uint32_t* height) {
  return guarded([&] {
    deliverPlot(sheetOf(fitPlots(sessionOf(job).ended().history())), scale, capacity, pixels, width,
                height);
  });
}

}  // extern "C"
