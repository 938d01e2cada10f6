#include "fit/fit_options.h"

#include "base/error.h"
#include "densify/strategies.h"
#include "fit/fit_option_table.h"
#include "train/loop/explicit_model.h"

namespace stipple {

namespace {

constexpr const char* kOwner = "options->";

/// What concerns every model is checked of a model that is not there, too: the model is such.
bool concerns(const FitOption& option, FitKind model) {
  return option.models == kOfEveryModel ||
         (option.models & (1u << static_cast<uint32_t>(model))) != 0;
}

void requireNotAbove(const FitOption& option, const FitOptions& options) {
  const uint64_t value = std::get<uint64_t>(option.member.get(options));
  const uint64_t limit = options.*option.not_above;
  if (value <= limit) return;
  fail(ErrorCode::kInvalidArgument,
       kOwner + std::string(option.name) + " is " + std::to_string(value) + "; " +
           fitValueText(option, static_cast<uint64_t>(option.minimum)) + " to " +
           std::to_string(limit) + " is allowed");
}

/// Fields have few.
void requireFieldStrategy(const std::string& name) {
  std::string known;
  for (const StrategyEntry& entry : fieldStrategyEntries()) {
    if (name == entry.name) return;
    known += (known.empty() ? "" : ", ") + std::string(entry.name);
  }
  fail(ErrorCode::kInvalidArgument,
       "strategy is '" + name + "', which is not one of fields; there is " + known);
}

}  // namespace

FitOptions defaultFitOptions() {
  FitOptions options;
  applyPreset(options, FitKind::kExplicit, FitQuality::kBalanced);
  options.strategy.clear();
  return options;
}

void applyPreset(FitOptions& options, FitKind model, FitQuality quality) {
  options.model = model;
  for (const FitOption& option : fitOptionTable()) {
    const char* text = option.presets[static_cast<size_t>(model)][static_cast<size_t>(quality)];
    if (text) option.member.set(options, fitValueFrom(option, text, option.name));
  }
}

void requireFitOptions(const FitOptions& options) {
  for (const FitOption& option : fitOptionTable()) {
    if (!concerns(option, options.model)) continue;
    requireInRange(option, option.member.get(options), kOwner + std::string(option.name));
    if (option.not_above) requireNotAbove(option, options);
  }
  if (options.resume && options.checkpoint_path.empty()) {
    fail(ErrorCode::kInvalidArgument,
         "options->resume is 1, but no checkpoint_path is given; it names what to go on from");
  }
  if (options.strategy.empty()) return;
  if (options.model == FitKind::kScaffold || options.model == FitKind::kRelay) {
    fail(ErrorCode::kInvalidArgument,
         "strategy is '" + options.strategy +
             "', but anchors with features have none: they grow by a rule of their own");
  }
  if (options.model == FitKind::kField) {
    requireFieldStrategy(options.strategy);
  } else {
    makeStrategy(options.strategy);  // says now what is wrong with it
  }
}

FitOptions resolved(FitOptions options) {
  if (options.model == FitKind::kField) {
    options.density_gradient = options.density_gradient || !options.strategy.empty();
  } else if (options.strategy.empty() && !isOfAnchors(options.model)) {
    options.strategy =
        options.model == FitKind::kMotion ? "temporal" : ExplicitModelOptions().strategy;
  }
  return options;
}

}  // namespace stipple
