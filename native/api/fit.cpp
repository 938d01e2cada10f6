#include <cstdio>
#include <limits>
#include <utility>

#include "api/conversions.h"
#include "api/guard.h"
#include "api/handles.h"
#include "api/job.h"
#include "api/plot.h"
#include "base/parallel.h"
#include "fit/fit_session.h"
#include "io/assets/checkpoint.h"
#include "io/reports/fit_report.h"

using namespace stipple;
using namespace stipple::api;

namespace {

FitSession& sessionOf(const StippleJob* job) {
  return keptSession(job, &StippleJob::fit, "does not fit splats to views");
}

StippleFitFigures figuresTo(const FitStatus& status) {
  const double unknown = std::numeric_limits<double>::quiet_NaN();
  const FitFigures& figures = status.figures;
  StippleFitFigures out = {};
  out.measured_on_training = status.is_measured_on_training;
  out.iteration = figures.iteration;
  out.iterations = figures.iterations;
  out.splat_count = figures.splat_count;
  out.best_iteration = figures.best_iteration;
  out.loss = figures.loss;
  out.psnr = figures.psnr.value_or(unknown);
  out.best_psnr = figures.best_psnr.value_or(unknown);
  out.seconds = figures.seconds;
  out.seconds_left = figures.seconds_left;
  out.estimated_seconds = figures.estimated_seconds.value_or(0);
  out.estimated_bytes = figures.estimated_bytes.value_or(0);
  out.note_count = status.note_count;
  out.preview_iteration = status.preview_iteration;
  out.best_moving_psnr = figures.best_moving_psnr.value_or(unknown);
  std::snprintf(out.stage, sizeof(out.stage), "%s", status.stage.c_str());
  return out;
}

/// In: start: null for splats of its own.
StippleJob* startedFit(StippleContext& context, const StippleViews& views,
                       const StippleFitOptions* options, std::shared_ptr<const SplatCloud> start) {
  auto session = std::make_shared<FitSession>(context.state->backends, sourceOf(views),
                                              fitOptionsFrom(options), std::move(start));
  context.state->requireMemory(session->memoryBound(), "this fit");
  return startJob(
      context.state,
      [session](Progress& progress) -> JobResult {
        session->run(progress);
        return {};
      },
      session);
}

}  // namespace

namespace stipple::api {

std::shared_ptr<const ViewSource> sourceOf(const StippleViews& views) {
  if (!views.source) {
    fail(ErrorCode::kInvalidArgument, "the views are cameras without images; a fit needs images");
  }
  return views.source;
}

}  // namespace stipple::api

extern "C" {

StippleStatus stipple_fit_start(StippleContext* context, const StippleViews* views,
                                const StippleFitOptions* options, StippleJob** job) {
  return guarded([&] {
    require(context, "context");
    require(views, "views");
    require(job, "job");
    *job = startedFit(*context, *views, options, nullptr);
  });
}

StippleStatus stipple_fit_start_from(StippleContext* context, const StippleCloud* cloud,
                                     const StippleViews* views, const StippleFitOptions* options,
                                     StippleJob** job) {
  return guarded([&] {
    require(context, "context");
    require(views, "views");
    require(job, "job");
    *job = startedFit(*context, *views, options, require(cloud, "cloud").cloud);
  });
}

StippleStatus stipple_fit_memory_bound(const StippleViews* views, const StippleFitOptions* options,
                                       uint64_t* bytes) {
  return guarded([&] {
    const std::shared_ptr<const ViewSource> source = sourceOf(require(views, "views"));
    require(bytes, "bytes") = FitSession::memoryBound(*source, fitOptionsFrom(options));
  });
}

StippleStatus stipple_fit_figures(const StippleJob* job, StippleFitFigures* figures) {
  return guarded([&] { deliver(figures, figuresTo(sessionOf(job).status()), "figures"); });
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

StippleStatus stipple_fit_watch_time(StippleJob* job, double seconds) {
  return guarded([&] { sessionOf(job).watchTime(seconds); });
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
    *model = new StippleModel{job->context, sessionOf(job).model()};
  });
}

StippleStatus stipple_fit_places_check(const char* report_path_utf8,
                                       const char* checkpoint_path_utf8) {
  return guarded([&] {
    if (report_path_utf8) requireFitReportPlace(report_path_utf8);
    if (checkpoint_path_utf8) requireCheckpointPlace(checkpoint_path_utf8);
  });
}

StippleStatus stipple_fit_report_save(const StippleJob* job, const char* path_utf8) {
  return guarded([&] { sessionOf(job).saveReport(&require(path_utf8, "path_utf8")); });
}

StippleStatus stipple_fit_report_draw(const StippleJob* job, double scale, uint64_t capacity,
                                      float* pixels, uint32_t* width, uint32_t* height) {
  return guarded([&] {
    deliverPlot(sheetOf(fitPlots(sessionOf(job).history())), scale, capacity, pixels, width,
                height);
  });
}

}  // extern "C"
