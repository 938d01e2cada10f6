#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <utility>

#include "api/fit.h"
#include "api/guard.h"
#include "base/random.h"
#include "densify/strategies.h"

namespace stipple::api {

namespace {

constexpr uint64_t kMostSplats = uint64_t{1} << 28;
constexpr uint32_t kLeastGaussians = 4;
constexpr uint32_t kMostGaussians = 32;

void requireRange(uint64_t value, uint64_t first, uint64_t last, const char* name) {
  if (value >= first && value <= last) return;
  fail(ErrorCode::kInvalidArgument, std::string("options->") + name + " is " +
                                        std::to_string(value) + "; " + std::to_string(first) +
                                        " to " + std::to_string(last) + " is allowed");
}

using Pairs = std::vector<std::pair<std::string, std::string>>;

std::string exact(double value) {
  char text[40];
  std::snprintf(text, sizeof(text), "%.17g", value);
  return text;
}

std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return out + "\"";
}

/// Tells sets of views apart by their names and cameras.
uint64_t keyOf(const ViewSource& views) {
  uint64_t key = views.count();
  const auto mix = [&key](const void* bytes, size_t count) {
    const auto* from = static_cast<const unsigned char*>(bytes);
    for (size_t i = 0; i < count; ++i) key = mixBits(key ^ from[i]);
  };
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
  }
  return key;
}

Pairs settingsPairs(const FitSettings& settings, const ViewSource& views) {
  Pairs pairs;
  const auto add = [&](const char* name, uint64_t value) {
    pairs.emplace_back(name, std::to_string(value));
  };
  const TrainerOptions& trainer = settings.trainer;
  pairs.emplace_back("model", settings.is_field ? "\"field\"" : "\"explicit\"");
  if (settings.is_field) {
    const FieldModelOptions& field = settings.field_model;
    add("least_anchors", field.least_anchors);
    add("most_anchors", field.most_anchors);
    add("gaussians_per_anchor", field.gaussians_per_anchor);
    add("sh_degree", static_cast<uint64_t>(field.sh_degree));
    add("antialias", static_cast<uint64_t>(field.antialias));
    add("density_gradient", field.density_gradient);
    add("jitter", field.jitter);
    add("shell", static_cast<uint64_t>(field.shell));
  } else {
    const ExplicitModelOptions& model = settings.explicit_model;
    pairs.emplace_back("strategy", quoted(model.strategy));
    add("start_splats", model.start_splats);
    add("max_splats", model.max_splats);
    add("sh_degree", static_cast<uint64_t>(model.sh_degree));
    add("antialias", static_cast<uint64_t>(model.antialias));
  }
  add("iterations", trainer.iterations);
  add("background", static_cast<uint64_t>(trainer.background));
  add("holdout", settings.holdout);
  add("seed", trainer.seed);
  pairs.emplace_back("ssim_share", exact(trainer.ssim_share));
  add("measure_interval", trainer.measure_interval);
  add("views", views.count());
  char key[24];
  std::snprintf(key, sizeof(key), "\"%016llx\"", static_cast<unsigned long long>(keyOf(views)));
  pairs.emplace_back("views_key", key);
  return pairs;
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

/// The names and values of a flat JSON object as settingsText writes it.
Pairs pairsOf(const std::string& text) {
  Pairs pairs;
  size_t at = 0;
  while ((at = text.find('"', at)) != std::string::npos) {
    const size_t colon = text.find("\": ", at);
    if (colon == std::string::npos) break;
    size_t end = text.find(", \"", colon);
    const size_t value = colon + 3;
    if (end == std::string::npos) end = std::max(value, text.rfind('}'));
    pairs.emplace_back(text.substr(at + 1, colon - at - 1), text.substr(value, end - value));
    at = end;
  }
  return pairs;
}

}  // namespace

FitSettings fitSettings(const StippleFitOptions& given) {
  FitSettings settings;
  settings.is_field =
      enumValue<StippleFitModel>(given.model, 1, "options->model") == STIPPLE_FIT_FIELD;
  const auto antialias = enumValue<Antialias>(given.antialias, 1, "options->antialias");
  requireRange(given.sh_degree, 0, kMaxShDegree, "sh_degree");
  if (!(given.ssim_share >= 0 && given.ssim_share <= 1)) {
    fail(ErrorCode::kInvalidArgument,
         "options->ssim_share is " + std::to_string(given.ssim_share) + "; 0 to 1 is allowed");
  }
  if (!(given.checkpoint_seconds >= 0) || !std::isfinite(given.checkpoint_seconds)) {
    fail(ErrorCode::kInvalidArgument, "options->checkpoint_seconds is " +
                                          std::to_string(given.checkpoint_seconds) +
                                          "; 0 or more is allowed");
  }
  requireRange(given.iterations, 1, kMaxFitIterations, "iterations");
  TrainerOptions& trainer = settings.trainer;
  trainer.iterations = given.iterations;
  trainer.background = enumValue<BackgroundPolicy>(given.background, 2, "options->background");
  trainer.seed = given.seed;
  trainer.ssim_share = given.ssim_share;
  trainer.picture_bytes = given.picture_bytes;
  trainer.measure_interval = given.measure_interval;
  settings.holdout = given.holdout;
  if (given.checkpoint_path_utf8) {
    settings.checkpoint_path = given.checkpoint_path_utf8;
    trainer.checkpoint_interval = given.checkpoint_interval;
    trainer.checkpoint_seconds = given.checkpoint_seconds;
  }
  settings.resumes = given.resume != 0;
  if (settings.resumes && settings.checkpoint_path.empty()) {
    fail(ErrorCode::kInvalidArgument,
         "options->resume is 1, but checkpoint_path_utf8 is NULL; it names what to go on from");
  }
  if (settings.is_field) {
    FieldModelOptions& field = settings.field_model;
    requireRange(given.least_anchors, 1, STIPPLE_MAX_ANCHORS, "least_anchors");
    requireRange(given.most_anchors, given.least_anchors, STIPPLE_MAX_ANCHORS, "most_anchors");
    requireRange(given.gaussians_per_anchor, kLeastGaussians, kMostGaussians,
                 "gaussians_per_anchor");
    field.least_anchors = given.least_anchors;
    field.most_anchors = given.most_anchors;
    field.gaussians_per_anchor = given.gaussians_per_anchor;
    field.sh_degree = static_cast<int>(given.sh_degree);
    field.antialias = antialias;
    field.ssim_share = given.ssim_share;
    field.density_gradient = given.density_gradient != 0;
    if (given.strategy_utf8) {
      requireFieldStrategy(given.strategy_utf8);
      field.density_gradient = true;
    }
    field.jitter = given.jitter != 0;
    field.shell = enumValue<ShellChoice>(given.shell, 2, "options->shell");
    field.seed = given.seed;
    return settings;
  }
  ExplicitModelOptions& model = settings.explicit_model;
  requireRange(given.max_splats, 1, kMostSplats, "max_splats");
  requireRange(given.start_splats, 0, given.max_splats, "start_splats");
  if (given.strategy_utf8) model.strategy = given.strategy_utf8;
  model.start_splats = given.start_splats;
  model.max_splats = trainer.max_splats = given.max_splats;
  model.sh_degree = static_cast<int>(given.sh_degree);
  model.antialias = antialias;
  model.ssim_share = given.ssim_share;
  model.seed = given.seed;
  model.iterations = given.iterations;
  return settings;
}

