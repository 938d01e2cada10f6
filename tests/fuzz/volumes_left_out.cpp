// OpenVDB's headers take minutes to compile with the sanitizers, and reading its files is its own
// work: the fuzzers' libstipple_media has no volumes.
#include "base/error.h"
#include "io/media/media_calls.h"

namespace stipple::media {

namespace {

void reportLeftOut(StippleMediaStatus* status) {
  report(status, static_cast<int>(ErrorCode::kUnavailable), "volumes are left out of this library");
}

}  // namespace

void stipple_media_volume_write(const char*, const StippleMediaVolume*,
                                StippleMediaStatus* status) {
  reportLeftOut(status);
}

void stipple_media_volume_read(const char*, double*, double*, const StippleMediaSink*,
                               StippleMediaStatus* status) {
  reportLeftOut(status);
}

void stipple_media_volume_surface(const StippleMediaVolume*, double, double,
                                  const StippleMediaSink*, StippleMediaStatus* status) {
  reportLeftOut(status);
}

}  // namespace stipple::media
