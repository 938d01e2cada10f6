#pragma once

#include <string>
#include <vector>

#include "cli/library.h"

namespace stipple::cli {

/// The splat formats that the library knows.
std::vector<StippleFormatInfo> splatFormats();

/// Name of the format whose extension the path has (the longest that fits), or nothing.
std::string formatOfExtension(const std::string& path);
bool hasSplatExtension(const std::string& path);

/// ".ply, .spz or .splat": the extensions of all formats, or of those that can be written.
std::string splatExtensions(bool written);

/// "RDF" and so on, "unknown" for 0; and back: Failure for another name.
std::string frameName(uint32_t frame);
uint32_t frameOfName(const std::string& name);

}  // namespace stipple::cli
