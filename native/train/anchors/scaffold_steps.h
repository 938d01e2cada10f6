#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "data/clouds/splat_cloud.h"
#include "decode/anchors/scaffold_decoder.h"
#include "densify/strategy.h"
#include "math/camera.h"
#include "train/anchors/scaffold_state.h"

namespace stipple {

// What a step of anchors with features does, be they those of a scene that stands still or of a key
// frame of a long clip. A moment is that of the fit, or of the part of it that is under way.

/// From the first to the last iteration, log-linearly.
struct LearningRate {
  double first = 0;
  double last = 0;
};
double rateAt(const LearningRate& rate, const FitMoment& moment);

/// Whether a step of this moment gathers what growth goes by, and whether growth follows it.
bool watchesAnchors(const FitMoment& moment);
bool growsAnchors(const FitMoment& moment);
/// Steps from one growth to the next.
uint64_t growthWindow(const FitMoment& moment);

/// Enters what a view told. In: statistics of the splats that `tape` made, with screen gradients.
void observeAnchors(const ViewStatistics& statistics, const Camera& camera,
                    const ScaffoldTape& tape, std::span<const float> opacities,
                    ScaffoldState& state);

/// Adds the weighted mean product of the scales, in cubed published units. Returns its value.
double regulariseSizes(const FitMoment& moment, const SplatCloud& cloud,
                       SplatCloud& cloud_gradient);

/// One step of Adam for anchors and networks.
void learnAnchors(const FitMoment& moment, const ScaffoldGradients& gradients,
                  ScaffoldState& state);

struct AnchorGrowthLimits {
  double voxel = 1e-3;        ///< metres
  uint64_t most_anchors = 1;  ///< there are never more
  uint64_t seed = 0;
  /// By which gradients of anchors are multiplied, of each level of ScaffoldState::levels.
  std::array<double, 3> level_weights = {1, 1, 1};
};

/// Removes faint anchors and adds others where splats are pulled at. Arrays and moments of state
/// have other rows then.
void growAnchors(const FitMoment& moment, const AnchorGrowthLimits& limits, ScaffoldState& state);

/// Anchors at the middles of the voxels that places are in, each voxel once, evenly where they are
/// too many. In: places [N,3].
void addStartingAnchors(std::span<const float> places, double voxel, uint64_t most,
                        ScaffoldParameters& scaffold);
/// A voxel for anchors that begin there: what grows does not depend on the unit of the scene.
double voxelOf(std::span<const float> places);

/// When growth is over: from then on steps learn budgets below all anchors, too, in nestedOrder().
bool beginsBudgets(const FitMoment& moment);
/// Puts anchors into that order, by how much they are seen; splats of fewer are larger from then
/// on.
void beginBudgets(ScaffoldState& state);
/// Anchors that a step draws: fewer in this share of the steps, by at most five octaves, else all.
uint64_t budgetOfStep(const FitMoment& moment, uint64_t seed, uint64_t anchors, double share = 0.5);
/// Splats of half of the anchors are this power of 2 as large: those of a surface cover as much.
constexpr double kCoarsening = 0.5;

/// An order of which the first of any number are spread over all: of two neighbours along the
/// Morton curve the one that is worth less goes to the end, and so on among those that are left.
/// In: worth [A].
std::vector<uint32_t> nestedOrder(std::span<const float> positions, std::span<const double> worth);

/// Anchors by falling worth. In: worth [A].
std::vector<uint32_t> orderOfWorth(std::span<const double> worth);

}  // namespace stipple
