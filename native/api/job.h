#pragma once

#include <stipple/stipple.h>

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <variant>

#include "api/guard.h"
#include "api/handles.h"
#include "base/progress.h"
#include "base/stopwatch.h"

namespace stipple {

class FitSession;
class GenerateSession;
class RegistrationWatch;
class TrainingSession;
struct RegisteredMesh;

}  // namespace stipple

namespace stipple::api {

/// What a job leaves: nothing (it filled the caller's buffers), a model, a cloud, what density
/// control saw with it, a volume, a mesh, a report of accuracy, what is known of weights, how
/// splats are bound to a mesh, or a mesh that took another shape.
using JobResult =
    std::variant<std::monostate, std::shared_ptr<const SplatModel>,
                 std::shared_ptr<const SplatCloud>, std::shared_ptr<const SparseVolume>,
                 std::shared_ptr<const TriMesh>, std::shared_ptr<const MeasuredAccuracy>, SeenCloud,
                 std::shared_ptr<const WeightsFolder>, std::shared_ptr<const SurfaceBinding>,
                 std::shared_ptr<const RegisteredMesh>>;

/// Work of a job: runs on the job's own thread within the context's thread limit. It owns shares of
/// all that it uses, apart from the caller's buffers.
using JobWork = std::function<JobResult(Progress&)>;

/// In: fit, of a job of fitting, generation, of one that makes splats of an image, adaptation, of
/// one that adapts a mesh, training, of one that trains networks: what can be asked while it runs
/// and after any end of it.
StippleJob* startJob(Context context, JobWork work, std::shared_ptr<FitSession> fit = nullptr,
                     std::shared_ptr<GenerateSession> generation = nullptr,
                     std::shared_ptr<RegistrationWatch> adaptation = nullptr,
                     std::shared_ptr<TrainingSession> training = nullptr);

}  // namespace stipple::api

struct StippleJob {
  ~StippleJob();

  stipple::api::Context context;
  stipple::Progress progress;
  std::shared_ptr<stipple::FitSession> fit;                ///< null of other jobs
  std::shared_ptr<stipple::GenerateSession> generation;    ///< likewise
  std::shared_ptr<stipple::RegistrationWatch> adaptation;  ///< likewise
  std::shared_ptr<stipple::TrainingSession> training;      ///< likewise
  std::thread thread;
  const stipple::Stopwatch watch;

  mutable std::mutex mutex;  ///< of what follows
  mutable std::condition_variable ended;
  StippleJobState state = STIPPLE_JOB_RUNNING;
  StippleStatus status = STIPPLE_OK;
  std::string message;
  double seconds = 0.0;  ///< that it took, of one that has ended
  stipple::api::JobResult result;
};

namespace stipple::api {

/// What can be asked of a job while it runs. In: kept: of StippleJob; what: the end of the message
/// where it has none ("trains no networks").
template <typename T>
T& keptSession(const StippleJob* job, std::shared_ptr<T> StippleJob::*kept, const char* what) {
  const std::shared_ptr<T>& session = require(job, "job").*kept;
  if (!session) fail(ErrorCode::kInvalidArgument, std::string("this job ") + what);
  return *session;
}

/// The result of the wanted kind, or an error that says what the job is or did.
template <typename T>
const T& jobResult(const StippleJob& job, const char* kind) {
  std::lock_guard<std::mutex> lock(job.mutex);
  if (job.state != STIPPLE_JOB_DONE) {
    fail(ErrorCode::kInvalidArgument,
         "the job has not ended well; wait for it and look at its status before its result");
  }
  const T* value = std::get_if<T>(&job.result);
  if (!value) fail(ErrorCode::kInvalidArgument, std::string("this job does not make a ") + kind);
  return *value;
}

}  // namespace stipple::api
