#include <stipple/stipple.h>

#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "api/conversions.h"
#include "api/guard.h"
#include "api/handles.h"
#include "base/parallel.h"
#include "io/splats/splat_format.h"
#include "io/usd/usd_splats.h"

using namespace stipple;
using namespace stipple::api;

struct StippleSeriesReader {
  Context context;
  std::string path;
  std::unique_ptr<UsdSplatsReader> reader;
};

extern "C" {

StippleStatus stipple_series_reader_create(StippleContext* context, const char* path_utf8,
                                           StippleSeriesReader** reader) {
  return guarded([&] {
    require(context, "context");
    require(reader, "reader");
    const std::string path = &require(path_utf8, "path_utf8");
    const SplatFormat* format = splatFormatOfContent(path);
    if (format == nullptr || !format->holds_times) {
      fail(ErrorCode::kUnsupported,
           path + " is no file that may hold a series in one; .usda, .usd and .usdz can");
    }
    withThreads(context->state->thread_count, [&] {
      *reader =
          new StippleSeriesReader{context->state, path, std::make_unique<UsdSplatsReader>(path)};
    });
  });
}

void stipple_series_reader_free(StippleSeriesReader* reader) {
  delete reader;
}

StippleStatus stipple_series_reader_info(const StippleSeriesReader* reader,
                                         StippleSeriesInfo* info) {
  return guarded([&] {
    const UsdSplatsReader& open = *require(reader, "reader").reader;
    StippleSeriesInfo out = {};
    out.frame_count = open.times().size();
    out.frames_per_second = open.framesPerSecond();
    deliver(info, out, "info");
  });
}

StippleStatus stipple_series_reader_read(StippleSeriesReader* reader, uint64_t index, double* frame,
                                         StippleCloud** cloud) {
  return guarded([&] {
    UsdSplatsReader& open = *require(reader, "reader").reader;
    require(frame, "frame");
    require(cloud, "cloud");
    const std::vector<double>& times = open.times();
    if (index >= std::max<size_t>(times.size(), 1)) {
      fail(ErrorCode::kInvalidArgument, "index is " + std::to_string(index) + "; " + reader->path +
                                            " has splats at " + std::to_string(times.size()) +
                                            " times");
    }
    const double time = times.empty() ? 0.0 : times[static_cast<size_t>(index)];
    withThreads(reader->context->thread_count, [&] {
      auto splats =
          std::make_shared<const SplatCloud>(times.empty() ? open.still(nullptr) : open.at(time));
      requireRoom(*splats, reader->path, *reader->context);
      *cloud = new StippleCloud{reader->context, std::move(splats)};
    });
    *frame = time;
  });
}

}  // extern "C"
