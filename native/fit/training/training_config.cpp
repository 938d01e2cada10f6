#include "fit/training/training_config.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <span>
#include <type_traits>
#include <utility>

#include "base/error.h"
#include "base/nearest_name.h"
#include "base/number_text.h"
#include "io/assets/flat_json.h"
#include "io/bytes/quoted_text.h"

namespace stipple {

namespace {

constexpr size_t kMostParts = 64;
/// Whole numbers up to here are doubles, as JSON has them.
constexpr double kLargestWhole = 9007199254740992.0;

[[noreturn]] void refuse(const std::string& message) {
  fail(ErrorCode::kInvalidArgument, message);
}

constexpr char kSpacingKey[] = "network.follows_spacing";
constexpr const char* kStageNames[] = {"structure", "attributes", "joint"};
constexpr const char* kPrecisionNames[] = {"float32", "bfloat16"};
constexpr const char* kLossScalingNames[] = {"none", "dynamic"};

/// A place of a config that a key of its text sets.
struct Setting {
  std::string name;
  std::function<void(const FlatJsonValue&)> set;
  /// Its value as JSON; null: weights do not depend on it. Empty: they do not as other settings
  /// are.
  std::function<std::string()> json;
};

double numberOf(const FlatJsonValue& value, const std::string& name) {
  if (const auto* whole = std::get_if<uint64_t>(&value)) return static_cast<double>(*whole);
  if (const auto* number = std::get_if<double>(&value)) return *number;
  refuse("'" + name + "' is '" + std::get<std::string>(value) + "'; a number is needed");
}

const std::string& textOf(const FlatJsonValue& value, const std::string& name) {
  if (const auto* text = std::get_if<std::string>(&value)) return *text;
  refuse("'" + name + "' is a number; a text is needed");
}

/// Ranges are those of validate() and of the constructors: here only the type has to hold it.
template <class T>
Setting number(const std::string& name, T& place) {
  const auto set = [&place, name](const FlatJsonValue& given) {
    const double value = numberOf(given, name);
    if constexpr (std::is_integral_v<T>) {
      const double most =
          std::min(kLargestWhole, static_cast<double>(std::numeric_limits<T>::max()));
      if (!(value >= 0 && value <= most) || value != std::floor(value)) {
        refuse("'" + name + "' is " + numberText(value) + "; a whole number from 0 to " +
               numberText(most, 17) + " is allowed");
      }
    }
    place = static_cast<T>(value);
  };
  return {name, set, [&place] { return numberText(static_cast<double>(place), 17); }};
}

Setting unkept(Setting setting) {
  setting.json = nullptr;
  return setting;
}

Setting path(const std::string& name, std::string& place, const std::string& folder) {
  const auto set = [&place, name, folder](const FlatJsonValue& given) {
    const std::filesystem::path value = textOf(given, name);
    if (value.empty()) refuse("'" + name + "' is empty; a path is needed");
    place = (std::filesystem::path(folder) / value).lexically_normal().string();
  };
  return {name, set, nullptr};
}

/// One of some names, in the order of the values that they stand for.
template <class T>
Setting choice(const std::string& name, T& place, std::span<const char* const> names) {
  const auto set = [&place, name, names](const FlatJsonValue& given) {
    const std::string& text = textOf(given, name);
    const auto found = std::find(names.begin(), names.end(), text);
    if (found == names.end()) {
      std::string allowed;
      for (size_t i = 0; i < names.size(); ++i) {
        if (i > 0) allowed += i + 1 < names.size() ? ", " : " or ";
        allowed += names[i];
      }
      refuse("'" + name + "' is '" + text + "'; " + allowed + " is allowed");
    }
    place = static_cast<T>(found - names.begin());
  };
  return {name, set, [&place, names] { return quotedText(names[static_cast<size_t>(place)]); }};
}

/// A setting that came later than others and that weights depend on where `matters` says so: what
/// earlier versions wrote and what this one writes are the same elsewhere.
Setting keptWhere(std::function<bool()> matters, Setting setting) {
  const auto json = std::move(setting.json);
  setting.json = [matters = std::move(matters), json] { return matters() ? json() : ""; };
  return setting;
}

void addNetwork(AutoencoderSizes& sizes, std::vector<Setting>& list) {
  list.push_back(number("network.heads", sizes.heads));
  list.push_back(number("network.head_width", sizes.head_width));
  list.push_back(number("network.latent_width", sizes.latent_width));
  list.push_back(number("network.mlp_ratio", sizes.mlp_ratio));
  list.push_back(number("network.encoder_blocks", sizes.encoder_blocks));
  list.push_back(number("network.octree_blocks", sizes.octree_blocks));
  list.push_back(number("network.splat_blocks", sizes.splat_blocks));
  list.push_back(number("network.gaussians", sizes.gaussians));
  list.push_back(number("network.leaf_level", sizes.leaf_level));
  const auto follows = [&sizes] { return sizes.follows_spacing; };
  list.push_back(keptWhere(follows, number(kSpacingKey, sizes.follows_spacing)));
}

/// In: precision, which decides what scale of losses is usual.
void addOptimiser(const std::string& at, const FactorPrecision& precision,
                  WeightOptimiserOptions& optimiser, std::vector<Setting>& list) {
  list.push_back(number(at + "learning_rate", optimiser.learning_rate));
  list.push_back(number(at + "beta1", optimiser.beta1));
  list.push_back(number(at + "beta2", optimiser.beta2));
  list.push_back(number(at + "epsilon", optimiser.epsilon));
  list.push_back(number(at + "weight_decay", optimiser.weight_decay));
  list.push_back(number(at + "warm_up", optimiser.warm_up));
  list.push_back(number(at + "least_share", optimiser.least_share));
  list.push_back(number(at + "most_norm", optimiser.most_norm));
  list.push_back(number(at + "clip_buffer", optimiser.clip_buffer));
  list.push_back(number(at + "clip_percentile", optimiser.clip_percentile));
  list.push_back(number(at + "mean_decay", optimiser.mean_decay));
  const auto is_said = [&optimiser, &precision] {
    return optimiser.loss_scaling != LossScaling::kNone || precision != FactorPrecision::kFloat32;
  };
  list.push_back(
      keptWhere(is_said, choice(at + "loss_scale", optimiser.loss_scaling, kLossScalingNames)));
  list.push_back(keptWhere(is_said, number(at + "loss_scale_start", optimiser.loss_scale_start)));
  list.push_back(keptWhere(is_said, number(at + "loss_scale_growth", optimiser.loss_scale_growth)));
}

/// Of a flow, all that its weights do not fit without.
void addFlowSizes(FlowConfig& flow, std::vector<Setting>& list) {
  list.push_back(number("flow.heads", flow.heads));
  list.push_back(number("flow.head_width", flow.head_width));
  list.push_back(number("flow.mlp_ratio", flow.mlp_ratio));
  list.push_back(number("flow.rotary_width", flow.rotary_width));
  list.push_back(number("flow.blocks", flow.blocks));
  list.push_back(number("flow.noise_refiners", flow.noise_refiners));
  list.push_back(number("flow.context_refiners", flow.context_refiners));
  list.push_back(number("flow.canvas", flow.patches.canvas));
  list.push_back(number("flow.patch", flow.patches.patch));
  list.push_back(number("flow.in_order", flow.in_order));
}

void addFlow(const FactorPrecision& precision, const std::string& folder, FlowConfig& flow,
             std::vector<Setting>& list) {
  list.push_back(number("flow.steps", flow.schedule.optimiser.total_steps));
  list.push_back(path("flow.start", flow.start, folder));
  list.push_back(number("flow.batch", flow.schedule.batch));
  list.push_back(number("flow.image_dropout", flow.schedule.image_dropout));
  list.push_back(number("flow.time_mean", flow.schedule.time_mean));
  addOptimiser("flow.", precision, flow.schedule.optimiser, list);
  addFlowSizes(flow, list);
}

void addDetail(const FactorPrecision& precision, DetailConfig& detail, std::vector<Setting>& list) {
  list.push_back(number("detail.steps", detail.schedule.optimiser.total_steps));
  list.push_back(number("detail.batch", detail.schedule.batch));
  list.push_back(number("detail.least_splats", detail.schedule.least_splats));
  list.push_back(number("detail.most_splats", detail.schedule.most_splats));
  list.push_back(number("detail.least_finer", detail.schedule.least_share));
  list.push_back(number("detail.views", detail.schedule.views));
  list.push_back(number("detail.seen", detail.schedule.seen));
  list.push_back(number("detail.ssim", detail.schedule.ssim));
  addOptimiser("detail.", precision, detail.schedule.optimiser, list);
  list.push_back(number("detail.heads", detail.sizes.heads));
  list.push_back(number("detail.head_width", detail.sizes.head_width));
  list.push_back(number("detail.layers", detail.sizes.layers));
  list.push_back(number("detail.blocks", detail.sizes.blocks));
  list.push_back(number("detail.mlp_ratio", detail.sizes.mlp_ratio));
  list.push_back(number("detail.patch", detail.sizes.patch));
  list.push_back(number("detail.children", detail.sizes.children));
  list.push_back(number("detail.ratio", detail.sizes.ratio));
  list.push_back(number("detail.fit_steps", detail.fit_steps));
  list.push_back(number("detail.fit_splats", detail.fit_splats));
}

void addPart(const std::string& at, const FactorPrecision& precision, AutoencoderSchedule& part,
             std::vector<Setting>& list) {
  WeightOptimiserOptions& optimiser = part.optimiser;
  AutoencoderLossWeights& weights = part.weights;
  list.push_back(choice(at + "stage", part.stage, kStageNames));
  list.push_back(number(at + "steps", optimiser.total_steps));
  list.push_back(number(at + "batch", part.batch));
  list.push_back(number(at + "tokens", part.most_tokens));
  list.push_back(number(at + "token_halvings", part.token_halvings));
  list.push_back(number(at + "least_anchors", part.least_anchors));
  list.push_back(number(at + "most_anchors", part.most_anchors));
  list.push_back(number(at + "views", part.views));
  list.push_back(number(at + "surface", part.surface));
  const auto keeps = [&part] { return part.keeps_encoder; };
  list.push_back(keptWhere(keeps, number(at + "keeps_encoder", part.keeps_encoder)));
  addOptimiser(at, precision, optimiser, list);
  list.push_back(number(at + "weights.structure", weights.structure));
  list.push_back(number(at + "weights.divergence", weights.divergence));
  list.push_back(number(at + "weights.ssim", weights.ssim));
  list.push_back(number(at + "weights.density", weights.density));
  list.push_back(number(at + "weights.volume", weights.splats.volume));
  list.push_back(number(at + "weights.opacity", weights.splats.opacity));
  list.push_back(number(at + "weights.cluster", weights.splats.cluster));
}

/// All places of a config. In: config, which must outlive them.
std::vector<Setting> settingsOf(TrainingConfig& config, const std::string& folder) {
  std::vector<Setting> list;
  list.push_back(path("collection", config.collection, folder));
  list.push_back(path("out", config.out, folder));
  list.push_back(path("start", config.start, folder));
  const auto is_narrow = [&config] { return config.precision != FactorPrecision::kFloat32; };
  list.push_back(keptWhere(is_narrow, choice("precision", config.precision, kPrecisionNames)));
  list.push_back(number("seed", config.seed));
  list.push_back(number("held_out", config.held_out));
  // What is measured, and when, chooses the state that is kept.
  list.push_back(number("measured_objects", config.measured_objects));
  list.push_back(number("measure_interval", config.measure_interval));
  list.push_back(unkept(number("checkpoint_interval", config.checkpoint_interval)));
  list.push_back(unkept(number("image_bytes", config.objects.image_bytes)));
  list.push_back(number("points", config.objects.points));
  if (config.learns_detail) {
    addDetail(config.precision, config.detail, list);
    return list;
  }
  addNetwork(config.sizes, list);
  addFlow(config.precision, folder, config.flow, list);
  for (size_t i = 0; i < config.parts.size(); ++i) {
    addPart("parts." + std::to_string(i) + ".", config.precision, config.parts[i], list);
  }
  return list;
}

/// One more than the largest number behind "parts."; 0 where there are none.
size_t partCount(const std::vector<std::pair<std::string, FlatJsonValue>>& entries) {
  const std::string begin = "parts.";
  size_t count = 0;
  for (const auto& [name, value] : entries) {
    if (name.rfind(begin, 0) != 0) continue;
    size_t part = 0;
    const char* const end = name.data() + name.size();
    const auto [stop, error] = std::from_chars(name.data() + begin.size(), end, part);
    if (error != std::errc() || stop == end || *stop != '.' || part >= kMostParts) {
      refuse("'" + name + "' is not of a list; \"parts\" is a list of at most " +
             std::to_string(kMostParts) + " objects");
    }
    count = std::max(count, part + 1);
  }
  return count;
}

/// A part that is only said in part is the usual one of its stage.
AutoencoderSchedule usualPart(AutoencoderStage stage) {
  AutoencoderSchedule part;
  part.stage = stage;
  part.batch = 2;
  part.token_halvings = 1;
  part.most_tokens = 128;
  part.least_anchors = 64;
  part.most_anchors = 1024;
  part.views = 2;
  part.surface = 4096;
  part.weights.density = stage == AutoencoderStage::kJoint ? 1 : 0;
  part.weights.structure = stage == AutoencoderStage::kStructure ? 1 : 0.1;
  part.optimiser.learning_rate = stage == AutoencoderStage::kJoint ? 2e-5 : 5e-4;
  part.optimiser.total_steps = stage == AutoencoderStage::kStructure ? 2000 : 8000;
  part.optimiser.mean_decay = 0.999;
  return part;
}

std::vector<AutoencoderSchedule> usualParts() {
  return {usualPart(AutoencoderStage::kStructure), usualPart(AutoencoderStage::kAttributes),
          usualPart(AutoencoderStage::kJoint)};
}

std::string lastWord(const std::string& name) {
  return name.substr(name.rfind('.') + 1);
}

[[noreturn]] void refuseKey(const std::string& key, const std::string& text_name,
                            const std::vector<Setting>& settings) {
  std::vector<std::string> known;
  const std::string begin = key.substr(0, key.rfind('.') + 1);
  for (const Setting& setting : settings) {
    if (setting.name.rfind(begin, 0) == 0) known.push_back(lastWord(setting.name));
  }
  std::string nearest = nearestName(lastWord(key), known);
  if (nearest.empty()) {  // It may be the place that is wrong.
    known.clear();
    for (const Setting& setting : settings) known.push_back(setting.name);
    nearest = nearestName(key, known);
  } else {
    nearest = begin + nearest;
  }
  refuse(text_name + ": '" + key + "' is not known" +
         (nearest.empty() ? "" : "; '" + nearest + "' is the nearest that is"));
}

/// What is usual depends on the precision: the released training scales losses where it has halves.
void setPrecision(const std::vector<std::pair<std::string, FlatJsonValue>>& entries,
                  TrainingConfig& config) {
  for (const auto& [name, value] : entries) {
    if (name == "precision") choice(name, config.precision, kPrecisionNames).set(value);
  }
  if (config.precision == FactorPrecision::kFloat32) return;
  for (AutoencoderSchedule& part : config.parts) {
    part.optimiser.loss_scaling = LossScaling::kDynamic;
  }
  config.flow.schedule.optimiser.loss_scaling = LossScaling::kDynamic;
  config.detail.schedule.optimiser.loss_scaling = LossScaling::kDynamic;
}

/// Stages go first, since what else a part has not said depends on them.
void setParts(const std::vector<std::pair<std::string, FlatJsonValue>>& entries,
              TrainingConfig& config) {
  const size_t count = partCount(entries);
  if (count == 0) return;
  config.parts.assign(count, usualPart(AutoencoderStage::kStructure));
  for (const auto& [name, value] : entries) {
    for (size_t i = 0; i < count; ++i) {
      if (name != "parts." + std::to_string(i) + ".stage") continue;
      AutoencoderStage given = AutoencoderStage::kStructure;
      choice(name, given, kStageNames).set(value);
      config.parts[i] = usualPart(given);
    }
  }
}

/// In: entries: ways to keys, and values. Out: config, with the usual where nothing is said.
void setAll(const std::vector<std::pair<std::string, FlatJsonValue>>& entries,
            const std::string& name, const std::string& folder, TrainingConfig& config) {
  setParts(entries, config);
  setPrecision(entries, config);
  const auto says = [&](const char* begin) {
    return std::any_of(entries.begin(), entries.end(),
                       [&](const auto& entry) { return entry.first.rfind(begin, 0) == 0; });
  };
  config.says_parts = says("parts.");
  config.says_spacing = says(kSpacingKey);
  config.says_network = std::any_of(entries.begin(), entries.end(), [](const auto& entry) {
    return entry.first.rfind("network.", 0) == 0 && entry.first != kSpacingKey;
  });
  std::vector<Setting> flow_sizes;
  addFlowSizes(config.flow, flow_sizes);
  config.flow.says_sizes =
      std::any_of(flow_sizes.begin(), flow_sizes.end(), [&](const Setting& size) {
        return std::any_of(entries.begin(), entries.end(),
                           [&](const auto& entry) { return entry.first == size.name; });
      });
  config.learns_detail = says("detail.");
  if (config.learns_detail) {
    for (const char* other : {"parts.", "network.", "flow.", "start"}) {
      if (!says(other)) continue;
      std::string key = other;
      if (key.back() == '.') key.pop_back();
      refuse(name + ": \"detail\" and \"" + key +
             "\" are both given; detail is learned by a training of its own");
    }
    config.parts.clear();
  }
  const std::vector<Setting> settings = settingsOf(config, folder);
  for (const auto& entry : entries) {
    const auto found = std::find_if(settings.begin(), settings.end(), [&](const Setting& setting) {
      return setting.name == entry.first;
    });
    if (found == settings.end()) refuseKey(entry.first, name, settings);
    try {
      found->set(entry.second);
    } catch (const Error& error) {
      fail(error.code(), name + ": " + error.what());
    }
  }
}

void validate(const TrainingConfig& config, const std::string& name) {
  if (config.collection.empty())
    refuse(name + ": \"collection\", the folder of objects, is missing");
  if (config.out.empty()) refuse(name + ": \"out\", the folder of results, is missing");
  const auto requireSome = [&](uint64_t value, const char* key) {
    if (value == 0) refuse(name + ": '" + key + "' is 0; 1 or more is allowed");
  };
  requireSome(config.measure_interval, "measure_interval");
  requireSome(config.checkpoint_interval, "checkpoint_interval");
  requireSome(config.measured_objects, "measured_objects");
  if (config.held_out == 1) {
    refuse(name +
           ": 'held_out' is 1, which leaves no object to learn from; 0, or 2 and more, is "
           "allowed");
  }
  if (config.learns_detail) {
    requireSome(config.detail.schedule.optimiser.total_steps, "detail.steps");
    requireSome(config.detail.fit_steps, "detail.fit_steps");
    requireSome(config.detail.fit_splats, "detail.fit_splats");
    try {
      validate(config.detail.schedule);
      validate(config.detail.sizes);
    } catch (const Error& error) {
      refuse(name + ": \"detail\": " + error.what());
    }
  }
  if (config.flow.isWanted()) {
    try {
      validate(config.flow.schedule);
      validate(config.flow.patches);
      validate(flowSizes(config.flow, config.sizes.latent_width));
    } catch (const Error& error) {
      refuse(name + ": \"flow\": " + error.what());
    }
  }
  for (size_t i = 0; i < config.parts.size(); ++i) {
    try {
      validate(config.parts[i]);
    } catch (const Error& error) {
      refuse(name + ": part " + std::to_string(i) + ": " + error.what());
    }
  }
}

}  // namespace

const char* stageName(AutoencoderStage stage) {
  return kStageNames[static_cast<size_t>(stage)];
}

FlowSizes flowSizes(const FlowConfig& config, size_t latent_width) {
  FlowSizes sizes;
  sizes.block.heads = config.heads;
  sizes.block.head_width = config.head_width;
  sizes.block.channels = config.heads * config.head_width;
  sizes.block.mlp_width = config.mlp_ratio * sizes.block.channels;
  sizes.block.rotary_width = config.rotary_width;
  sizes.block_count = config.blocks;
  sizes.noise_refiner_count = config.noise_refiners;
  sizes.context_refiner_count = config.context_refiners;
  sizes.token_width = latent_width;
  sizes.structure_width = config.patches.structureWidth();
  sizes.colour_width = kPatchPlaceWidth;
  sizes.time_width = 256;
  return sizes;
}

TrainingConfig defaultTrainingConfig() {
  TrainingConfig config;
  config.sizes.leaf_level = 6;
  config.sizes.follows_spacing = true;
  config.parts = usualParts();
  config.flow.schedule.optimiser.total_steps = 0;
  config.flow.schedule.optimiser.learning_rate = 3e-4;
  config.flow.schedule.optimiser.mean_decay = 0.999;
  config.detail.schedule.optimiser.total_steps = 4000;
  config.detail.schedule.optimiser.learning_rate = 1e-3;
  config.detail.schedule.optimiser.mean_decay = 0.995;
  return config;
}

TrainingConfig parseTrainingConfig(const std::string& text, const std::string& name,
                                   const std::string& folder) {
  TrainingConfig config = defaultTrainingConfig();
  setAll(readNestedJson(text, name), name, folder, config);
  validate(config, name);
  return config;
}

TrainingConfig readSettings(const std::string& settings, const std::string& name) {
  TrainingConfig config = defaultTrainingConfig();
  config.sizes.follows_spacing = false;  // Files of before it was there say nothing of it.
  setAll(readFlatJson(settings), name, "", config);
  return config;
}

void takeStart(const std::string& settings, TrainingConfig& config) {
  if (config.says_network) {
    refuse("\"network\" and \"start\" are both given; the networks are those of '" + config.start +
           "'");
  }
  const TrainingConfig from = readSettings(settings, config.start);
  if (from.learns_detail) {
    refuse("'" + config.start +
           "', which the training is to start with, holds a network that adds "
           "detail; weights of an autoencoder are needed");
  }
  const bool follows_spacing = config.sizes.follows_spacing;
  config.sizes = from.sizes;
  if (config.says_spacing) config.sizes.follows_spacing = follows_spacing;
  if (config.says_parts) return;
  if (config.sizes.follows_spacing != from.sizes.follows_spacing) {
    std::string message = kSpacingKey;
    message.append(" is not what ").append(config.start);
    message += " was learned with, and without \"parts\" nothing is learned that could follow";
    refuse(message);
  }
  config.parts = from.parts;
  config.objects.points = from.objects.points;
  if (!config.flow.isWanted()) {
    refuse(
        "with \"start\" and without \"parts\" the flow alone is learned, but \"flow\" has 0 steps");
  }
}

void takeFlowStart(const std::string& settings, TrainingConfig& config) {
  FlowConfig& flow = config.flow;
  if (flow.says_sizes) {
    refuse("\"flow\" has sizes and \"start\"; the network, and how it sees images, are those of '" +
           flow.start + "'");
  }
  if (!flow.isWanted()) {
    refuse("\"flow\" has \"start\", but 0 steps; 1 or more are needed to learn it further");
  }
  FlowConfig from = readSettings(settings, flow.start).flow;
  from.start = flow.start;
  from.schedule = flow.schedule;
  flow = from;
}

std::string settingsJson(const TrainingConfig& config) {
  TrainingConfig copy = config;
  std::string json;
  for (const Setting& setting : settingsOf(copy, "")) {
    const std::string value = setting.json == nullptr ? "" : setting.json();
    if (value.empty()) continue;
    json.push_back(json.empty() ? '{' : ',');
    json.append(quotedText(setting.name)).push_back(':');
    json.append(value);
  }
  return json + "}";
}

std::string firstDifference(const std::string& settings, const std::string& of_checkpoint) {
  const auto textOfValue = [](const FlatJsonValue& value) {
    const auto* text = std::get_if<std::string>(&value);
    return text != nullptr ? *text : numberText(numberOf(value, ""), 17);
  };
  const auto ours = readFlatJson(settings), theirs = readFlatJson(of_checkpoint);
  for (size_t i = 0; i < std::max(ours.size(), theirs.size()); ++i) {
    if (i >= ours.size()) return "the checkpoint has '" + theirs[i].first + "'";
    if (i >= theirs.size() || ours[i].first != theirs[i].first) {
      return "the checkpoint has no '" + ours[i].first + "'";
    }
    const std::string mine = textOfValue(ours[i].second), other = textOfValue(theirs[i].second);
    if (mine != other) {
      return "'" + ours[i].first + "' is " + mine + ", the checkpoint has " + other;
    }
  }
  return {};
}

}  // namespace stipple
