#include <stipple/stipple.h>

#include <memory>
#include <string>

#include "api/conversions.h"
#include "api/guard.h"
#include "api/handles.h"
#include "base/parallel.h"
#include "io/usd/usd_series_writer.h"

using namespace stipple;
using namespace stipple::api;

struct StippleSeriesWriter {
  Context context;
  std::unique_ptr<UsdSeriesWriter> writer;  ///< null: it has finished
};

namespace {

UsdSeriesWriter& requireUnfinished(StippleSeriesWriter* writer) {
  UsdSeriesWriter* open = require(writer, "writer").writer.get();
  if (open == nullptr) {
    fail(ErrorCode::kInvalidArgument, "writer has finished; its file is whole");
  }
  return *open;
}

}  // namespace

extern "C" {

StippleStatus stipple_series_writer_create(StippleContext* context, const char* path_utf8,
                                           double frames_per_second,
                                           const StippleCloudSaveOptions* options,
                                           StippleSeriesWriter** writer) {
  return guarded([&] {
    require(context, "context");
    require(writer, "writer");
    const std::string path = &require(path_utf8, "path_utf8");
    *writer = new StippleSeriesWriter{
        context->state,
        std::make_unique<UsdSeriesWriter>(path, frames_per_second, writeOptions(options))};
  });
}

void stipple_series_writer_free(StippleSeriesWriter* writer) {
  delete writer;
}

StippleStatus stipple_series_writer_add(StippleSeriesWriter* writer, const StippleCloud* cloud,
                                        double frame) {
  return guarded([&] {
    UsdSeriesWriter& open = requireUnfinished(writer);
    require(cloud, "cloud");
    withThreads(writer->context->thread_count, [&] { open.add(*cloud->cloud, frame); });
  });
}

StippleStatus stipple_series_writer_finish(StippleSeriesWriter* writer) {
  return guarded([&] {
    requireUnfinished(writer).finish();
    writer->writer.reset();
  });
}

}  // extern "C"
