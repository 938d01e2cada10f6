// Based on: DeG, density-sampled Gaussians (arXiv 2605.16355): stages, losses and the render loss
// contribution gradient. Differs: one scene, one view per step; budgets log-uniform; density in
// logits per cell.
#include "train/loop/field_model.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "base/stopwatch.h"
#include "decode/field/field_decoder.h"
#include "density/contribution_normalisation.h"
#include "density/learned_density.h"
#include "train/loop/field_state.h"
#include "train/loop/view_step.h"
#include "train/optimiser/field_regularisers.h"
#include "train/optimiser/sparse_adam.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 14;

/// Ends of the stages, as shares of the iterations. The structural loss starts at its minimum, so
/// its stage is short.
constexpr double kStructureEnd = 0.01;
constexpr uint64_t kMostStructureSteps = 20;

/// What depends on whether anything is known of surfaces at the start.
struct FieldStart {
  double opacity;
  double attributes_end;  ///< share of the iterations, from which on the density learns, too
  /// Share after which it is held: the attributes learn what the anchors stand for that will be
  /// drawn.
  double density_end;
  double network_rate;
  double logit_rate;
  /// Share of the steps that draw the anchors that decoding will draw. They learn what they stand
  /// for themselves, no mean over draws; the others keep other seeds good, and see all places.
  double own_draws;
};
constexpr FieldStart kFromSurfaces = {0.3, 0.3, 0.6, 8e-3, 1e-2, 0.75};
/// A thin fog in all of the cube, whose density moves at once: opaque, or learned faster, it clears
/// everywhere before any place can show that it is worth something.
constexpr FieldStart kFromNothing = {0.03, 0.0, 1.0, 2e-3, 5e-2, 0.5};

constexpr double kGridRate = 2.5e-2;
constexpr double kStructureRate = 2e-2;
constexpr double kLastRate = 0.02;
constexpr double kWarmUpShare = 0.02;
constexpr double kWarmUpSteps = 100;
/// Few steps: the second moment must follow within a hundred of them.
constexpr double kBeta2 = 0.99;

/// Budgets are drawn up to this many times the largest, and held to it: without it, at the end of
/// the range, the network hears of smaller budgets alone, and the last octave loses.
constexpr double kReach = 2;

/// Pull of the prior on the density beside the loss, whose mean size per anchor is 1.
constexpr double kPriorShare = 0.02;
/// Anchors are compared with others of their cell; where there are few, chance decides.
constexpr ScoreOptions kScore = {true, 4};
constexpr uint64_t kDrawWindow = 100;
constexpr uint64_t kLeastDraws = 8;
/// Levels that start active where nothing is known of surfaces.
constexpr int kEvenLevels = 4;

void requireOptions(const FieldModelOptions& options, std::span<const size_t> training) {
  if (training.empty()) {
    fail(ErrorCode::kInvalidArgument, "there are no views to learn from; at least one is needed");
  }
  if (!(options.ssim_share >= 0 && options.ssim_share <= 1)) {
    fail(ErrorCode::kInvalidArgument,
         "ssim_share is " + std::to_string(options.ssim_share) + "; 0 to 1 is allowed");
  }
}

const FieldStart& howToStart(const ScenePrior& prior) {
  return prior.weights.empty() ? kFromNothing : kFromSurfaces;
}

LearnedDensity startDensity(const ScenePrior& prior, int leaf_level) {
  if (prior.weights.empty()) {
    return LearnedDensity(prior.root, leaf_level, std::min(kEvenLevels, leaf_level));
  }
  return LearnedDensity::fromPoints(prior.positions, prior.weights, prior.root, leaf_level,
                                    prior.known_level);
}

/// Leaves of a density that hold anything, about: of a surface a cell has four children.
uint64_t surfaceLeaves(const LearnedDensity& density) {
  size_t level = density.levels().size() - 1;
  while (density.levels()[level].cells.empty()) --level;
  const uint64_t quarters = 2 * (density.levels().size() - level);
  return density.levels()[level].cells.size() << quarters;
}

/// Where the inner half of the root is the scene, its leaves stay as small.
int leafLevelOf(const ScenePrior& prior, const FieldModelOptions& options) {
  return prior.contracted ? std::min(options.leaf_level + 1, kMaxLeafLevel) : options.leaf_level;
}

