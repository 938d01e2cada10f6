#pragma once

#include <cstdint>
#include <string>

#include "data/clouds/splat_cloud.h"
#include "data/views/view_source.h"
#include "fit/fit_options.h"

namespace stipple {

/// What a checkpoint and a report say of their fit: everything that its steps depend on.
struct FitSettings {
  FitOptions options;  ///< resolved; what is not stored has its default
  uint64_t view_count = 0;
  std::string views_key;  ///< of their names and cameras
  std::string start_key = {};  ///< of the splats that it begins with; empty: it makes its own
};

/// In: options: resolved; start: the splats that the fit begins with, or null.
FitSettings settingsOf(const FitOptions& options, const ViewSource& views,
                       const SplatCloud* start = nullptr);

/// As a flat JSON object, with the table's options in its order.
std::string settingsJson(const FitSettings& settings);

/// Reads what settingsJson() has written; an option that it does not name has its default, and
/// former names count. Errors: kFormat for text that is no such object, a value out of range and an
/// option that is not there.
FitSettings readSettings(const std::string& json);

/// Refuses to go on with a fit of other settings: the message names the first option that differs,
/// and both values. In: path, of the checkpoint. Errors: kInvalidArgument; those of readSettings()
/// with the path.
void requireSameSettings(const std::string& stored_json, const FitSettings& wanted,
                         const std::string& path);

}  // namespace stipple
