#pragma once

#include <stipple/stipple.h>

#include <memory>

#include "data/views/view_source.h"

namespace stipple::api {

/// The images of views. Errors: kInvalidArgument where there are cameras alone.
std::shared_ptr<const ViewSource> sourceOf(const StippleViews& views);

}  // namespace stipple::api