FieldState startOf(const ScenePrior& prior, const FieldModelOptions& options,
                   ColourSpace colour_space) {
  FieldShape shape;
  shape.root = prior.root;
  shape.contracted = prior.contracted;
  shape.leaf_level = leafLevelOf(prior, options);
  shape.layout = {options.gaussians_per_anchor, options.sh_degree};
  shape.least_anchors = options.least_anchors;
  shape.most_anchors = options.most_anchors;
  shape.colour_space = colour_space;
  shape.antialias = options.antialias;
  shape.seed = options.seed;
  shape.starting_opacity = howToStart(prior).opacity;
  FieldParameters checked = makeFieldParameters(shape);  // refuses options before any work
  LearnedDensity density = startDensity(prior, shape.leaf_level);
  shape.surface_cells = std::max<uint64_t>(surfaceLeaves(density), 1 << 14);
  return startState(std::move(density), makeFieldParameters(shape));
}

/// Half a cosine from 1 to kLastRate over the fit, with a linear start.
double rateShare(const FitMoment& moment) {
  const double done = static_cast<double>(moment.iteration - 1) /
                      static_cast<double>(std::max<uint64_t>(moment.iterations, 1));
  const double warm_up =
      std::min(kWarmUpSteps, kWarmUpShare * static_cast<double>(moment.iterations)) + 1;
  const double start = std::min(1.0, static_cast<double>(moment.iteration) / warm_up);
  return start * (kLastRate + (1 - kLastRate) * 0.5 * (1 + std::cos(done * std::numbers::pi)));
}

class FieldModel final : public FitModel {
 public:
  FieldModel(const BackendFactory& backends, FieldState state, const FieldStart& start,
             const FieldModelOptions& options)
      : options_(options),
        start_(start),
        state_(std::move(state)),
        pass_(backends.makeViewPass()) {}

  const char* name() const override { return "field"; }

  StepReport step(const FitMoment& moment, const StepView& view, ViewEvaluator*,
                  Progress* progress) override {
    const double iterations = static_cast<double>(moment.iterations);
    const double done = static_cast<double>(moment.iteration - 1) / iterations;
    if (moment.iteration <= std::min<uint64_t>(kMostStructureSteps,
                                               static_cast<uint64_t>(kStructureEnd * iterations))) {
      return structureStep();
    }
    const bool joint = done >= start_.attributes_end && done < start_.density_end;
    return renderedStep(moment, view, joint, progress);
  }

  SplatCloud splats(uint64_t budget) override {
    AnchorSamplingOptions sampling;
    sampling.count = budget == 0 ? options_.most_anchors : std::min(budget, kMaxAnchorCount);
    const AnchorSet anchors = drawLearned(frozen(), sampling, draws());
    DecodeRequest request;
    request.anchors = &anchors;
    request.gaussians_per_anchor = options_.gaussians_per_anchor;
    return FieldDecoder(state_.field).decode(request);
  }

  FieldResult result() {
    return {frozen(), std::make_shared<const FieldParameters>(*state_.field), draws()};
  }

  std::vector<uint64_t> budgets() const override {
    std::vector<uint64_t> budgets;
    for (uint64_t b = options_.most_anchors; b >= options_.least_anchors && b > 0; b /= 2) {
      budgets.insert(budgets.begin(), b);
    }
    return budgets;
  }

  std::optional<double> densityEntropy() const override { return state_.density.entropy(); }

  TensorTable state() const override { return tensorsOf(state_); }

  void restore(const TensorTable& table) override {
    state_ = stateOf(table, state_);
    frozen_.reset();
    gradients_ = {};
  }

  uint64_t memoryBytes() const override {
    // Values and both moments, and the derivatives of grids, which are kept whole.
    const uint64_t field = 4 * state_.field->bytes();
    const uint64_t density = state_.density.activeCellCount() * 8 * (6 * sizeof(float) + 1);
    const uint64_t splats = cloud_.size() * (cloud_.shStride() + 11) * 3 * sizeof(float);
    const uint64_t anchors = tape_.inputs.size() * 8 * sizeof(float);
    return field + density + splats + anchors + pass_->memoryBytes();
  }

 private:
  StepReport structureStep() {
    StepReport report;
    report.stage = "Density";
    const TimedBlock watch(report.seconds.field);
    DensityGradient gradient;
    report.loss = state_.density.structuralLoss(1.0, &gradient);
    stepDensity(gradient, kStructureRate);
    return report;
  }

