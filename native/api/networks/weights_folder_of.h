#pragma once

#include <string>

#include "api/handles.h"

namespace stipple::api {

/// The folder that a caller gives, or the context's where that is NULL. Errors: kInvalidArgument
/// where nobody has said which one. In: name of the argument in the header.
std::string weightsFolderOf(const StippleContext& context, const char* given, const char* name);

}  // namespace stipple::api
