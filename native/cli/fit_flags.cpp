#include "cli/fit_flags.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <iterator>
#include <limits>
#include <vector>

namespace stipple::cli {

namespace {

const std::vector<std::string> kQualities = {"fast", "balanced", "fine"};
/// The tool says where checkpoints lie.
constexpr const char* kOwnOption = "checkpoint_path";

std::string flagName(const char* name) {
  std::string flag = "--" + std::string(name);
  std::replace(flag.begin(), flag.end(), '_', '-');
  return flag;
}

std::vector<std::string> wordsOf(const StippleFitOptionInfo& info) {
  return CLI::detail::split(info.choices_utf8, ',');
}

const char* groupOf(const StippleFitOptionInfo& info) {
  constexpr uint32_t kSplats = 1u << STIPPLE_FIT_EXPLICIT | 1u << STIPPLE_FIT_MOTION;
  constexpr uint32_t kScaffold = 1u << STIPPLE_FIT_SCAFFOLD | 1u << STIPPLE_FIT_RELAY;
  if (info.models == kSplats || info.models == (kSplats | kScaffold)) {
    return "Options of explicit splats";
  }
  if (info.models == 1u << STIPPLE_FIT_FIELD) return "Options of fields";
  if (info.models == 1u << STIPPLE_FIT_RELAY) return "Options of relays";
  if (info.models == (1u << STIPPLE_FIT_FIELD | kScaffold))
    return "Options of fields and scaffolds";
  return "Options";
}

const char* typeOf(const StippleFitOptionInfo& info) {
  constexpr std::array<const char*, 6> kTypes = {"INT", "FLOAT", "BYTES", "", "TEXT", "TEXT"};
  return info.kind < kTypes.size() ? kTypes[info.kind] : "TEXT";
}

/// "500 (fast), 2000 (balanced), 4000 (fine)", or one value where all are alike; empty where the
/// presets of the model have none.
std::string presetText(const StippleFitOptionInfo& info, uint32_t model) {
  const size_t count = kQualities.size();
  const char* const* texts = model == STIPPLE_FIT_MOTION     ? info.motion_presets_utf8
                             : model == STIPPLE_FIT_SCAFFOLD ? info.scaffold_presets_utf8
                             : model == STIPPLE_FIT_RELAY    ? info.relay_presets_utf8
                                                             : info.presets_utf8 + model * count;
  if ((info.models & (1u << model)) == 0 || !texts[0] || !*texts[0]) return "";
  std::string all;
  bool is_one = true;
  for (size_t quality = 0; quality < count; ++quality) {
    is_one = is_one && std::strcmp(texts[quality], texts[0]) == 0;
    all +=
        (quality > 0 ? ", " : "") + std::string(texts[quality]) + " (" + kQualities[quality] + ")";
  }
  return is_one ? texts[0] : all;
}

std::string helpOf(const StippleFitOptionInfo& info) {
  const std::string of_splats = presetText(info, STIPPLE_FIT_EXPLICIT);
  const std::string of_fields = presetText(info, STIPPLE_FIT_FIELD);
  std::string preset = of_splats.empty() ? of_fields : of_splats;
  if (!of_splats.empty() && !of_fields.empty() && of_splats != of_fields) {
    preset += "; of a field " + of_fields;
  }
  const std::string of_moving = presetText(info, STIPPLE_FIT_MOTION);
  const std::string of_scaffolds = presetText(info, STIPPLE_FIT_SCAFFOLD);
  const bool is_alone = preset.empty();
  if (!is_alone && !of_moving.empty() && of_moving != of_splats) {
    preset += "; of motion " + of_moving;
  }
  if (!is_alone && !of_scaffolds.empty() && of_scaffolds != of_splats &&
      of_scaffolds != of_fields) {
    preset += "; of a scaffold " + of_scaffolds;
  }
  const std::string of_relays = presetText(info, STIPPLE_FIT_RELAY);
  if (!is_alone && !of_relays.empty() && of_relays != of_scaffolds && of_relays != of_splats) {
    preset += "; of a relay " + of_relays;
  }
  std::string help = info.help_utf8;
  if (!preset.empty()) help += " Default: " + preset + ".";
  if (is_alone && !of_moving.empty()) help += " Of motion the default is " + of_moving + ".";
  const bool has_end = info.maximum < std::numeric_limits<uint32_t>::max();
  if (has_end && info.kind <= STIPPLE_FIT_OPTION_NUMBER) {
    char range[80];
    std::snprintf(range, sizeof(range), " Range: %.10g to %.10g.", info.minimum, info.maximum);
    help += range;
  }
  return help;
}

bool isPreset(const StippleFitOptionInfo& info) {
  return std::any_of(std::begin(info.presets_utf8), std::end(info.presets_utf8),
                     [](const char* text) { return text != nullptr; });
}

}  // namespace

void FitFlags::addTo(CLI::App& command) {
  uint64_t count = 0;
  check(stipple_fit_option_count(&count));
  for (uint64_t i = 0; i < count; ++i) {
    auto info = sized<StippleFitOptionInfo>();
    check(stipple_fit_option_info(i, &info));
    if (std::strcmp(info.name_utf8, kOwnOption) == 0) continue;
    Flag& flag = flags_.emplace_back(Flag{info, flagName(info.name_utf8), {}, {}, {}});
    std::string names = flag.name;
    if (info.kind == STIPPLE_FIT_OPTION_SWITCH) {
      if (std::strcmp(info.default_utf8, "1") == 0) names += ",!--no-" + flag.name.substr(2);
      const auto store = [&flag](int64_t given) { flag.text = given > 0 ? "1" : "0"; };
      command.add_flag_function(names, store, helpOf(info))->group(groupOf(info));
      continue;
    }
    std::string scaled;
    for (size_t j = 0; j < std::size(info.aliases_utf8) && *info.aliases_utf8[j]; ++j) {
      const bool is_scaled = info.alias_units[j] != 1;
      (is_scaled ? scaled : names) += "," + flagName(info.aliases_utf8[j]);
      if (is_scaled && flag.scaled_name.empty()) flag.scaled_name = flagName(info.aliases_utf8[j]);
    }
    CLI::Option* option = command.add_option(names, flag.text, helpOf(info));
    option->group(groupOf(info))->type_name(typeOf(info));
    if (info.kind == STIPPLE_FIT_OPTION_CHOICE) option->check(CLI::IsMember(wordsOf(info)));
    if (!isPreset(info) && *info.default_utf8) option->default_str(info.default_utf8);
    if (!scaled.empty()) {  // hidden, and understood
      command.add_option(scaled.substr(1), flag.scaled_text)->group("");
    }
  }
  command
      .add_option("--quality", quality_,
                  "The quality chooses the defaults that are listed for each: iterations, counts, "
                  "strategy.")
      ->check(CLI::IsMember(kQualities))
      ->capture_default_str();
}

const FitFlags::Flag& FitFlags::flag(const char* name) const {
  for (const Flag& each : flags_) {
    if (std::strcmp(each.info.name_utf8, name) == 0) return each;
  }
  throw Failure(std::string("the library has no option '") + name + "'");
}

void FitFlags::requireModel(const Flag& flag, uint32_t model) const {
  const bool is_default = flag.text && *flag.text == flag.info.default_utf8 && !isPreset(flag.info);
  if (!flag.isGiven() || is_default || (flag.info.models & (1u << model)) != 0) return;
  throw Failure(flag.name + " belongs to --model " +
                (model == STIPPLE_FIT_FIELD ? "explicit" : "field"));
}

StippleFitOptions FitFlags::options(const std::string& checkpoint) const {
  StippleFitOptions options;
  stipple_fit_options_init(&options);
  const Flag& model = flag("model");
  if (model.text) check(stipple_fit_options_set(&options, model.name.c_str(), model.text->c_str()));
  const auto quality = std::find(kQualities.begin(), kQualities.end(), quality_);
  check(stipple_fit_options_preset(&options, options.model,
                                   static_cast<uint32_t>(quality - kQualities.begin())));
  if (flag("strategy").text && flag("density_gradient").text == "0") {
    throw Failure("--no-density-gradient and --strategy say both how a field's density is learned");
  }
  for (const Flag& each : flags_) {
    requireModel(each, options.model);
    const auto set = [&](const std::string& name, const std::optional<std::string>& text) {
      if (text) check(stipple_fit_options_set(&options, name.c_str(), text->c_str()));
    };
    set(each.scaled_name, each.scaled_text);
    set(each.name, each.text);
  }
  if (!flag("min_anchors").isGiven()) {
    options.min_anchors = std::min(options.min_anchors, options.max_anchors);
  }
  options.checkpoint_path_utf8 = checkpoint.c_str();
  return options;
}

}  // namespace stipple::cli
