// Based on: Lu, Yu, Xu, Xiangli, Wang, Lin, Dai, Scaffold-GS: Structured 3D Gaussians for
// View-Adaptive Rendering, CVPR 2024, by its released program. Differs: docs/methods/anchors.md.
#include "train/anchors/scaffold_steps.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/random.h"
#include "decode/tree/merge_neighbours.h"
#include "densify/published_unit.h"
#include "math/morton.h"
#include "train/optimiser/adam.h"

namespace stipple {

namespace {

/// Iterations of 30,000: statistics begin, anchors grow from here to there, every so often.
constexpr uint64_t kWatchFrom = 500;
constexpr uint64_t kGrowFrom = 1500;
constexpr uint64_t kGrowUntil = 15000;
constexpr uint64_t kGrowEvery = 100;
/// In short fits, too: fewer views say little about an anchor.
constexpr uint64_t kLeastWindow = 20;

/// Of budgets that are learned, below all anchors.
constexpr double kBudgetOctaves = 5;

/// Weight of the mean product of a splat's scales, in cubed published units.
constexpr double kVolumeWeight = 0.01;

/// The largest cells are as wide as the places of the start are apart: nothing grows where they
/// stand close together already.
constexpr double kVoxelsPerSpacing = 16;

constexpr LearningRate kOffsetRate = {0.01 * kPublishedExtent, 1e-4 * kPublishedExtent};
constexpr LearningRate kFeatureRate = {7.5e-3, 7.5e-3};
constexpr LearningRate kScaleRate = {7e-3, 7e-3};
constexpr LearningRate kOpacityRate = {2e-3, 2e-5};
constexpr LearningRate kCovarianceRate = {4e-3, 4e-3};
constexpr LearningRate kColourRate = {8e-3, 5e-5};

/// Scales that splats may reach where anchors go, published units: exp(0.05).
constexpr double kLargestLogScale = 0.05;

/// Root of the mean squared distance to the nearest three, metres, of each place.
std::vector<double> spacingOf(std::span<const float> positions) {
  constexpr size_t kNearest = 3;
  const std::vector<double> places(positions.begin(), positions.end());
  const std::vector<uint32_t> nearest = nearestNeighbours(places, kNearest);
  std::vector<double> spacing(positions.size() / 3, 0.0);
  for (size_t i = 0; i < spacing.size(); ++i) {
    double sum = 0;
    size_t count = 0;
    for (; count < kNearest && nearest[i * kNearest + count] != kNoPlace; ++count) {
      const double* other = &places[nearest[i * kNearest + count] * size_t{3}];
      for (size_t axis = 0; axis < 3; ++axis) {
        const double d = other[axis] - places[i * 3 + axis];
        sum += d * d;
      }
    }
    if (count > 0) spacing[i] = std::sqrt(sum / static_cast<double>(count));
  }
  return spacing;
}

/// The middle of what is above 0; `otherwise` where nothing is.
double medianAboveZero(std::vector<double> values, double otherwise) {
  std::erase_if(values, [](double value) { return !(value > 0); });
  if (values.empty()) return otherwise;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::vector<float> centresOfSlots(const ScaffoldParameters& scaffold) {
  std::vector<float> centres(scaffold.offsets.size());
  const size_t gaussians = scaffold.gaussians;
  for (size_t i = 0; i < centres.size(); ++i) {
    const size_t anchor = i / (gaussians * 3);
    const size_t axis = i % 3;
    centres[i] =
        scaffold.positions[anchor * 3 + axis] +
        scaffold.offsets[i] * lengthOfLog(scaffold.log_scales[anchor * kScaffoldScales + axis]);
  }
  return centres;
}

/// Of each feature the largest among some anchors.
std::vector<float> strongestFeatures(const ScaffoldParameters& scaffold,
                                     const std::vector<uint32_t>& anchors) {
  std::vector<float> strongest(kScaffoldFeatures, -INFINITY);
  for (const uint32_t anchor : anchors) {
    const float* features = &scaffold.features[anchor * kScaffoldFeatures];
    for (size_t i = 0; i < kScaffoldFeatures; ++i) {
      strongest[i] = std::max(strongest[i], features[i]);
    }
  }
  return strongest;
}

void holdScales(double unit, ScaffoldParameters& scaffold) {
  const float largest = static_cast<float>(kLargestLogScale + std::log(unit));
  for (size_t a = 0; a < scaffold.size(); ++a) {
    for (size_t axis = 3; axis < kScaffoldScales; ++axis) {
      float& value = scaffold.log_scales[a * kScaffoldScales + axis];
      value = std::min(value, largest);
    }
  }
}

/// Slots that were judged begin anew; those that were drawn too seldom go on.
void forgetJudged(uint64_t window, AnchorStatistics& statistics) {
  const double least = AnchorGrowthOptions().least_drawn * static_cast<double>(window);
  for (size_t slot = 0; slot < statistics.drawn.size(); ++slot) {
    if (!(static_cast<double>(statistics.drawn[slot]) > least)) continue;
    statistics.drawn[slot] = 0;
    statistics.gradient_sums[slot] = 0;
  }
}

}  // namespace

double rateAt(const LearningRate& rate, const FitMoment& moment) {
  const double progress =
      std::min(1.0, static_cast<double>(moment.iteration) /
                        static_cast<double>(std::max<uint64_t>(1, moment.iterations)));
  return rate.first * std::pow(rate.last / rate.first, progress);
}

bool watchesAnchors(const FitMoment& moment) {
  return moment.iteration > scaleSchedule(kWatchFrom, moment.iterations) &&
         moment.iteration < scaleSchedule(kGrowUntil, moment.iterations);
}

bool growsAnchors(const FitMoment& moment) {
  return watchesAnchors(moment) && moment.iteration > scaleSchedule(kGrowFrom, moment.iterations) &&
         moment.iteration % growthWindow(moment) == 0;
}

uint64_t growthWindow(const FitMoment& moment) {
  return std::max(kLeastWindow, scaleSchedule(kGrowEvery, moment.iterations));
}

void observeAnchors(const ViewStatistics& statistics, const Camera& camera,
                    const ScaffoldTape& tape, std::span<const float> opacities,
                    ScaffoldState& state) {
  std::vector<uint8_t> in_view(state.scaffold->size());
  for (size_t a = 0; a < in_view.size(); ++a) {
    in_view[a] = isInView(camera, &state.scaffold->positions[a * 3]);
  }
  state.statistics.add(statistics, tape.slots, opacities, in_view);
}

double regulariseSizes(const FitMoment& moment, const SplatCloud& cloud,
                       SplatCloud& cloud_gradient) {
  if (cloud.size() == 0) return 0;
  const double unit = publishedUnit(moment);
  const double weight = kVolumeWeight / (unit * unit * unit * static_cast<double>(cloud.size()));
  double sum = 0;
  for (size_t n = 0; n < cloud.size(); ++n) {
    const float* s = &cloud.scales[n * 3];
    float* by = &cloud_gradient.scales[n * 3];
    sum += static_cast<double>(s[0]) * static_cast<double>(s[1]) * static_cast<double>(s[2]);
    for (size_t axis = 0; axis < 3; ++axis) {
      by[axis] += static_cast<float>(weight * static_cast<double>(s[(axis + 1) % 3]) *
                                     static_cast<double>(s[(axis + 2) % 3]));
    }
  }
  return weight * sum;
}

void learnAnchors(const FitMoment& moment, const ScaffoldGradients& gradients,
                  ScaffoldState& state) {
  ScaffoldParameters& scaffold = *state.scaffold;
  std::vector<AdamGroup> groups;
  size_t next = 0;
  const auto add = [&](std::vector<float>& values, const std::vector<float>& by,
                       const LearningRate& rate) {
    Moments& both = state.moments[next++];
    if (values.empty()) return;
    groups.push_back({values.data(), by.data(), both.first.data(), both.second.data(),
                      values.size(), 1, rateAt(rate, moment)});
  };
  add(scaffold.features, gradients.anchors.features, kFeatureRate);
  add(scaffold.log_scales, gradients.anchors.log_scales, kScaleRate);
  add(scaffold.offsets, gradients.anchors.offsets, kOffsetRate);
  const auto addNetwork = [&](Mlp& network, const std::vector<LinearLayer>& by,
                              const LearningRate& rate) {
    for (size_t l = 0; l < network.layers().size(); ++l) {
      add(network.layers()[l].weights, by[l].weights, rate);
      add(network.layers()[l].biases, by[l].biases, rate);
    }
  };
  addNetwork(scaffold.opacity, gradients.opacity, kOpacityRate);
  addNetwork(scaffold.covariance, gradients.covariance, kCovarianceRate);
  addNetwork(scaffold.colour, gradients.colour, kColourRate);
  adamStep(groups, ++state.steps);
}

void growAnchors(const FitMoment& moment, const AnchorGrowthLimits& limits, ScaffoldState& state) {
  ScaffoldParameters& scaffold = *state.scaffold;
  const uint64_t window = growthWindow(moment);
  const std::vector<float> centres = centresOfSlots(scaffold);
  std::vector<float> weights;
  for (const uint8_t level : state.levels) {
    weights.push_back(static_cast<float>(limits.level_weights[level]));
  }
  AnchorGround ground;
  ground.positions = scaffold.positions;
  ground.centres = centres;
  ground.gaussians = scaffold.gaussians;
  ground.voxel = limits.voxel;
  ground.window = window;
  ground.seed = limits.seed;
  ground.iteration = moment.iteration;
  ground.weights = weights;
  // Where there is no room, those that go make it first.
  std::vector<uint32_t> lasting = lastingAnchors(window, state.statistics);
  if (lasting.empty()) {  // all are faint: they stay rather than nothing
    lasting.resize(scaffold.size());
    std::iota(lasting.begin(), lasting.end(), 0u);
  }
  ground.most_new = limits.most_anchors - std::min<uint64_t>(limits.most_anchors, lasting.size());
  const std::vector<GrownAnchor> grown = grownAnchors(ground, state.statistics);
  forgetJudged(window, state.statistics);
  // What new anchors inherit, while all rows are where they were.
  std::vector<std::vector<float>> features;
  std::vector<uint8_t> levels;
  for (const GrownAnchor& one : grown) {
    features.push_back(strongestFeatures(scaffold, one.sources));
    uint8_t level = 0;
    for (const uint32_t source : one.sources) {
      if (!state.levels.empty()) level = std::max(level, state.levels[source]);
    }
    levels.push_back(level);
  }
  if (lasting.size() < scaffold.size()) {
    state.keep(lasting);
    holdScales(publishedUnit(moment), scaffold);
  }
  for (size_t i = 0; i < grown.size(); ++i) {
    addAnchor(scaffold, grown[i].position.data(), features[i].data(), grown[i].length);
    if (!state.levels.empty()) state.levels.push_back(levels[i]);
  }
  state.follow();
}

void addStartingAnchors(std::span<const float> places, double voxel, uint64_t most,
                        ScaffoldParameters& scaffold) {
  std::vector<std::array<int64_t, 3>> cells;
  cells.reserve(places.size() / 3);
  for (size_t i = 0; i + 2 < places.size(); i += 3) {
    std::array<int64_t, 3> cell;
    for (size_t axis = 0; axis < 3; ++axis) {
      cell[axis] =
          std::llround(std::clamp(static_cast<double>(places[i + axis]) / voxel, -0x1p52, 0x1p52));
    }
    cells.push_back(cell);
  }
  std::sort(cells.begin(), cells.end());
  cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
  std::vector<float> positions;
  const size_t count = static_cast<size_t>(std::min<uint64_t>(most, cells.size()));
  for (size_t i = 0; i < count; ++i) {
    for (const int64_t key : cells[i * cells.size() / count]) {
      positions.push_back(static_cast<float>(static_cast<double>(key) * voxel));
    }
  }
  const std::vector<double> spacing = spacingOf(positions);
  const double usual = medianAboveZero(spacing, kVoxelsPerSpacing * voxel);
  for (size_t i = 0; i < count; ++i) {
    addAnchor(scaffold, &positions[i * 3], nullptr,
              static_cast<float>(spacing[i] > 0 ? spacing[i] : usual));
  }
}

double voxelOf(std::span<const float> places) {
  return medianAboveZero(spacingOf(places), 1e-3) / kVoxelsPerSpacing;
}

bool beginsBudgets(const FitMoment& moment) {
  return moment.iteration == std::max<uint64_t>(1, scaleSchedule(kGrowUntil, moment.iterations));
}

void beginBudgets(ScaffoldState& state) {
  std::vector<double> worth;
  for (size_t a = 0; a < state.scaffold->size(); ++a) {
    worth.push_back(static_cast<double>(state.statistics.opacity_sums[a]) /
                    std::max(1.0, static_cast<double>(state.statistics.seen[a])));
  }
  state.keep(nestedOrder(state.scaffold->positions, worth));
  state.scaffold->coarsening = kCoarsening;
}

uint64_t budgetOfStep(const FitMoment& moment, uint64_t seed, uint64_t anchors, double share) {
  if (moment.iteration < std::max<uint64_t>(1, scaleSchedule(kGrowUntil, moment.iterations))) {
    return anchors;
  }
  const double dice =
      static_cast<double>(unitFloat(keyedBits(seed, RandomUse::kAnchorBudget, moment.iteration)));
  const double octaves = kBudgetOctaves * std::max(0.0, 1.0 - (1.0 - dice) / share);
  const double budget = static_cast<double>(anchors) * std::exp2(-octaves);
  return std::max<uint64_t>(1, static_cast<uint64_t>(std::llround(budget)));
}

std::vector<uint32_t> nestedOrder(std::span<const float> positions, std::span<const double> worth) {
  const size_t count = worth.size();
  std::array<double, 3> low = {HUGE_VAL, HUGE_VAL, HUGE_VAL};
  double side = 0;
  for (size_t i = 0; i < positions.size(); ++i) {
    low[i % 3] = std::min(low[i % 3], static_cast<double>(positions[i]));
  }
  for (size_t i = 0; i < positions.size(); ++i) {
    side = std::max(side, static_cast<double>(positions[i]) - low[i % 3]);
  }
  std::vector<uint64_t> codes(count);
  for (size_t a = 0; a < count; ++a) {
    std::array<uint32_t, 3> cell = {0, 0, 0};
    for (size_t axis = 0; side > 0 && axis < 3; ++axis) {
      const double share = (static_cast<double>(positions[a * 3 + axis]) - low[axis]) / side;
      cell[axis] = static_cast<uint32_t>(std::min(share * 0x1p21, 0x1p21 - 1));
    }
    codes[a] = mortonEncode(cell[0], cell[1], cell[2]);
  }
  std::vector<uint32_t> left(count);
  std::iota(left.begin(), left.end(), 0u);
  std::stable_sort(left.begin(), left.end(),
                   [&](uint32_t a, uint32_t b) { return codes[a] < codes[b]; });
  // From the end: those that lose in the first round come last.
  std::vector<uint32_t> order;
  while (left.size() > 1) {
    std::vector<uint32_t> winners, losers;
    for (size_t i = 0; i < left.size(); i += 2) {
      if (i + 1 == left.size()) {
        winners.push_back(left[i]);
        continue;
      }
      const bool first_wins = worth[left[i]] >= worth[left[i + 1]];
      winners.push_back(left[first_wins ? i : i + 1]);
      losers.push_back(left[first_wins ? i + 1 : i]);
    }
    // Between octaves, too, the first are spread over all: by reversed bits of their places.
    std::vector<uint32_t> places(losers.size());
    std::iota(places.begin(), places.end(), 0u);
    const auto reversed = [](uint32_t value) {
      uint32_t bits = 0;
      for (int b = 0; b < 32; ++b) bits |= ((value >> b) & 1u) << (31 - b);
      return bits;
    };
    std::sort(places.begin(), places.end(),
              [&](uint32_t a, uint32_t b) { return reversed(a) > reversed(b); });
    for (const uint32_t place : places) order.push_back(losers[place]);
    left.swap(winners);
  }
  order.insert(order.end(), left.begin(), left.end());
  std::reverse(order.begin(), order.end());
  return order;
}

std::vector<uint32_t> orderOfWorth(std::span<const double> worth) {
  std::vector<uint32_t> order(worth.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(),
                   [&](uint32_t a, uint32_t b) { return worth[a] > worth[b]; });
  return order;
}

}  // namespace stipple
