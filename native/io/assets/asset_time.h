#pragma once

#include <optional>
#include <string>

namespace stipple {

/// From when to when an asset's splats move, seconds, begin <= end.
struct AssetTime {
  double begin = 0;
  double end = 0;
};

/// The settings of an asset (JSON) with "time": {"begin", "end"} entered; all else stays.
std::string settingsWithTime(const std::string& settings_json, const AssetTime& time);

/// The same read: none where nothing moves. In: path, for messages. Errors: kFormat for settings
/// that are not JSON, or a time that is not two finite numbers in order.
std::optional<AssetTime> timeOfSettings(const std::string& settings_json, const std::string& path);

}  // namespace stipple
