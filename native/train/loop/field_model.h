#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "data/views/view_source.h"
#include "decode/field/field_parameters.h"
#include "density/learned_draws.h"
#include "density/octree_density.h"
#include "train/backend/backend_factory.h"
#include "train/loop/fit_model.h"
#include "train/prior/scene_prior.h"

namespace stipple {

struct FieldModelOptions {
  uint64_t least_anchors = 1024;  ///< budgets are drawn log-uniformly between these two
  uint64_t most_anchors = 16384;
  uint32_t gaussians_per_anchor = 4;  ///< K, 4..32; few: more places learn what they look like
  int leaf_level = 8;                 ///< of the octree, 1..10
  int sh_degree = 0;                  ///< above 0: colour depends on the view
  Antialias antialias = Antialias::kMip;
  double ssim_share = 0.2;
  bool density_gradient = true;  ///< learn where anchors are from what each does to the loss
  bool clamp_gradient = true;    ///< harmful anchors count as neutral
  bool clip_gradient = true;     ///< at the 90th percentile
  bool centre_gradient = true;   ///< minus the mean
  bool jitter = true;            ///< anchors anywhere in their leaf; off: at its centre
  ShellChoice shell = ShellChoice::kAuto;  ///< for what is far away
  uint64_t seed = 0;
};

/// A learned density over an octree and a field of attributes: one result that decodes at any
/// budget. Trained in three stages: the density to the structural prior, the attributes with the
/// density held, both. See docs/methods/learned_density.md and attribute_field.md.
/// Errors: kInvalidArgument for no views, options out of range.
std::unique_ptr<FitModel> makeFieldModel(const BackendFactory& backends, const ViewSource& views,
                                         std::span<const size_t> training,
                                         const FieldModelOptions& options,
                                         Progress* progress = nullptr);

/// What a fit of a field has learned: all that decoding and an asset file need.
struct FieldResult {
  OctreeDensity density;
  std::shared_ptr<const FieldParameters> field;  ///< a copy; the fit may go on
  LearnedDraws draws;
};

/// Of a model of makeFieldModel; empty for any other.
std::optional<FieldResult> fieldResult(FitModel& model);

}  // namespace stipple
