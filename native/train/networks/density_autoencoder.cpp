// Based on: DeG, density-sampled Gaussians (arXiv 2605.16355), a step of its training.
#include "train/networks/density_autoencoder.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "decode/anchor_spacing.h"
#include "decode/latent/latent_density.h"
#include "decode/splat_layout.h"
#include "density/anchor_sampling.h"
#include "density/contribution_normalisation.h"
#include "math/morton.h"
#include "train/networks/example_views.h"
#include "train/networks/start_weights.h"

namespace stipple {

namespace {

constexpr float kMiddle = 0.5f;  ///< of the unit cube, which is the origin of views

NetworkShape shapeOf(const AutoencoderSizes& sizes, size_t blocks) {
  return {sizes.heads, sizes.head_width, sizes.latent_width, blocks, sizes.mlp_ratio};
}

/// What GaussianNetwork calls its spacingUnit().
float spacingUnitOf(const AutoencoderSizes& sizes) {
  return sizes.follows_spacing ? static_cast<float>(kLatticeSide) : 0.0f;
}

/// The density of a latent, for the sampler.
class SampledDensity final : public DensityModel {
 public:
  SampledDensity(const TrainedOctree& octree, std::span<const float> values,
                 const ContextRows& latent, int leaf_level)
      : octree_(octree), values_(values), latent_(latent), leaf_level_(leaf_level) {}
  int leafLevel() const override { return leaf_level_; }
  const RootCube& root() const override { return root_; }
  void childLogProbabilities(int level, std::span<const uint64_t> cells, std::span<float> out,
                             Progress* progress) const override {
    if (progress != nullptr) progress->throwIfCancelled();
    const OctreeLevel asked = {level, {cells.begin(), cells.end()}, {}};
    TrainedOctree::Tape tape;
    const std::vector<float> logits =
        octree_.forward(values_, latent_.count, latent_.values, {&asked, 1}, tape);
    logProbabilitiesOf(logits, out);
  }

 private:
  const TrainedOctree& octree_;
  std::span<const float> values_;
  const ContextRows& latent_;
  int leaf_level_;
  RootCube root_;
};

/// `wanted` of `count` things, one of each equal share of them; all where there are no more.
std::vector<size_t> oneOfEachShare(size_t count, size_t wanted, uint64_t seed) {
  const size_t shares = std::min(count, wanted);
  std::vector<size_t> made;
  for (size_t i = 0; i < shares; ++i) {
    const size_t begin = i * count / shares, end = (i + 1) * count / shares;
    const double u = unitDouble(keyedBits(seed, RandomUse::kSurfaceSample, i));
    made.push_back(begin + std::min(static_cast<size_t>(u * static_cast<double>(end - begin)),
                                    end - begin - 1));
  }
  return made;
}

std::vector<float> noiseOf(size_t count, uint64_t seed) {
  std::vector<float> noise(count);
  for (size_t i = 0; i < count; ++i) {
    const uint64_t bits = keyedBits(seed, RandomUse::kTokenNoise, i);
    noise[i] = static_cast<float>(normalOf(unitDouble(bits), unitDouble(mixBits(bits))));
  }
  return noise;
}

}  // namespace

/// Splats of a latent, and how they came to be.
struct DensityAutoencoder::Splats {
  AnchorSet anchors;
  std::vector<float> units, raw;
  TrainedGaussians::Tape tape;
  SplatCloud unit_cloud;  // in the unit cube

