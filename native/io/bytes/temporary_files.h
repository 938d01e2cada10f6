#pragma once

#include <filesystem>
#include <string>

namespace stipple {

/// What a temporary file of a process is called, without an extension.
std::string temporaryFileName(long process, unsigned number);

/// Removes what processes that have ended left in a folder. A process looks at a folder when it
/// first writes there, and again a minute later at the earliest: a sequence of images would read it
/// for each of them. A file stays where its process may live: one of this machine has its number,
/// or any, on whichever machine, holds its lock. Never fails.
void sweepTemporaryFiles(const std::filesystem::path& folder);

}  // namespace stipple
