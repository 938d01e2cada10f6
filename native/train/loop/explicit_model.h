#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "data/views/view_source.h"
#include "densify/strategy.h"
#include "motion/motion_cloud.h"
#include "train/backend/backend_factory.h"
#include "train/loop/fit_model.h"

namespace stipple {

struct ExplicitModelOptions {
  std::string strategy = "adaptive";  ///< how splats are added and removed
  uint64_t start_splats = 0;          ///< of the start; 0: as StartOptions::count
  uint64_t max_splats = 0;            ///< hard cap; 0: none
  int sh_degree = 3;                  ///< 0..4; 0 without view-dependent colour
  Antialias antialias = Antialias::kClassic;
  double ssim_share = 0.2;
  uint64_t seed = 0;
  uint64_t iterations = 30000;  ///< of the fit, which what it begins with may depend on
  /// Splats move over this clip: each view is drawn as they are at its time, and their motion is
  /// trained with them. Its window is what the strategy says (TimeStretch).
  std::optional<MotionClip> clip = {};
};

/// Bytes that a fit takes for each splat at its largest, about: parameters, two moments and
/// derivatives, the first three once more as the best state and once more in a checkpoint, what
/// drawing keeps, and a quarter of spare room where arrays grow. In: moves: whether they move.
uint64_t bytesPerSplat(int sh_degree, bool moves = false);

/// Splats with parameters of their own, started from what the views know of surfaces: their points,
/// else their depth, else the volume that the cameras share (start_splats.h).
/// In: training: the views that may be looked at. Source of constants: Kerbl, Kopanas, Leimkuehler,
/// Drettakis, 3D Gaussian Splatting, SIGGRAPH 2023.
/// Errors: kInvalidArgument for no views, options out of range, an unknown strategy (says which
/// there are).
std::unique_ptr<FitModel> makeExplicitModel(const BackendFactory& backends, const ViewSource& views,
                                            std::span<const size_t> training,
                                            const ExplicitModelOptions& options,
                                            Progress* progress = nullptr);

/// The same from splats that are there, which the strategy does not make fainter or smaller first.
/// They get options.sh_degree, as far as they have it drawn from the first step on, and are made
/// for options.antialias; options.start_splats counts for nothing.
std::unique_ptr<FitModel> makeExplicitModel(const BackendFactory& backends, const SplatCloud& start,
                                            const ExplicitModelOptions& options);

/// The same with a strategy of the caller's; of options the strategy counts for nothing either, and
/// the seed for the moments of splats that move alone.
std::unique_ptr<FitModel> makeExplicitModel(const BackendFactory& backends, const SplatCloud& start,
                                            std::unique_ptr<Strategy> strategy,
                                            const ExplicitModelOptions& options);

/// What a fit of splats that move has learned; empty for any other model.
std::optional<MotionCloud> motionResult(const FitModel& model);

}  // namespace stipple
