#include <cstdio>
#include <memory>

#include "api/guard.h"
#include "api/handles.h"
#include "api/job.h"
#include "base/parallel.h"
#include "fit/training/encode_object.h"
#include "fit/training/training_session.h"

using namespace stipple;
using namespace stipple::api;

namespace {

TrainingSession& sessionOf(const StippleJob* job) {
  return keptSession(job, &StippleJob::training, "trains no networks");
}

}  // namespace

extern "C" {

StippleStatus stipple_train_start(StippleContext* context, const char* config_path, uint32_t resume,
                                  StippleJob** job) {
  return guarded([&] {
    require(context, "context");
    require(config_path, "config_path");
    require(job, "job");
    const bool resumes = enumValue<uint32_t>(resume, 1, "resume") == 1;
    auto session =
        std::make_shared<TrainingSession>(context->state->backends, config_path, resumes);
    uint64_t bytes = 0;
    withThreads(context->state->thread_count, [&] { bytes = session->memoryBound(); });
    context->state->requireMemory(bytes, "this training");
    *job = startJob(
        context->state,
        [session](Progress& progress) -> JobResult {
          session->run(progress);
          return JobResult{};
        },
        nullptr, nullptr, nullptr, session);
  });
}

StippleStatus stipple_train_figures(const StippleJob* job, StippleTrainFigures* figures) {
  return guarded([&] {
    const TrainingStatus status = sessionOf(job).status();
    StippleTrainFigures out = {};
    out.measured_on_training = status.held_out == 0 ? 1 : 0;
    out.step = status.step;
    out.steps = status.steps;
    out.resumed_step = status.resumed_step;
    out.skipped_steps = status.skipped;
    out.object_count = status.objects;
    out.held_out_count = status.held_out;
    out.best_step = status.best_step;
    out.note_count = status.note_count;
    out.budget_count = status.budget_count;
    out.loss = status.loss;
    out.structure = status.structure;
    out.psnr = status.psnr;
    out.seconds = status.seconds;
    out.seconds_left = status.seconds_left;
    std::snprintf(out.stage, sizeof(out.stage), "%s", status.stage.c_str());
    deliver(figures, out, "figures");
  });
}

StippleStatus stipple_train_note(const StippleJob* job, uint64_t index, const char** text) {
  return guarded([&] {
    require(text, "text");
    *text = sessionOf(job).noteAt(index);
  });
}

StippleStatus stipple_train_budget(const StippleJob* job, uint64_t index,
                                   StippleTrainBudget* budget) {
  return guarded([&] {
    const TrainingMeasure measure = sessionOf(job).budgetAt(index);
    StippleTrainBudget out = {};
    out.anchors = measure.anchors;
    out.object_count = measure.objects;
    out.psnr = measure.psnr;
    out.ssim = measure.ssim;
    out.training_psnr = measure.training_psnr;
    out.coarse_psnr = measure.coarse_psnr;
    out.cut_psnr = measure.cut_psnr;
    out.coarse_splats = measure.coarse_splats;
    deliver(budget, out, "budget");
  });
}

StippleStatus stipple_encode_start(StippleContext* context, const char* weights_path,
                                   const char* object_path, uint32_t token_count,
                                   StippleJob** job) {
  return guarded([&] {
    require(context, "context");
    require(weights_path, "weights_path");
    require(object_path, "object_path");
    require(job, "job");
    const EncodeRequest request = {weights_path, object_path, token_count};
    context->state->requireMemory(encodeMemoryBound(request), "encoding an object");
    *job = startJob(context->state, [request](Progress& progress) -> JobResult {
      return encodeObject(request, &progress);
    });
  });
}

}  // extern "C"
