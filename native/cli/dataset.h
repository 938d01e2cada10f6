#pragma once

#include <cstdint>
#include <string>

#include "cli/library.h"

namespace stipple::cli {

/// The views of a data set, whose pictures are read when they are wanted. In: downscale: as
/// --downscale has it.
Views openViews(const Context& context, const std::string& dataset, int64_t downscale);

}  // namespace stipple::cli