  StepReport renderedStep(const FitMoment& moment, const StepView& view, bool joint,
                          Progress* progress) {
    StepReport report;
    report.stage = joint ? "Joint" : "Attributes";
    const bool learns_density = joint && options_.density_gradient;
    AnchorSet anchors;
    bool is_own = false;
    {
      const TimedBlock watch(report.seconds.field);
      anchors = drawAnchors(moment, learns_density, is_own);
      FieldDecoder(state_.field).forward(anchors, tape_, cloud_);
    }
    StatisticRequest request;
    request.contributions = learns_density;
    passOverView(*pass_, cloud_, view, request, options_.ssim_share, progress, report);
    {
      const TimedBlock watch(report.seconds.field);
      fieldGradients(anchors, report);
      if (learns_density) densityGradients(anchors);
    }
    {
      const TimedBlock watch(report.seconds.optimiser);
      const double share = rateShare(moment);
      stepField(share);
      if (learns_density) stepDensity(by_logits_, start_.logit_rate * share);
    }
    if (learns_density) {
      const TimedBlock watch(report.seconds.edit);
      growDensity(anchors, is_own, moment);
    }
    return report;
  }

  LearnedDraws draws() const { return {options_.jitter, true, options_.seed}; }

  /// Without what the even share adds, as decoding draws: its anchors stand in empty space, large,
  /// as they have no neighbours, and in the way of views. Only a density that learns draws them.
  /// Out: is_own, whether these are anchors that decoding will draw.
  AnchorSet drawAnchors(const FitMoment& moment, bool learns_density, bool& is_own) const {
    const double u =
        unitDouble(keyedBits(options_.seed, RandomUse::kAnchorBudget, moment.iteration));
    uint64_t most = options_.most_anchors;
    if (moment.max_splats > 0) {
      most =
          std::min(most, std::max<uint64_t>(1, moment.max_splats / options_.gaussians_per_anchor));
    }
    const double least = static_cast<double>(std::min(options_.least_anchors, most));
    const double drawn = least * std::pow(kReach * static_cast<double>(most) / least, u);
    AnchorSamplingOptions sampling;
    sampling.count = std::min(most, static_cast<uint64_t>(std::llround(drawn)));
    const uint64_t bits = keyedBits(options_.seed, RandomUse::kAnchorSeed, moment.iteration);
    is_own = unitDouble(mixBits(bits)) < start_.own_draws;
    if (!is_own) sampling.seed = bits;
    return is_own || !learns_density ? drawSettled(state_.density, sampling, draws())
                                     : drawLearned(state_.density, sampling, draws());
  }

  void fieldGradients(const AnchorSet& anchors, StepReport& report) {
    pass_->swapGradients(cloud_gradient_);
    report.loss += regularise({}, *state_.field, anchors, tape_, cloud_, cloud_gradient_);
    FieldDecoder(state_.field).backward(anchors, tape_, cloud_, cloud_gradient_, gradients_);
    pass_->swapGradients(cloud_gradient_);
  }

  /// Derivatives by the logits: what each anchor does to the loss, and the prior's pull.
  void densityGradients(const AnchorSet& anchors) {
    const std::span<const float> contributions = pass_->statistic(Statistic::kContributions);
    std::vector<double> g(anchors.size(), 0.0);
    for (size_t n = 0; n < contributions.size(); ++n) {
      g[n / options_.gaussians_per_anchor] += static_cast<double>(contributions[n]);
    }
    normaliseContributions(
        {options_.clamp_gradient, options_.clip_gradient, options_.centre_gradient}, g);
    double size = 0;
    for (const double value : g) size += std::abs(value);
    const double scale = size > 0 ? 1 / size : 0;
    for (double& value : g) value *= scale;
    by_logits_ = state_.density.logDensityGradient(anchors, g, kScore);
    state_.density.addStructuralGradient(kPriorShare, by_logits_);
  }

