#pragma once

#include <cstdint>
#include <string>

#include "data/clouds/splat_cloud.h"
#include "decode/anchors/key_frame.h"
#include "train/anchors/relay_model.h"
#include "train/loop/field_model.h"
#include "train/loop/trainer.h"
#include "train/prior/scene_prior.h"

namespace stipple {

/// What a fit makes.
enum class FitKind : uint32_t {
  kExplicit = 0,  ///< splats with parameters of their own
  kField = 1,     ///< a learned density and a field of attributes
  kMotion = 2,    ///< splats with parameters of their own that move, to views with times
  kScaffold = 3,  ///< anchors with features, and networks that make splats of them
  kRelay = 4,     ///< the same at key frames of a long clip, to views with times
};
constexpr uint32_t kFitKindCount = 5;

/// Whether anchors become the splats: strategies do not apply, and budgets count anchors.
constexpr bool isOfAnchors(FitKind kind) {
  return kind == FitKind::kField || kind == FitKind::kScaffold || kind == FitKind::kRelay;
}

/// Whether it learns from views of several times.
constexpr bool moves(FitKind kind) {
  return kind == FitKind::kMotion || kind == FitKind::kRelay;
}

/// A user's choice of quality, as presets have it.
enum class FitQuality : uint32_t { kFast = 0, kBalanced = 1, kFineDetail = 2 };
constexpr uint32_t kFitQualityCount = 3;

/// What a caller chooses for a fit. What each option means, its range and its name stand in the
/// table of fit_option_table.h; what is 0 here is set by presets. defaultFitOptions() has values
/// that fit.
struct FitOptions {
  FitKind model = FitKind::kExplicit;
  std::string strategy;  ///< empty: "adaptive"; of a field as density_gradient says
  uint64_t iterations = 0;
  uint64_t max_splats = 0;
  uint64_t start_splats = 0;  ///< 0: as StartOptions::count
  uint64_t least_anchors = 0;
  uint64_t most_anchors = 0;
  uint32_t gaussians_per_anchor = 0;
  uint32_t sh_degree = 0;
  Antialias antialias = Antialias::kClassic;
  BackgroundPolicy background = TrainerOptions().background;
  bool density_gradient = FieldModelOptions().density_gradient;
  bool jitter = FieldModelOptions().jitter;
  ShellChoice shell = FieldModelOptions().shell;
  double key_frame_spacing = 1;  ///< seconds
  KeyFrameBlend key_frame_blend = KeyFrameBlend::kLearned;
  bool growth_by_level = RelayModelOptions().grows_by_level;
  double middle_level_rank = RelayModelOptions().level_quantiles[0];
  double high_level_rank = RelayModelOptions().level_quantiles[1];
  double middle_level_weight = RelayModelOptions().level_weights[0];
  double high_level_weight = RelayModelOptions().level_weights[1];
  uint32_t holdout = 8;
  uint64_t seed = 0;
  double ssim_share = TrainerOptions().ssim_share;
  bool coarse_to_fine = TrainerOptions().coarse_to_fine;
  uint64_t measure_interval = 0;  ///< 0: a twentieth of the fit, at least 100
  uint64_t picture_bytes = TrainerOptions().picture_bytes;
  uint64_t max_bytes = 0;       ///< 0: no limit
  std::string checkpoint_path;  ///< empty: no checkpoints
  uint64_t checkpoint_interval = 0;
  double checkpoint_seconds = 60;
  bool resume = false;
};

/// Balanced explicit splats, without a strategy, so that any model can be set.
FitOptions defaultFitOptions();

/// Sets what the table has a value for at this model and quality; the other options stay.
void applyPreset(FitOptions& options, FitKind model, FitQuality quality);

/// Errors: kInvalidArgument with the name of the first option that is out of its range, of the
/// strategy that is not there, and of a path that is missing. Options that do not concern the model
/// may have any value.
void requireFitOptions(const FitOptions& options);

/// The same options with everything that follows from others written out: the strategy of explicit
/// splats, moving ones too, and density_gradient of a field whose strategy is named.
FitOptions resolved(FitOptions options);

}  // namespace stipple
