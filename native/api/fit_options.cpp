#include <cstring>
#include <iterator>
#include <string>
#include <type_traits>
#include <vector>

#include "api/conversions.h"
#include "api/guard.h"
#include "fit/fit_option_table.h"

using namespace stipple;
using namespace stipple::api;

namespace {

/// A field of StippleFitOptions, and the same option here.
struct FieldPair {
  const char* name;
  void (*take)(const StippleFitOptions&, FitOptions&);
  /// Texts are left alone: they belong to the caller.
  void (*give)(const FitOptions&, StippleFitOptions&);
  /// Of texts alone.
  void (*point)(StippleFitOptions&, const char*);
};

template <auto kField, auto kMember>
constexpr FieldPair pairOf(const char* name) {
  using Field = std::remove_cvref_t<decltype(std::declval<StippleFitOptions>().*kField)>;
  using Member = std::remove_cvref_t<decltype(std::declval<FitOptions>().*kMember)>;
  if constexpr (std::is_same_v<Field, const char*>) {
    return {name,
            [](const StippleFitOptions& from, FitOptions& to) {
              to.*kMember = from.*kField ? from.*kField : "";
            },
            nullptr,
            [](StippleFitOptions& to, const char* text) { to.*kField = *text ? text : nullptr; }};
  } else {
    return {name,
            [](const StippleFitOptions& from, FitOptions& to) {
              to.*kMember = static_cast<Member>(from.*kField);
            },
            [](const FitOptions& from, StippleFitOptions& to) {
              to.*kField = static_cast<Field>(from.*kMember);
            },
            nullptr};
  }
}

using C = StippleFitOptions;
using O = FitOptions;

constexpr FieldPair kFields[] = {
    pairOf<&C::model, &O::model>("model"),
    pairOf<&C::strategy_utf8, &O::strategy>("strategy"),
    pairOf<&C::iterations, &O::iterations>("iterations"),
    pairOf<&C::max_splats, &O::max_splats>("max_splats"),
    pairOf<&C::start_splats, &O::start_splats>("start_splats"),
    pairOf<&C::min_anchors, &O::least_anchors>("min_anchors"),
    pairOf<&C::max_anchors, &O::most_anchors>("max_anchors"),
    pairOf<&C::gaussians_per_anchor, &O::gaussians_per_anchor>("gaussians_per_anchor"),
    pairOf<&C::sh_degree, &O::sh_degree>("sh_degree"),
    pairOf<&C::antialias, &O::antialias>("antialias"),
    pairOf<&C::background, &O::background>("background"),
    pairOf<&C::density_gradient, &O::density_gradient>("density_gradient"),
    pairOf<&C::jitter, &O::jitter>("jitter"),
    pairOf<&C::shell, &O::shell>("shell"),
    pairOf<&C::coarse_to_fine, &O::coarse_to_fine>("coarse_to_fine"),
    pairOf<&C::key_frame_spacing, &O::key_frame_spacing>("key_frame_spacing"),
    pairOf<&C::key_frame_blend, &O::key_frame_blend>("key_frame_blend"),
    pairOf<&C::growth_by_level, &O::growth_by_level>("growth_by_level"),
    pairOf<&C::middle_level_rank, &O::middle_level_rank>("middle_level_rank"),
    pairOf<&C::high_level_rank, &O::high_level_rank>("high_level_rank"),
    pairOf<&C::middle_level_weight, &O::middle_level_weight>("middle_level_weight"),
    pairOf<&C::high_level_weight, &O::high_level_weight>("high_level_weight"),
    pairOf<&C::holdout, &O::holdout>("holdout"),
    pairOf<&C::seed, &O::seed>("seed"),
    pairOf<&C::ssim_share, &O::ssim_share>("ssim_share"),
    pairOf<&C::measure_interval, &O::measure_interval>("measure_interval"),
    pairOf<&C::image_bytes, &O::picture_bytes>("image_bytes"),
    pairOf<&C::max_bytes, &O::max_bytes>("max_bytes"),
    pairOf<&C::checkpoint_path_utf8, &O::checkpoint_path>("checkpoint_path"),
    pairOf<&C::checkpoint_interval, &O::checkpoint_interval>("checkpoint_interval"),
    pairOf<&C::checkpoint_seconds, &O::checkpoint_seconds>("checkpoint_seconds"),
    pairOf<&C::resume, &O::resume>("resume"),
};

FitOptions taken(const StippleFitOptions& given) {
  FitOptions options;
  for (const FieldPair& field : kFields) field.take(given, options);
  return options;
}

/// Everything but the texts.
void give(const FitOptions& options, StippleFitOptions& out) {
  for (const FieldPair& field : kFields) {
    if (field.give) field.give(options, out);
  }
}

void pointText(StippleFitOptions& options, const FitOption& option, const char* text) {
  for (const FieldPair& field : kFields) {
    if (field.point && std::strcmp(field.name, option.name) == 0) field.point(options, text);
  }
}

/// The texts of a preset, which the table keeps.
void pointPresetTexts(StippleFitOptions& options, uint32_t model, uint32_t quality) {
  for (const FitOption& option : fitOptionTable()) {
    const char* text = option.presets[model][quality];
    if (text) pointText(options, option, text);
  }
}

StippleFitOptionInfo infoOf(size_t index) {
  const FitOption& option = fitOptionTable()[index];
  StippleFitOptionInfo info = {};
  info.kind = static_cast<uint32_t>(option.kind);
  info.models = option.models;
  info.fixed_models = option.stored_of;
  info.name_utf8 = option.name;
  info.help_utf8 = option.help;
  info.choices_utf8 = option.choices;
  info.minimum = option.minimum;
  info.maximum = option.maximum;
  info.default_utf8 = defaultFitText(index);
  static_assert(sizeof(option.presets) ==
                sizeof(info.presets_utf8) + sizeof(info.motion_presets_utf8) +
                    sizeof(info.scaffold_presets_utf8) + sizeof(info.relay_presets_utf8));
  std::memcpy(info.presets_utf8, option.presets, sizeof(info.presets_utf8));
  std::memcpy(info.motion_presets_utf8, option.presets[STIPPLE_FIT_MOTION],
              sizeof(info.motion_presets_utf8));
  std::memcpy(info.scaffold_presets_utf8, option.presets[STIPPLE_FIT_SCAFFOLD],
              sizeof(info.scaffold_presets_utf8));
  std::memcpy(info.relay_presets_utf8, option.presets[STIPPLE_FIT_RELAY],
              sizeof(info.relay_presets_utf8));
  static_assert(std::size(info.alias_units) == kFitAliasCount);
  for (size_t i = 0; i < kFitAliasCount; ++i) {
    info.aliases_utf8[i] = option.aliases[i].name;
    info.alias_units[i] = option.aliases[i].unit;
  }
  return info;
}

}  // namespace

