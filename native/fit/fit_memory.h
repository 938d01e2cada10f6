#pragma once

#include <cstdint>

#include "data/clouds/splat_cloud.h"
#include "data/views/view_source.h"
#include "fit/fit_options.h"
#include "train/loop/densify_cloud.h"

namespace stipple {

/// About what looking at views in turn allocates: those that are kept, and one at work. Bytes.
uint64_t pictureMemoryBound(const ViewSource& views, uint64_t picture_bytes);

/// About what a fit allocates, bytes.
uint64_t fitMemoryBound(const FitOptions& options, const ViewSource& views);

/// Lowers picture_bytes, and of explicit splats their number, until the fit stays below about
/// max_bytes, where that is not 0. Errors: kMemoryLimit where one splat, or the field that is asked
/// for, needs more.
void holdToMemory(FitOptions& options, const ViewSource& views);

/// About what density control of a cloud allocates, bytes.
uint64_t densifyMemoryBound(const SplatCloud& cloud, const ViewSource& views,
                            const DensifyOptions& options);

}  // namespace stipple
