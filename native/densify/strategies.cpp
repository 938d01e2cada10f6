#include "densify/strategies.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <span>
#include <utility>

#include "base/error.h"
#include "densify/parts/edge_aware_score.h"
#include "densify/parts/filter_3d.h"
#include "densify/parts/growth_control.h"
#include "densify/parts/long_axis_split.h"
#include "densify/parts/multi_step_update.h"
#include "densify/parts/opacity_correction.h"
#include "densify/parts/recovery_pruning.h"
#include "densify/strategies/absolute.h"
#include "densify/strategies/adaptive.h"
#include "densify/strategies/direction.h"
#include "densify/strategies/frequency.h"
#include "densify/strategies/improved.h"
#include "densify/strategies/mcmc.h"
#include "densify/strategies/metropolis.h"
#include "densify/strategies/revised.h"
#include "densify/strategies/taming.h"
#include "densify/strategies/volumetric.h"

namespace stipple {

namespace {

struct StrategyMaker {
  StrategyEntry entry;
  ControlAssembly (*make)(StrategySettings&);
};

struct PartMaker {
  StrategyEntry entry;
  std::unique_ptr<ControlPart> (*make)(StrategySettings&);
};

ControlAssembly makeAdaptive(StrategySettings& settings) {
  AdaptiveOptions options;
  const double threshold = settings.number("threshold", options.pull.copy_threshold, 1e-9, 1e9);
  options.pull.copy_threshold = options.pull.split_threshold = threshold;
  return adaptiveControl(options);
}

ControlAssembly makeAbsolute(StrategySettings& settings) {
  AbsoluteOptions options;
  ScreenPullOptions& pull = options.pull;
  pull.split_threshold = settings.number("threshold", pull.split_threshold, 1e-9, 1e9);
  pull.copy_threshold = settings.number("copy_threshold", pull.copy_threshold, 1e-9, 1e9);
  return absoluteControl(options);
}

constexpr StrategyMaker kStrategies[] = {
    {{"adaptive", "Copies small splats and splits large ones that the pictures pull at"},
     makeAdaptive},
    {{"absolute", "As adaptive, and finds the blurred splats that lie over fine texture"},
     makeAbsolute},
    {{"improved",
      "Splits along the longest side where pictures have edges: sharper with fewer splats"},
     improvedControl},
    {{"direction", "As adaptive, and looks whether the pixels of a splat agree: fewer splats"},
     directionControl},
    {{"volumetric", "As adaptive, and splits what fills a large volume"}, volumetricControl},
    {{"frequency",
      "Lets sizes follow how close splats stand, and asks pairs of views what to remove"},
     frequencyControl},
    {{"mcmc", "Moves faint splats to where opaque ones are, up to a number that you set"},
     mcmcControl},
    {{"metropolis", "Tries new splats where pictures are wrong and keeps them where there is room"},
     metropolisControl},
    {{"taming", "Spends a budget of splats on those that matter most to the pictures"},
     tamingControl},
    {{"revised", "Multiplies the splats that show what pictures get wrong, at a steady pace"},
     revisedControl},
};

std::unique_ptr<ControlPart> edgeAwareScore(StrategySettings& settings) {
  EdgeAwareScoreOptions options;
  options.views = settings.count("views", options.views, 1000);
  return makeEdgeAwareScore(options);
}

std::unique_ptr<ControlPart> longAxisSplit(StrategySettings& settings) {
  LongAxisSplitOptions options;
  options.offset = settings.number("offset", options.offset, 0, 10);
  options.long_scale = settings.number("long", options.long_scale, 0.01, 1);
  options.minor_scale = settings.number("minor", options.minor_scale, 0.01, 1);
  options.opacity = settings.number("opacity", options.opacity, 0.01, 1);
  return makeLongAxisSplit(options);
}

std::unique_ptr<ControlPart> recoveryPruning(StrategySettings& settings) {
  RecoveryPruningOptions options;
  options.share = settings.number("share", options.share, 0, 0.9);
  return makeRecoveryPruning(options);
}

std::unique_ptr<ControlPart> growthControl(StrategySettings& settings) {
  GrowthControlOptions options;
  options.splats = settings.count("splats", options.splats);
  return makeGrowthControl(options);
}

std::unique_ptr<ControlPart> multiStepUpdate(StrategySettings& settings) {
  MultiStepUpdateOptions options;
  options.few = settings.count("few", options.few, 1000);
  options.many = settings.count("many", options.many, 1000);
  return makeMultiStepUpdate(options);
}

std::unique_ptr<ControlPart> opacityCorrection(StrategySettings&) {
  return makeOpacityCorrection();
}

constexpr PartMaker kParts[] = {
    {{"edge_aware_score", "Adds detail first where the pictures have edges"}, edgeAwareScore},
    {{"long_axis_split", "Splits along the longest side, so that two halves fill the same outline"},
     longAxisSplit},
    {{"volume_split", "Also splits whatever fills a large volume, long shapes into smaller pieces"},
     volumeSplit},
    {{"recovery_pruning", "Removes the splats that stay faint after their opacity was lowered"},
     recoveryPruning},
    {{"growth_control", "Adds splats slowly at first, along a curve that ends at the limit"},
     growthControl},
    {{"multi_step_update", "Learns from several views at a time towards the end: smoother, faster"},
     multiStepUpdate},
    {{"opacity_correction", "Keeps copies together as opaque as the splat that they came from"},
     opacityCorrection},
    {{"filter_3d",
      "Makes no splat finer than the pictures can show, so that zooming in stays smooth"},
     filter3d},
};

template <typename Maker>
std::vector<StrategyEntry> entriesOf(std::span<const Maker> makers) {
  std::vector<StrategyEntry> entries;
  for (const Maker& maker : makers) entries.push_back(maker.entry);
  return entries;
}

std::string listOf(const std::vector<StrategyEntry>& entries) {
  std::string text;
  for (const StrategyEntry& entry : entries)
    text += (text.empty() ? "" : ", ") + std::string(entry.name);
  return text.empty() ? "none" : text;
}

/// "name(key=1,other=2)".
struct Term {
  std::string name;
  std::map<std::string, double> values;
};

[[noreturn]] void failTerm(const std::string& term) {
  fail(ErrorCode::kInvalidArgument,
       "strategy has '" + term + "'; name or name(setting=number,...) is allowed");
}

Term parseTerm(const std::string& text) {
  Term term;
  const size_t open = text.find('(');
  term.name = text.substr(0, open);
  if (open == std::string::npos) return term;
  if (text.back() != ')') failTerm(text);
  std::string inner = text.substr(open + 1, text.size() - open - 2);
  for (size_t begin = 0; begin < inner.size();) {
    const size_t end = std::min(inner.find(',', begin), inner.size());
    const std::string pair = inner.substr(begin, end - begin);
    const size_t equals = pair.find('=');
    double value = 0;
    if (equals == std::string::npos || equals == 0) failTerm(text);
    const char* last = pair.data() + pair.size();
    const auto read = std::from_chars(pair.data() + equals + 1, last, value);
    if (read.ec != std::errc{} || read.ptr != last || !std::isfinite(value)) failTerm(text);
    term.values[pair.substr(0, equals)] = value;
    begin = end + 1;
  }
  return term;
}

std::vector<Term> parse(const std::string& text) {
  std::vector<Term> terms;
  size_t begin = 0;
  int depth = 0;
  for (size_t k = 0; k <= text.size(); ++k) {
    // A plus inside parentheses belongs to a number.
    if (k < text.size() && text[k] == '(') ++depth;
    if (k < text.size() && text[k] == ')') --depth;
    if (k < text.size() && (text[k] != '+' || depth > 0)) continue;
    terms.push_back(parseTerm(text.substr(begin, k - begin)));
    begin = k + 1;
  }
  return terms;
}

}  // namespace

StrategySettings::StrategySettings(std::string owner, std::map<std::string, double> values)
    : owner_(std::move(owner)), values_(std::move(values)) {}

double StrategySettings::number(const std::string& name, double otherwise, double least,
                                double most) {
  known_.push_back(name);
  const auto found = values_.find(name);
  if (found == values_.end()) return otherwise;
  if (!(found->second >= least && found->second <= most)) {
    fail(ErrorCode::kInvalidArgument, owner_ + "." + name + " is " + std::to_string(found->second) +
                                          "; " + std::to_string(least) + " to " +
                                          std::to_string(most) + " is allowed");
  }
  return found->second;
}

uint64_t StrategySettings::count(const std::string& name, uint64_t otherwise, uint64_t most) {
  const double value = number(name, static_cast<double>(otherwise), 0, static_cast<double>(most));
  return static_cast<uint64_t>(value);
}

bool StrategySettings::flag(const std::string& name, bool otherwise) {
  return number(name, otherwise ? 1 : 0, 0, 1) != 0;
}

void StrategySettings::requireAllUsed() const {
  for (const auto& [name, value] : values_) {
    if (std::find(known_.begin(), known_.end(), name) != known_.end()) continue;
    std::string known;
    for (const std::string& each : known_) known += (known.empty() ? "" : ", ") + each;
    fail(ErrorCode::kInvalidArgument,
         owner_ + " has no setting '" + name + "'; there is " + (known.empty() ? "none" : known));
  }
}

const std::vector<StrategyEntry>& strategyEntries() {
  static const std::vector<StrategyEntry> entries =
      entriesOf(std::span<const StrategyMaker>(kStrategies));
  return entries;
}

const std::vector<StrategyEntry>& partEntries() {
  static const std::vector<StrategyEntry> entries = entriesOf(std::span<const PartMaker>(kParts));
  return entries;
}

const std::vector<std::string>& strategyNames() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const StrategyEntry& entry : strategyEntries()) all.emplace_back(entry.name);
    return all;
  }();
  return names;
}

