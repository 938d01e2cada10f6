#pragma once

#include <stipple/stipple.h>

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <variant>

#include "api/handles.h"
#include "base/progress.h"

namespace stipple::api {

/// What a job leaves: nothing (it filled the caller's buffers), a model, a cloud or a volume.
using JobResult = std::variant<std::monostate, ModelParts, std::shared_ptr<const SplatCloud>,
                               std::shared_ptr<const SparseVolume>>;

/// Work of a job: runs on the job's own thread within the context's thread limit. It owns shares of
/// all that it uses, apart from the caller's buffers.
using JobWork = std::function<JobResult(Progress&)>;

StippleJob* startJob(Context context, JobWork work);

}  // namespace stipple::api

struct StippleJob {
  ~StippleJob();

  stipple::api::Context context;
  stipple::Progress progress;
  std::thread thread;

  mutable std::mutex mutex;  ///< of what follows
  mutable std::condition_variable ended;
  StippleJobState state = STIPPLE_JOB_RUNNING;
  StippleStatus status = STIPPLE_OK;
  std::string message;
  stipple::api::JobResult result;
};
