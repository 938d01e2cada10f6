#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "base/progress.h"
#include "data/views/view_source.h"
#include "decode/anchors/scaffold.h"
#include "train/backend/backend_factory.h"
#include "train/loop/fit_model.h"

namespace stipple {

struct ScaffoldModelOptions {
  uint64_t most_anchors = 15000;       ///< there are never more
  uint64_t start_anchors = 0;          ///< as StartOptions::count
  uint32_t gaussians_per_anchor = 10;  ///< K, 1..32
  int sh_degree = 0;                   ///< above 0: colour depends on the view
  Antialias antialias = Antialias::kClassic;
  double ssim_share = 0.2;
  uint64_t seed = 0;
};

/// What a fit of anchors begins with.
struct ScaffoldStart {
  ScaffoldParameters scaffold;
  double voxel = 1e-3;  ///< metres
};
/// Errors: kInvalidArgument for no views, options out of range.
ScaffoldStart startOfScaffold(const ViewSource& views, std::span<const size_t> training,
                              const ScaffoldModelOptions& options, Progress* progress = nullptr);

/// Anchors that carry features, and networks that make K splats of each: anchors grow where splats
/// are pulled at, and go where splats are faint. When that is over, anchors are nested, and steps
/// draw the first of them, too, so that the first P are a budget. See docs/methods/anchors.md.
/// Errors: kInvalidArgument for no views, options out of range.
std::unique_ptr<FitModel> makeScaffoldModel(const BackendFactory& backends, const ViewSource& views,
                                            std::span<const size_t> training,
                                            const ScaffoldModelOptions& options,
                                            Progress* progress = nullptr);

/// What such a fit has learned, the first P anchors a budget; empty for any other model.
std::shared_ptr<const ScaffoldParameters> scaffoldResult(const FitModel& model);

}  // namespace stipple