const std::vector<StrategyEntry>& fieldStrategyEntries() {
  static const std::vector<StrategyEntry> entries = {
      {"learned_density",
       "Moves a density towards the places where splats bring pictures nearest"}};
  return entries;
}

std::unique_ptr<Strategy> makeStrategy(const std::string& text) {
  const std::vector<Term> terms = parse(text);
  for (const StrategyEntry& entry : fieldStrategyEntries()) {
    if (terms[0].name != entry.name) continue;
    fail(ErrorCode::kInvalidArgument, std::string(entry.name) +
                                          " moves the density of a field, which explicit splats "
                                          "do not have; there is " +
                                          listOf(strategyEntries()));
  }
  const auto maker =
      std::find_if(std::begin(kStrategies), std::end(kStrategies),
                   [&](const auto& each) { return terms[0].name == each.entry.name; });
  if (maker == std::end(kStrategies)) {
    fail(ErrorCode::kInvalidArgument,
         "strategy is '" + terms[0].name + "'; there is " + listOf(strategyEntries()));
  }
  StrategySettings settings(terms[0].name, terms[0].values);
  ControlAssembly assembly = maker->make(settings);
  settings.requireAllUsed();

  std::vector<const ControlPart*> added;
  for (size_t k = 1; k < terms.size(); ++k) {
    const auto part = std::find_if(std::begin(kParts), std::end(kParts), [&](const auto& each) {
      return terms[k].name == each.entry.name;
    });
    if (part == std::end(kParts)) {
      fail(ErrorCode::kInvalidArgument,
           "part is '" + terms[k].name + "'; there is " + listOf(partEntries()));
    }
    for (size_t before = 1; before < k; ++before) {
      if (terms[before].name == terms[k].name) {
        fail(ErrorCode::kInvalidArgument,
             "strategy names " + terms[k].name + " twice; once is allowed");
      }
    }
    StrategySettings own(terms[k].name, terms[k].values);
    std::unique_ptr<ControlPart> made = part->make(own);
    own.requireAllUsed();
    for (const ControlPart* before : added) requireApart(*made, *before);
    added.push_back(made.get());
    addPart(assembly, std::move(made));
  }
  return makeDensityControl(text.c_str(), std::move(assembly));
}

}  // namespace stipple
