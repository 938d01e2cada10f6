#include "api/job.h"

#include <cstdio>
#include <utility>

#include "api/guard.h"
#include "base/parallel.h"

namespace stipple::api {

namespace {

void run(StippleJob& job, JobWork work) {
  JobResult result;
  const StippleStatus status = guarded([&] {
    withThreads(job.context->thread_count, [&] { result = work(job.progress); });
    job.progress.throwIfCancelled();
  });
  const std::string message = stipple_last_error_message();
  work = nullptr;  // the shares go before anybody hears that the job has ended
  std::lock_guard<std::mutex> lock(job.mutex);
  job.status = status;
  job.message = message;
  job.seconds = job.watch.seconds();
  if (status == STIPPLE_OK) {
    job.result = std::move(result);
    job.state = STIPPLE_JOB_DONE;
  } else {
    job.state = status == STIPPLE_ERROR_CANCELLED ? STIPPLE_JOB_CANCELLED : STIPPLE_JOB_FAILED;
  }
  job.ended.notify_all();
}

}  // namespace

StippleJob* startJob(Context context, JobWork work, std::shared_ptr<FitSession> fit,
                     std::shared_ptr<GenerateSession> generation,
                     std::shared_ptr<RegistrationWatch> adaptation,
                     std::shared_ptr<TrainingSession> training) {
  auto job = std::make_unique<StippleJob>();
  job->context = std::move(context);
  job->fit = std::move(fit);
  job->generation = std::move(generation);
  job->adaptation = std::move(adaptation);
  job->training = std::move(training);
  StippleJob* address = job.get();
  job->thread =
      std::thread([address, work = std::move(work)]() mutable { run(*address, std::move(work)); });
  return job.release();
}

}  // namespace stipple::api

using namespace stipple::api;

StippleJob::~StippleJob() {
  progress.cancel();
  if (thread.joinable()) thread.join();
}

extern "C" {

StippleStatus stipple_job_poll(const StippleJob* job, StippleJobProgress* progress) {
  return guarded([&] {
    require(job, "job");
    StippleJobProgress out = {};
    out.fraction = job->progress.fraction();
    std::snprintf(out.stage, sizeof(out.stage), "%s", job->progress.stage().c_str());
    {
      std::lock_guard<std::mutex> lock(job->mutex);
      out.state = job->state;
      out.seconds = out.state == STIPPLE_JOB_RUNNING ? job->watch.seconds() : job->seconds;
    }
    if (out.state == STIPPLE_JOB_DONE) out.fraction = 1.0;
    deliver(progress, out, "progress");
  });
}

StippleStatus stipple_job_cancel(StippleJob* job) {
  return guarded([&] { require(job, "job").progress.cancel(); });
}

StippleStatus stipple_job_wait(StippleJob* job) {
  StippleStatus ended = STIPPLE_OK;
  const StippleStatus status = guarded([&] {
    std::unique_lock<std::mutex> lock(require(job, "job").mutex);
    job->ended.wait(lock, [&] { return job->state != STIPPLE_JOB_RUNNING; });
    ended = job->status;
    setLastError(job->message.c_str());
  });
  return status == STIPPLE_OK ? ended : status;
}

void stipple_job_free(StippleJob* job) {
  delete job;
}

StippleStatus stipple_job_model(const StippleJob* job, StippleModel** model) {
  return guarded([&] {
    const auto& made =
        jobResult<std::shared_ptr<const stipple::SplatModel>>(require(job, "job"), "model");
    require(model, "model") = new StippleModel{job->context, made};
  });
}

StippleStatus stipple_job_cloud(const StippleJob* job, StippleCloud** cloud) {
  return guarded([&] {
    {
      std::lock_guard<std::mutex> lock(require(job, "job").mutex);
      if (const auto* made = std::get_if<stipple::SeenCloud>(&job->result)) {
        require(cloud, "cloud") = new StippleCloud{job->context, made->cloud, made->seen};
        return;
      }
    }
    const auto& made = jobResult<std::shared_ptr<const stipple::SplatCloud>>(*job, "cloud");
    require(cloud, "cloud") = new StippleCloud{job->context, made};
  });
}

StippleStatus stipple_job_volume(const StippleJob* job, StippleVolume** volume) {
  return guarded([&] {
    const auto& made =
        jobResult<std::shared_ptr<const stipple::SparseVolume>>(require(job, "job"), "volume");
    require(volume, "volume") = new StippleVolume{job->context, made};
  });
}

}  // extern "C"
