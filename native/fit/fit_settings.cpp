#include "fit/fit_settings.h"

#include <cstdio>
#include <vector>

#include "base/error.h"
#include "base/random.h"
#include "fit/fit_option_table.h"
#include "io/assets/flat_json.h"
#include "io/bytes/quoted_text.h"

namespace stipple {

namespace {

constexpr const char* kViewCount = "views";
constexpr const char* kViewsKey = "views_key";
constexpr const char* kStartKey = "start_key";

std::string exact(double value) {
  char text[40];
  std::snprintf(text, sizeof(text), "%.17g", value);
  return text;
}

void mixBytes(uint64_t& key, const void* bytes, size_t count) {
  const auto* from = static_cast<const unsigned char*>(bytes);
  for (size_t i = 0; i < count; ++i) key = mixBits(key ^ from[i]);
}

std::string keyText(uint64_t key) {
  char text[24];
  std::snprintf(text, sizeof(text), "%016llx", static_cast<unsigned long long>(key));
  return text;
}

/// Tells clouds apart by all their numbers.
uint64_t keyOf(const SplatCloud& cloud) {
  uint64_t key = cloud.size();
  for (const std::vector<float>* values :
       {&cloud.positions, &cloud.rotations, &cloud.scales, &cloud.opacities, &cloud.sh}) {
    mixBytes(key, values->data(), values->size() * sizeof(float));
  }
  return key;
}

/// Tells sets of views apart by their names, cameras and times.
uint64_t keyOf(const ViewSource& views) {
  uint64_t key = views.count();
  const auto mix = [&key](const void* bytes, size_t count) { mixBytes(key, bytes, count); };
  for (size_t v = 0; v < views.count(); ++v) {
    const std::string name = views.name(v);
    const Camera& camera = views.camera(v);
    const double numbers[] = {camera.fx,
                              camera.fy,
                              camera.cx,
                              camera.cy,
                              static_cast<double>(camera.width),
                              static_cast<double>(camera.height)};
    mix(name.data(), name.size());
    mix(numbers, sizeof(numbers));
    mix(camera.world_to_camera.data(), 16 * sizeof(double));
    // Keys of views without times are those of checkpoints from before there were any.
    const double time = views.time(v);
    if (time != 0) mix(&time, sizeof(time));
  }
  return key;
}

bool isStored(const FitOption& option, FitKind model) {
  return (option.stored_of & (1u << static_cast<uint32_t>(model))) != 0;
}

std::string jsonOf(const FitOption& option, const FitValue& value) {
  if (const auto* text = std::get_if<std::string>(&value)) return quotedText(*text);
  if (const auto* number = std::get_if<double>(&value)) return exact(*number);
  if (option.is_stored_as_word) return quotedText(fitValueText(option, value));
  return std::to_string(std::get<uint64_t>(value));
}

/// A value of the JSON, as a user would write it.
std::string textOf(const FlatJsonValue& value) {
  if (const auto* count = std::get_if<uint64_t>(&value)) return std::to_string(*count);
  if (const auto* number = std::get_if<double>(&value)) return exact(*number);
  return std::get<std::string>(value);
}

}  // namespace

FitSettings settingsOf(const FitOptions& options, const ViewSource& views,
                       const SplatCloud* start) {
  return {options, views.count(), keyText(keyOf(views)),
          start == nullptr ? std::string() : keyText(keyOf(*start))};
}

std::string settingsJson(const FitSettings& settings) {
  std::string text = "{";
  const auto add = [&text](const char* name, const std::string& value) {
    text += (text.size() > 1 ? ", \"" : "\"") + std::string(name) + "\": " + value;
  };
  for (const FitOption& option : fitOptionTable()) {
    if (!isStored(option, settings.options.model)) continue;
    add(*option.stored_name ? option.stored_name : option.name,
        jsonOf(option, option.member.get(settings.options)));
  }
  add(kViewCount, std::to_string(settings.view_count));
  add(kViewsKey, quotedText(settings.views_key));
  if (!settings.start_key.empty()) add(kStartKey, quotedText(settings.start_key));
  return text + "}";
}

FitSettings readSettings(const std::string& json) {
  FitSettings settings;
  settings.options = defaultFitOptions();
  try {
    for (const auto& [name, value] : readFlatJson(json)) {
      const std::string text = textOf(value);
      if (name == kViewCount) {
        settings.view_count = std::get<uint64_t>(value);
      } else if (name == kViewsKey) {
        settings.views_key = text;
      } else if (name == kStartKey) {
        settings.start_key = text;
      } else {
        double unit = 1;
        const FitOption* option = findFitOption(name, &unit);
        if (!option) fail(ErrorCode::kFormat, "'" + name + "' is no option of a fit");
        option->member.set(settings.options, fitValueFrom(*option, text, name, unit));
      }
    }
  } catch (const std::exception& error) {
    fail(ErrorCode::kFormat, std::string("the settings of a fit cannot be read: ") + error.what());
  }
  settings.options = resolved(std::move(settings.options));
  return settings;
}

void requireSameSettings(const std::string& stored_json, const FitSettings& wanted,
                         const std::string& path) {
  if (stored_json == settingsJson(wanted)) return;
  FitSettings stored;
  try {
    stored = readSettings(stored_json);
  } catch (const Error& error) {
    fail(error.code(), path + ": " + error.what());
  }
  const auto refuse = [&path](const std::string& what, const std::string& was,
                              const std::string& is) {
    fail(ErrorCode::kInvalidArgument, path + " is of a fit whose " + what + " was " + was +
                                          "; now it is " + is + ", and resuming needs the same");
  };
  for (const FitOption& option : fitOptionTable()) {
    if (!isStored(option, wanted.options.model)) continue;
    const FitValue was = option.member.get(stored.options);
    const FitValue is = option.member.get(wanted.options);
    if (was != is) refuse(option.name, fitValueText(option, was), fitValueText(option, is));
  }
  if (stored.view_count != wanted.view_count) {
    refuse("number of views", std::to_string(stored.view_count), std::to_string(wanted.view_count));
  }
  if (stored.views_key != wanted.views_key) {
    fail(ErrorCode::kInvalidArgument,
         path + " is of a fit to other views; resuming needs the same cameras and names");
  }
  if (stored.start_key != wanted.start_key) {
    const std::string began =
        stored.start_key.empty() ? "without splats to begin with" : "with other splats";
    fail(ErrorCode::kInvalidArgument,
         path + " is of a fit that began " + began + "; resuming needs the same");
  }
}

}  // namespace stipple