std::string settingsText(const FitSettings& settings, const ViewSource& views) {
  std::string text = "{";
  for (const auto& [name, value] : settingsPairs(settings, views)) {
    text += (text.size() > 1 ? ", \"" : "\"") + name + "\": " + value;
  }
  return text + "}";
}

void requireSameSettings(const std::string& stored, const std::string& wanted,
                         const std::string& path) {
  if (stored == wanted) return;
  const Pairs old = pairsOf(stored);
  for (const auto& [name, value] : pairsOf(wanted)) {
    const auto found = std::find_if(
        old.begin(), old.end(), [&, &key = name](const auto& pair) { return pair.first == key; });
    const std::string seen = found == old.end() ? "nothing" : found->second.substr(0, 40);
    if (seen == value) continue;
    if (name == "views_key") {
      fail(ErrorCode::kInvalidArgument,
           path + " is of a fit to other views; resuming needs the same cameras and names");
    }
    fail(ErrorCode::kInvalidArgument, path + " is of a fit whose " + name + " was " + seen +
                                          "; now it is " + value + ", and resuming needs the same");
  }
  fail(ErrorCode::kInvalidArgument, path +
                                        " is of a fit with other settings; resuming needs the "
                                        "same");
}

uint64_t pictureMemoryBound(const ViewSource& views, uint64_t picture_bytes) {
  uint64_t all_pixels = 0, most_pixels = 0;
  for (size_t v = 0; v < views.count(); ++v) {
    const Camera& camera = views.camera(v);
    const uint64_t pixels = uint64_t{camera.width} * camera.height;
    all_pixels += pixels;
    most_pixels = std::max(most_pixels, pixels);
  }
  // A kept picture: colour, alpha and mask in 4 bytes each at worst.
  const uint64_t kept = std::min(picture_bytes, all_pixels * 5 * sizeof(float));
  // At work: one being loaded and one waiting with depth and normals (9 floats), the target (5),
  // what is drawn (4), its derivative (4), what drawing keeps (16) and the loss.
  return kept + most_pixels * (2 * 9 + 5 + 4 + 4 + 16 + 4) * sizeof(float);
}

uint64_t fitMemoryBound(const FitSettings& settings, const ViewSource& views) {
  const int degree =
      settings.is_field ? settings.field_model.sh_degree : settings.explicit_model.sh_degree;
  const uint64_t count = settings.is_field ? settings.field_model.most_anchors *
                                                 settings.field_model.gaussians_per_anchor
                                           : settings.explicit_model.max_splats;
  return pictureMemoryBound(views, settings.trainer.picture_bytes) + count * bytesPerSplat(degree);
}

void holdToMemory(uint64_t max_bytes, const ViewSource& views, FitSettings& settings) {
  if (max_bytes == 0) return;
  uint64_t& kept = settings.trainer.picture_bytes;
  kept = std::min(kept, max_bytes / 2);
  const uint64_t pictures = pictureMemoryBound(views, kept);
  const uint64_t room = max_bytes > pictures ? max_bytes - pictures : 0;
  const auto refuse = [&](uint64_t needed, const std::string& what) {
    fail(ErrorCode::kMemoryLimit, "options->max_bytes is " + std::to_string(max_bytes) + "; " +
                                      what + " and the pictures at work take about " +
                                      std::to_string(needed));
  };
  if (settings.is_field) {
    const uint64_t needed = fitMemoryBound(settings, views);
    if (needed > max_bytes) {
      refuse(needed, std::to_string(settings.field_model.most_anchors) + " anchors");
    }
    return;
  }
  ExplicitModelOptions& model = settings.explicit_model;
  const uint64_t each = bytesPerSplat(model.sh_degree);
  if (room < each) refuse(pictures + each, "one splat");
  model.max_splats = std::min(model.max_splats, room / each);
  model.start_splats = std::min(model.start_splats, model.max_splats);
  settings.trainer.max_splats = model.max_splats;
}

}  // namespace stipple::api