namespace stipple::api {

FitOptions fitOptionsFrom(const StippleFitOptions* options) {
  StippleFitOptions defaults;
  stipple_fit_options_init(&defaults);
  return taken(completed(options, defaults, "options"));
}

}  // namespace stipple::api

extern "C" {

void stipple_fit_options_init(StippleFitOptions* options) {
  if (!options) return;
  *options = {};
  options->struct_size = sizeof(StippleFitOptions);
  give(defaultFitOptions(), *options);
}

StippleStatus stipple_fit_options_preset(StippleFitOptions* options, uint32_t model,
                                         uint32_t quality) {
  return guarded([&] {
    const auto kind = enumValue<FitKind>(model, kFitKindCount - 1, "model");
    const auto wanted = enumValue<FitQuality>(quality, kFitQualityCount - 1, "quality");
    StippleFitOptions chosen = complete(options, "options");
    FitOptions changed = taken(chosen);
    applyPreset(changed, kind, wanted);
    give(changed, chosen);
    pointPresetTexts(chosen, model, quality);
    deliver(options, chosen, "options");
  });
}

StippleStatus stipple_fit_options_set(StippleFitOptions* options, const char* name_utf8,
                                      const char* value_utf8) {
  return guarded([&] {
    StippleFitOptions chosen = complete(options, "options");
    const std::string name = &require(name_utf8, "name_utf8");
    require(value_utf8, "value_utf8");
    double unit = 1;
    const FitOption* option = findFitOption(name, &unit);
    if (!option) fail(ErrorCode::kInvalidArgument, "'" + name + "' is no option of a fit");
    FitOptions changed = taken(chosen);
    option->member.set(changed, fitValueFrom(*option, value_utf8, name, unit));
    give(changed, chosen);
    if (option->kind == FitOptionKind::kText) pointText(chosen, *option, value_utf8);
    deliver(options, chosen, "options");
  });
}

StippleStatus stipple_fit_option_count(uint64_t* count) {
  return guarded([&] { require(count, "count") = fitOptionTable().size(); });
}

StippleStatus stipple_fit_option_info(uint64_t index, StippleFitOptionInfo* info) {
  return guarded([&] {
    const size_t count = fitOptionTable().size();
    if (index >= count) {
      fail(ErrorCode::kInvalidArgument, "index is " + std::to_string(index) + "; 0 to " +
                                            std::to_string(count - 1) + " is allowed");
    }
    deliver(info, infoOf(index), "info");
  });
}

}  // extern "C"