  void stepField(double share) {
    AdamOptions adam;
    adam.beta2 = kBeta2;
    const uint64_t step = ++state_.field_steps;
    FieldParameters& field = *state_.field;
    std::vector<AdamGroup> groups;
    for (size_t l = 0; l < state_.weights.size(); ++l) {
      LinearLayer& layer = field.network.layers()[l];
      const LinearLayer& by = gradients_.network[l];
      groups.push_back({layer.weights.data(), by.weights.data(), state_.weights[l].first.data(),
                        state_.weights[l].second.data(), layer.weights.size(), 1,
                        start_.network_rate * share});
      groups.push_back({layer.biases.data(), by.biases.data(), state_.biases[l].first.data(),
                        state_.biases[l].second.data(), layer.biases.size(), 1,
                        start_.network_rate * share});
    }
    adamStep(groups, step, adam);
    std::vector<SparseRows> tables;
    const auto add = [&](FeatureGrid& grid, std::vector<FeatureGradient>& by,
                         std::vector<Moments>& moments) {
      for (size_t l = 0; l < by.size(); ++l) {
        tables.push_back({by[l].rows, grid.channels(), grid.levels()[l].values.data(),
                          moments[l].first.data(), moments[l].second.data(), by[l].values.data(),
                          kGridRate * share});
      }
    };
    add(field.features, gradients_.features, state_.features);
    add(field.details, gradients_.details, state_.details);
    sparseAdamStep(tables, step, adam, scratch_);
    for (FeatureGradient& by : gradients_.features) by.clear(field.features.channels());
    for (FeatureGradient& by : gradients_.details) by.clear(field.details.channels());
  }

  void stepDensity(const DensityGradient& gradient, double rate) {
    const uint64_t step = ++state_.density_steps;
    std::vector<float> logits, by, first, second;
    for (size_t l = 0; l < gradient.levels.size(); ++l) {
      const std::vector<uint32_t>& rows = gradient.levels[l].rows;
      const size_t count = rows.size() * 8;
      const LearnedLevel& level = state_.density.levels()[l];
      Moments& moments = state_.logits[l];
      for (std::vector<float>* values : {&logits, &by, &first, &second}) values->resize(count);
      const auto each = [&](const auto& visit) {
        parallelFor(rows.size(), kGrain / 8, [&](size_t begin, size_t end) {
          for (size_t i = begin; i < end; ++i) {
            for (size_t k = 0; k < 8; ++k) visit(i * 8 + k, rows[i] * size_t{8} + k);
          }
        });
      };
      each([&](size_t here, size_t there) {
        logits[here] = level.logits[there];
        by[here] = static_cast<float>(gradient.levels[l].values[here]);
        first[here] = moments.first[there];
        second[here] = moments.second[there];
      });
      const AdamGroup group = {logits.data(), by.data(), first.data(), second.data(),
                               count,         1,         rate};
      adamStep({&group, 1}, step);
      each([&](size_t here, size_t there) {
        moments.first[there] = first[here];
        moments.second[there] = second[here];
      });
      state_.density.setLogits(static_cast<int>(l), rows, logits);
    }
    frozen_.reset();
  }

  /// The fit's own draws are the same anchors again and again, whose cells count for no more.
  void growDensity(const AnchorSet& anchors, bool is_own, const FitMoment& moment) {
    if (!is_own) state_.density.countDraws(anchors, state_.draws);
    if (moment.iteration % kDrawWindow != 0) return;
    insertMoments(state_, state_.density.activate(state_.draws, kLeastDraws));
    state_.draws.clear();
  }

  const OctreeDensity& frozen() {
    if (!frozen_) frozen_ = state_.density.frozen();
    return *frozen_;
  }

  FieldModelOptions options_;
  FieldStart start_;
  FieldState state_;
  std::optional<OctreeDensity> frozen_;  ///< of the density as it is now

  // Memory of steps, used again.
  std::unique_ptr<ViewPass> pass_;
  FieldTape tape_;
  SplatCloud cloud_;
  SplatCloud cloud_gradient_;
  FieldGradients gradients_;
  DensityGradient by_logits_;
  SparseAdamScratch scratch_;
};

}  // namespace

std::unique_ptr<FitModel> makeFieldModel(const BackendFactory& backends, const ViewSource& views,
                                         std::span<const size_t> training,
                                         const FieldModelOptions& options, Progress* progress) {
  requireOptions(options, training);
  ScenePriorOptions prior_options;
  prior_options.seed = options.seed;
  prior_options.shell = options.shell;
  const ScenePrior prior = scenePrior(views, training, prior_options, progress);
  return std::make_unique<FieldModel>(backends, startOf(prior, options, views.colourSpace()),
                                      howToStart(prior), options);
}

std::optional<FieldResult> fieldResult(FitModel& model) {
  auto* field = dynamic_cast<FieldModel*>(&model);
  if (field == nullptr) return {};
  return field->result();
}

}  // namespace stipple
