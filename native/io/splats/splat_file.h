#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "io/splats/splat_format.h"

namespace stipple {

/// Reads a splat file; the format is told by its first bytes, then by its extension.
/// Errors: kIo (cannot be opened), kFormat (what is wrong and where), kUnsupported.
SplatCloud readSplatFile(const std::string& path, Progress* progress = nullptr);

/// Writes by the extension of the path; under a temporary name, then renamed. Harmonics that the
/// format or the options leave no room for are cut off, positions turned to the frame of the format
/// or the options.
void writeSplatFile(const SplatCloud& cloud, const std::string& path,
                    const SplatWriteOptions& options, Progress* progress = nullptr);

/// The cloud as a format takes it, turned and cut off as writeSplatFile does it; nothing where it
/// is that already. In: a valid cloud. Errors: kInvalidArgument for a limit of the degree out of
/// range.
std::optional<SplatCloud> asWritten(const SplatCloud& cloud, const SplatFormat& format,
                                    const SplatWriteOptions& options);

/// Writes the levels of a streamed SOG scene (sog_levels.h), each turned and cut off as
/// writeSplatFile does it.
void writeSplatLevels(const std::vector<const SplatCloud*>& levels, const SplatCloud* environment,
                      const std::string& path, const SplatWriteOptions& options,
                      Progress* progress = nullptr);

}  // namespace stipple