  LayoutAnchors layoutAnchors() const { return {anchors.positions, units}; }
  SplatCloud aroundOrigin() const {
    SplatCloud cloud = unit_cloud;
    for (float& value : cloud.positions) value -= kMiddle;
    return cloud;
  }
};

void validate(const AutoencoderSizes& sizes) {
  const auto require = [](uint64_t value, uint64_t least, uint64_t most, const char* name) {
    if (value >= least && value <= most) return;
    fail(ErrorCode::kInvalidArgument, std::string(name) + " is " + std::to_string(value) + "; " +
                                          std::to_string(least) + " to " + std::to_string(most) +
                                          " is allowed");
  };
  require(sizes.heads, 1, 64, "the number of heads");
  require(sizes.head_width, 8, 256, "the width of a head");
  if (sizes.head_width % 4 != 0) {
    fail(ErrorCode::kInvalidArgument, "the width of a head is " + std::to_string(sizes.head_width) +
                                          "; a multiple of 4 is needed");
  }
  require(sizes.latent_width, 1, 1024, "the width of a latent");
  require(sizes.mlp_ratio, 1, 16, "the ratio of an MLP");
  require(sizes.encoder_blocks, 1, 64, "the number of the encoder's blocks");
  require(sizes.octree_blocks, 1, 64, "the number of the density's blocks");
  require(sizes.splat_blocks, 1, 64, "the number of the splats' blocks");
  require(sizes.gaussians, 4, 32, "the number of Gaussians of an anchor");
  require(static_cast<uint64_t>(std::max(0, sizes.leaf_level)), 1, kMaxLeafLevel, "the leaf level");
}

TensorTable DensityAutoencoder::tensors(std::span<const float> values) const {
  TensorTable table;
  for (const Parameter& parameter : layout_.parameters()) {
    const float* const first = values.data() + parameter.first;
    table[parameter.name] = {parameter.shape, std::vector<float>(first, first + parameter.count)};
  }
  table["gs.points_offset_perturbation"] = {{sizes_.gaussians, 3}, usualLattice(sizes_.gaussians)};
  table["gs.base_offset_scale"] = {{1}, std::vector<float>{usualSpread()}};
  if (sizes_.follows_spacing) {
    table["gs.spacing_unit"] = {{1}, std::vector<float>{spacingUnitOf(sizes_)}};
  }
  return table;
}

DensityAutoencoder::DensityAutoencoder(const AutoencoderSizes& sizes, FactorPrecision precision)
    : sizes_((validate(sizes), sizes)),
      layout_(precision),
      encoder_(layout_, "encoder.", shapeOf(sizes, sizes.encoder_blocks), sizes.feature_widths),
      octree_(layout_, "octree.", shapeOf(sizes, sizes.octree_blocks)),
      splats_(layout_, "gs.", shapeOf(sizes, sizes.splat_blocks), sizes.gaussians) {}

std::vector<float> DensityAutoencoder::startValues(uint64_t seed) const {
  const std::vector<std::string> silent = {"encoder.logvar_out.weight", "octree.out_proj.weight",
                                           "octree.adaLN_modulation.1.weight",
                                           "gs.out_proj.weight"};
  return startWeights(layout_, seed, silent);
}

std::vector<FeaturePoints> DensityAutoencoder::pointsOf(const TrainingObject& object) const {
  const size_t kinds = sizes_.feature_widths.size();
  std::vector<FeaturePoints> points;
  for (size_t i = 0; i < kinds && i < object.points.size() && i < object.features.size(); ++i) {
    const size_t count = object.points[i].size() / 3;
    if (count == 0 || object.features[i].size() != count * sizes_.feature_widths[i]) break;
    points.push_back({count, object.points[i].data(), object.features[i].data()});
  }
  if (points.size() != kinds || object.surface.empty()) {
    fail(ErrorCode::kInvalidArgument,
         "an object to learn from has " + std::to_string(object.surface.size() / 3) +
             " points of its surface and " + std::to_string(points.size()) +
             " kinds of points with features as wide as the network reads; one or more, and " +
             std::to_string(kinds) + ", are needed");
  }
  return points;
}

DensityAutoencoder::Splats DensityAutoencoder::splatsOf(std::span<const float> values,
                                                        const ContextRows& latent, uint64_t anchors,
                                                        uint64_t seed) const {
  Splats made;
  const SampledDensity density(octree_, values, latent, sizes_.leaf_level);
  made.anchors = sampleAnchors(density, {.count = anchors, .seed = seed});
  made.units = lengthUnits(made.anchors, spacingUnitOf(sizes_));
  made.raw = splats_.forward(values, latent, made.anchors.size(), made.anchors.positions.data(),
                             made.tape);
  const SplatLayout layout = {sizes_.gaussians, 0};
  made.unit_cloud.frame = Frame::kRFU;
  made.unit_cloud.antialias = Antialias::kMip;
  activateSplats(layout, made.layoutAnchors(), made.raw.data(), layout.outputs(), made.unit_cloud);
  return made;
}

void DensityAutoencoder::addDensity(std::span<const float> values, const ContextRows& latent,
                                    std::span<const OctreeLevel> levels, double factor,
                                    std::span<float> gradients, float* by_latent,
                                    double& loss) const {
  TrainedOctree::Tape tape;
  const std::vector<float> logits =
      octree_.forward(values, latent.count, latent.values, levels, tape);
  std::vector<float> by_logits(logits.size());
  loss += weighLogProbabilities(levels, logits, factor, by_logits);
  octree_.backward(values, latent.count, latent.values, levels, tape, by_logits, gradients,
                   by_latent);
}

void DensityAutoencoder::backwardOfSplats(std::span<const float> values, const ContextRows& latent,
                                          Splats& splats, const SplatCloud& by_cloud,
                                          std::span<float> gradients, float* by_latent) const {
  const SplatLayout layout = {sizes_.gaussians, 0};
  std::vector<float> by_raw(splats.raw.size());
  activateSplatsBackward(layout, splats.layoutAnchors(), splats.raw.data(), layout.outputs(),
                         splats.unit_cloud, by_cloud, by_raw.data());
  splats_.backward(values, latent, splats.anchors.size(), splats.anchors.positions.data(),
                   splats.tape, by_raw, gradients, by_latent);
}

void DensityAutoencoder::addImages(std::span<const float> values, const AutoencoderExample& example,
                                   const AutoencoderLossWeights& weights,
                                   const BackendFactory& backends, const ContextRows& latent,
                                   std::span<float> gradients, float* by_latent,
                                   AutoencoderLosses& losses, Progress* progress) const {
  Splats splats = splatsOf(values, latent, example.anchors, example.seed);
  const SplatCloud cloud = splats.aroundOrigin();
  SplatCloud by_cloud = zerosLike(cloud), by_view;
  std::vector<double> contributions(splats.anchors.size(), 0.0);
  const ObjectViews* const all = example.object->views.get();
  const std::vector<size_t> views =
      drawnViews(all == nullptr ? 0 : all->count(), example.views, example.seed);
  if (views.empty()) fail(ErrorCode::kInvalidArgument, "an object to learn from has no views");
  const double view_share = 1 / static_cast<double>(views.size());
  StatisticRequest request;
  request.contributions = example.stage == AutoencoderStage::kJoint;
  losses.ssim = 0;
  const std::unique_ptr<ViewPass> pass = backends.makeViewPass();
  for (const size_t index : views) {
    if (progress != nullptr) progress->throwIfCancelled();
    const ObjectView view = all->view(index);
    const bool is_white = keyedBits(example.seed, RandomUse::kBackground, index) & 1;
    const ImageLossValue loss =
        addViewLoss(*pass, view, is_white, cloud, request, weights.ssim, view_share * example.share,
                    by_view, by_cloud, progress);
    losses.l1 += view_share * loss.l1;
    losses.ssim += view_share * loss.ssim;
    if (!request.contributions) continue;
    const std::span<const float> of_view = pass->statistic(Statistic::kContributions);
    // Statistics are sums over pixels and channels. What counts is the mean over pixels of the sum
    // over channels, as published, where L1 is the mean over both.
    const double pixels = double{1} * view.camera.width * view.camera.height;
    for (size_t n = 0; n < of_view.size(); ++n) {
      contributions[n / sizes_.gaussians] += view_share / pixels * static_cast<double>(of_view[n]);
    }
  }
  losses.splats = addSplatLosses(weights.splats, example.share, splats.anchors.positions,
                                 sizes_.gaussians, splats.unit_cloud, by_cloud);
  backwardOfSplats(values, latent, splats, by_cloud, gradients, by_latent);
  losses.total += losses.l1 + weights.ssim * (1 - losses.ssim) +
                  weights.splats.volume * losses.splats.volume +
                  weights.splats.opacity * losses.splats.opacity +
                  weights.splats.cluster * (losses.splats.off_centre + losses.splats.overlap);
  if (!request.contributions) return;
  normaliseContributions({.counts_neutral = true}, contributions);
  const std::vector<OctreeLevel> levels =
      levelsAbove(splats.anchors.leaves, sizes_.leaf_level, contributions);
  double surrogate = 0;  // It has a derivative that counts, and no value that does.
  addDensity(values, latent, levels, weights.density * example.share, gradients, by_latent,
             surrogate);
}

AutoencoderLosses DensityAutoencoder::addExample(std::span<const float> values,
                                                 const AutoencoderExample& example,
                                                 const AutoencoderLossWeights& weights,
                                                 const BackendFactory& backends,
                                                 std::span<float> gradients,
                                                 Progress* progress) const {
  const TrainingObject& object = *example.object;
  const std::vector<FeaturePoints> points = pointsOf(object);
  const std::vector<uint32_t> queries = farthestPoints(object.points[0], example.tokens);
  TrainedEncoder::Tape tape;
  const EncodedLatent encoded = encoder_.forward(values, points, queries, tape);
  const std::vector<float> noise = noiseOf(encoded.mean.size(), example.seed);
  const std::vector<float> drawn_latent = drawLatent(encoded, noise);
  const ContextRows latent = {queries.size(), drawn_latent.data()};
  std::vector<float> by_latent(drawn_latent.size(), 0.0f);
  AutoencoderLosses losses;

  std::vector<uint64_t> leaves;
  const auto side = static_cast<float>(1 << sizes_.leaf_level);
  for (const size_t point :
       oneOfEachShare(object.surface.size() / 3, example.surface, example.seed)) {
    const auto cell = [&](size_t axis) {
      const float at = object.surface[point * 3 + axis] * side;
      return static_cast<uint32_t>(std::clamp(at, 0.0f, side - 1));
    };
    leaves.push_back(mortonEncode(cell(0), cell(1), cell(2)));
  }
  const std::vector<double> shares(leaves.size(), 1.0 / static_cast<double>(leaves.size()));
  const std::vector<OctreeLevel> levels = levelsAbove(leaves, sizes_.leaf_level, shares);
  const double factor = weights.structure * example.share;
  addDensity(values, latent, levels, -factor, gradients, by_latent.data(), losses.structure);
  losses.structure = factor > 0 ? losses.structure / factor : 0.0;
  for (const OctreeLevel& level : levels) losses.structure -= leastCrossEntropy(level);

  EncodedLatent by = {std::vector<float>(noise.size(), 0.0f),
                      std::vector<float>(noise.size(), 0.0f)};
  losses.divergence = addDivergence(encoded, static_cast<double>(noise.size()),
                                    weights.divergence * example.share, by);
  losses.total = weights.structure * losses.structure + weights.divergence * losses.divergence;
  if (example.stage != AutoencoderStage::kStructure) {
    addImages(values, example, weights, backends, latent, gradients, by_latent.data(), losses,
              progress);
  }
  if (example.keeps_encoder) return losses;
  drawLatentBackward(encoded, noise, by_latent, by);
  const std::vector<float*> nobody(points.size(), nullptr);
  encoder_.backward(values, points, tape, by, gradients, nobody);
  return losses;
}

ImageLossValue DensityAutoencoder::addColours(std::span<const float> values,
                                              std::span<const float> latent, const ObjectView& view,
                                              const AnchorDraw& draw, double ssim,
                                              const BackendFactory& backends,
                                              std::span<float> by_latent) const {
  const ContextRows rows = {latent.size() / sizes_.latent_width, latent.data()};
  Splats splats = splatsOf(values, rows, draw.anchors, draw.seed);
  const SplatCloud cloud = splats.aroundOrigin();
  SplatCloud by_all = zerosLike(cloud), by_view, by_colours = zerosLike(cloud);
  const bool is_white = keyedBits(draw.seed, RandomUse::kBackground, 0) & 1;
  const std::unique_ptr<ViewPass> pass = backends.makeViewPass();
  const ImageLossValue loss =
      addViewLoss(*pass, view, is_white, cloud, {}, ssim, 1, by_view, by_all, nullptr);
  by_colours.sh = std::move(by_all.sh);
  std::vector<float> of_weights(layout_.size(), 0.0f);  // Nobody asks for them.
  backwardOfSplats(values, rows, splats, by_colours, of_weights, by_latent.data());
  return loss;
}

std::vector<float> DensityAutoencoder::encode(std::span<const float> values,
                                              const TrainingObject& object, size_t tokens) const {
  TrainedEncoder::Tape tape;
  return encoder_.forward(values, pointsOf(object), farthestPoints(object.points[0], tokens), tape)
      .mean;
}

SplatCloud DensityAutoencoder::decode(std::span<const float> values, std::span<const float> latent,
                                      uint64_t anchors, uint64_t seed) const {
  const ContextRows rows = {latent.size() / sizes_.latent_width, latent.data()};
  return splatsOf(values, rows, anchors, seed).aroundOrigin();
}

}  // namespace stipple
