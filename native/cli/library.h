#pragma once

#include <stipple/stipple.h>

#include <memory>
#include <stdexcept>
#include <string>

#include "cli/jobs/signals.h"

namespace stipple::cli {

/// What ends the tool with one line on stderr.
struct Failure : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Throws Failure with the library's message unless status is STIPPLE_OK, and Interrupted where a
/// signal came meanwhile.
inline void check(StippleStatus status) {
  if (status != STIPPLE_OK) throw Failure(stipple_last_error_message());
  throwIfInterrupted();
}

template <typename T, void (*kFree)(T*)>
struct Deleter {
  void operator()(T* handle) const { kFree(handle); }
};
template <typename T, void (*kFree)(T*)>
using Handle = std::unique_ptr<T, Deleter<T, kFree>>;

using Context = Handle<StippleContext, stipple_context_free>;
using Cloud = Handle<StippleCloud, stipple_cloud_free>;
using Mesh = Handle<StippleMesh, stipple_mesh_free>;
using Model = Handle<StippleModel, stipple_model_free>;
using Views = Handle<StippleViews, stipple_views_free>;
using Renderer = Handle<StippleRenderer, stipple_renderer_free>;
using Volume = Handle<StippleVolume, stipple_volume_free>;
using Image = Handle<StippleImage, stipple_image_free>;
using Weights = Handle<StippleWeights, stipple_weights_free>;
using SeriesReader = Handle<StippleSeriesReader, stipple_series_reader_free>;
using SeriesWriter = Handle<StippleSeriesWriter, stipple_series_writer_free>;
using Binding = Handle<StippleBinding, stipple_binding_free>;
using Job = Handle<StippleJob, stipple_job_free>;

/// Calls f(..., &pointer), takes the handle, and checks, so that a signal that came meanwhile frees
/// it.
template <typename Result, typename Function, typename... Arguments>
Result make(Function function, Arguments... arguments) {
  typename Result::pointer made = nullptr;
  const StippleStatus status = function(arguments..., &made);
  Result result(made);
  check(status);
  return result;
}

/// A struct of the header with its size set.
template <typename T>
T sized() {
  T value = {};
  value.struct_size = sizeof(T);
  return value;
}

/// Waits for a job, with its progress on stderr: a bar on a terminal, else a line per stage.
/// Ctrl-C and its like (jobs/signals.h) cancel the job; nothing is left half written.
void finish(const Job& job);

}  // namespace stipple::cli
