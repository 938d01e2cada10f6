#include "io/assets/asset_time.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "io/bytes/json_text.h"

namespace stipple {

namespace {

constexpr char kTime[] = "time";
constexpr char kBegin[] = "begin";
constexpr char kEnd[] = "end";

}  // namespace

std::string settingsWithTime(const std::string& settings_json, const AssetTime& time) {
  nlohmann::json settings =
      parseJson(settings_json, "the settings", ErrorCode::kInvalidArgument);
  settings[kTime] = {{kBegin, time.begin}, {kEnd, time.end}};
  return settings.dump();
}

std::optional<AssetTime> timeOfSettings(const std::string& settings_json, const std::string& path) {
  const nlohmann::json settings = parseJson(settings_json, path + ": the text of its settings");
  if (!settings.is_object()) {
    fail(ErrorCode::kFormat, path + ": its settings are not an object of JSON");
  }
  if (!settings.contains(kTime)) return std::nullopt;
  const nlohmann::json& stored = settings[kTime];
  const auto number = [&](const char* key) {
    if (!stored.is_object() || !stored.contains(key) || !stored[key].is_number()) {
      fail(ErrorCode::kFormat, path + ": the time of its settings has no number '" + key + "'");
    }
    return stored[key].get<double>();
  };
  const AssetTime time = {number(kBegin), number(kEnd)};
  if (!std::isfinite(time.begin) || !std::isfinite(time.end) || time.begin > time.end) {
    fail(ErrorCode::kFormat, path + ": the time of its settings is " + std::to_string(time.begin) +
                                 " to " + std::to_string(time.end) +
                                 " s; finite numbers in order are needed");
  }
  return time;
}

}  // namespace stipple
