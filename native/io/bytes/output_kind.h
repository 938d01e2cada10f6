#pragma once

#include <cstddef>
#include <functional>
#include <string>

namespace stipple {

/// Refuses a place where a file cannot be written, or would replace one of another kind: whatever
/// its extension says, a report must not take the place of a model. An empty file may be replaced.
/// In: what, such as "a checkpoint"; is_of_kind, asked of a file with content; what it throws means
/// no. Errors: kIo with the reason; kInvalidArgument for a file of another kind.
void requireOutputKind(const std::string& path, const std::string& what,
                       const std::function<bool(const std::string&)>& is_of_kind);

/// The first bytes of a file, at most so many. Errors: kIo.
std::string headOfFile(const std::string& path, size_t limit);

}  // namespace stipple
