#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include "decode/splat_layout.h"
#include "density/contribution_normalisation.h"
#include "math/morton.h"
#include "network_golden/compare_share.h"
#include "network_golden/stages.h"
#include "train/networks/autoencoder_losses.h"
#include "train/networks/trained_encoder.h"
#include "train/networks/trained_gaussians.h"
#include "train/networks/trained_octree.h"

namespace stipple {
namespace {

// Goldens are in double, stored as float32. A run of theirs in float32 is off by 4e-6 of the
// largest number of a tensor; each of ours has fewer bits in its sums here and there.
constexpr double kShareOfLargest = 3e-5;
// The encoding of levels has seven frequencies of 128 whose last bit is another one in the golden,
// and their angles reach 1,600: numbers of order one are 5.4e-5 apart there, and so is what they
// are multiplied by.
constexpr double kShareOfEncoding = 1e-4;

std::vector<float> narrowed(std::span<const double> values) {
  return {values.begin(), values.end()};
}

NetworkShape shapeOf(const GoldenFile& file) {
  NetworkShape shape;
  shape.heads = file.config().at("heads").get<size_t>();
  shape.head_width = file.config().at("C").get<size_t>() / shape.heads;
  shape.latent_width = file.config().at("latent_channels").get<size_t>();
  shape.block_count = file.config().at("blocks").get<size_t>();
  return shape;
}

/// Rows of eight numbers of one level, which lie in the library's order of cells, in the file's.
std::vector<float> inOrderOf(const GoldenFile& file, const std::string& stem,
                             const OctreeLevel& level, std::span<const float> rows) {
  std::vector<float> made;
  const std::vector<int64_t> parents = file.integers(stem + ".parents");
  for (size_t i = 0; i < parents.size() / 3; ++i) {
    const uint64_t cell = mortonEncode(static_cast<uint32_t>(parents[i * 3]),
                                       static_cast<uint32_t>(parents[i * 3 + 1]),
                                       static_cast<uint32_t>(parents[i * 3 + 2]));
    const auto at = std::lower_bound(level.cells.begin(), level.cells.end(), cell);
    const auto row = static_cast<size_t>(at - level.cells.begin());
    made.insert(made.end(), rows.begin() + static_cast<long>(row * 8),
                rows.begin() + static_cast<long>(row * 8 + 8));
  }
  return made;
}

void compareGradients(const GoldenFile& file, const ParameterLayout& layout,
                      std::span<const float> gradients, StageReport& report) {
  for (const Parameter& parameter : layout.parameters()) {
    const std::string name = "grad.weights." + parameter.name;
    const bool is_encoded = parameter.name == "octree.l_embedder.mlp.0.weight";
    compareShare(name, gradients.subspan(parameter.first, parameter.count), file.floats(name),
                 is_encoded ? kShareOfEncoding : kShareOfLargest, report);
  }
}

/// The density gradient: from what anchors do to a loss to the weights and the latent.
void densityStages(const GoldenFile& file, StageReport& report) {
  if (!file.has("input.reward")) return;
  const int leaf_level = file.config().at("level").get<int>();
  ParameterLayout layout;
  const TrainedOctree octree(layout, "octree.", shapeOf(file));
  const std::vector<float> values = layout.read(file.weights());
  std::vector<float> gradients(layout.size(), 0.0f);
  const std::vector<float> latent = file.floats("input.latent"),
                           reward = file.floats("input.reward");
  const std::vector<int64_t> leaves = file.integers("input.leaf");
  const std::vector<uint64_t> shape = file.shape("input.latent");
  const size_t batch = shape.at(0), tokens = shape.at(1), anchors = reward.size() / batch;
  std::vector<float> latent_gradient(latent.size(), 0.0f), all_g, all_log_q;
  double surrogate = 0;
  for (size_t b = 0; b < batch; ++b) {
    std::vector<double> g(reward.begin() + static_cast<long>(b * anchors),
                          reward.begin() + static_cast<long>((b + 1) * anchors));
    normaliseContributions({.counts_neutral = true}, g);
    const std::vector<float> of_sample = narrowed(g);
    all_g.insert(all_g.end(), of_sample.begin(), of_sample.end());
    std::vector<uint64_t> codes;
    for (size_t i = b * anchors; i < (b + 1) * anchors; ++i) {
      codes.push_back(mortonEncode(static_cast<uint32_t>(leaves[i * 3]),
                                   static_cast<uint32_t>(leaves[i * 3 + 1]),
                                   static_cast<uint32_t>(leaves[i * 3 + 2])));
    }
    const std::vector<OctreeLevel> levels = levelsAbove(codes, leaf_level, g);
    TrainedOctree::Tape tape;
    const float* sample = &latent[b * tokens * shape.at(2)];
    const std::vector<float> logits = octree.forward(values, tokens, sample, levels, tape);
    std::vector<float> by_logits(logits.size());
    surrogate += weighLogProbabilities(levels, logits, 1.0, by_logits);
    octree.backward(values, tokens, sample, levels, tape, by_logits, gradients,
                    &latent_gradient[b * tokens * shape.at(2)]);
    size_t row = 0;
    for (const OctreeLevel& level : levels) {
      const std::string stem =
          "expect.s" + std::to_string(b) + ".level" + std::to_string(level.level + 1);
      const auto part = [&](std::span<const float> rows) {
        return inOrderOf(file, stem, level, rows.subspan(row * 8, level.cells.size() * 8));
      };
      compareShare(stem + ".logits", part(logits), file.floats(stem + ".logits"), kShareOfLargest,
                   report);
      compareShare("grad." + stem + ".logits", part(by_logits),
                   file.floats("grad." + stem + ".logits"), kShareOfLargest, report);
      row += level.cells.size();
    }
  }
  compareShare("g", all_g, file.floats("expect.g"), 1e-6, report);
  const std::vector<float> whole = {static_cast<float>(surrogate)};
  compareShare("surrogate", whole, file.floats("expect.surrogate"), kShareOfLargest, report);
  compareShare("grad.input.latent", latent_gradient, file.floats("grad.input.latent"),
               kShareOfLargest, report);
  compareGradients(file, layout, gradients, report);
}

/// Rows of sample b of a tensor [batch, ...].
template <class Number>
std::vector<Number> sampleOf(const std::vector<Number>& all, size_t batch, size_t b) {
  const auto count = static_cast<long>(all.size() / batch), first = static_cast<long>(b) * count;
  return {all.begin() + first, all.begin() + first + count};
}

uint64_t leafOf(const float* point) {
  constexpr float kSide = 256;
  const auto cell = [](float at) {
    return static_cast<uint32_t>(std::clamp(at * kSide, 0.0f, kSide - 1));
  };
  return mortonEncode(cell(point[0]), cell(point[1]), cell(point[2]));
}

/// The networks of an autoencoder, and all that a step of its training adds up.
struct Autoencoder {
  explicit Autoencoder(const GoldenFile& golden)
      : file(golden),
        batch(file.shape("input.points1").at(0)),
        loss_weights(file.floats("input.loss_weights")) {}

  const GoldenFile& file;
  size_t batch;
  std::vector<float> loss_weights;  // lin, vol, op, sph, kl, struct
  ParameterLayout layout;
  const NetworkShape shape = {
      file.config().at("enc_heads").get<size_t>(),
      file.config().at("C").get<size_t>() / file.config().at("enc_heads").get<size_t>(),
      file.config().at("latent_channels").get<size_t>(),
      file.config().at("enc_blocks").get<size_t>(), 4};
  const std::vector<size_t> features = {file.config().at("cond").get<size_t>(),
                                        file.config().at("cond2").get<size_t>()};
  const uint32_t gaussians = file.config().at("gaussians_per_anchor").get<uint32_t>();
  const TrainedEncoder encoder{layout, "encoder.", shape, features};
  const TrainedOctree octree{layout, "octree.", shape};
  const TrainedGaussians splats{layout, "gs.", shape, gaussians};
  const std::vector<float> values = layout.read(file.weights());
  std::vector<float> gradients = std::vector<float>(layout.size(), 0.0f);
  std::vector<double> losses = std::vector<double>(9, 0.0);
  std::map<std::string, std::vector<float>> seen;

  void keep(const std::string& name, std::span<const float> numbers) {
    seen[name].insert(seen[name].end(), numbers.begin(), numbers.end());
  }
  std::vector<float> part(const std::string& name, size_t b) const {
    return sampleOf(file.floats(name), batch, b);
  }

  /// The linear loss, and the derivative by it.
  void addWeighted(size_t b, const SplatCloud& cloud, SplatCloud& gradient) {
    const auto add = [&](const char* name, const std::vector<float>& of_cloud,
                         std::vector<float>& of_gradient, double shift) {
      const std::vector<float> weights = part(std::string("input.w.") + name, b);
      for (size_t i = 0; i < weights.size(); ++i) {
        losses[0] += static_cast<double>(weights[i]) * (static_cast<double>(of_cloud[i]) - shift);
        of_gradient[i] += loss_weights[0] * weights[i];
      }
    };
    add("position", cloud.positions, gradient.positions, 0.5);
    add("scale", cloud.scales, gradient.scales, 0);
    add("rotation_wxyz", cloud.rotations, gradient.rotations, 0);
    add("opacity", cloud.opacities, gradient.opacities, 0);
    add("sh_dc", cloud.sh, gradient.sh, 0);
  }

  /// Derivatives by the latent of what its splats lose.
  void splatsOf(size_t b, const ContextRows& latent, float* by_latent) {
    const std::vector<float> anchors = part("input.anchors", b);
    const size_t count = anchors.size() / 3;
    const std::vector<float> units(count, 1.0f);
    const SplatLayout outputs = {gaussians, 0};
    TrainedGaussians::Tape tape;
    const std::vector<float> raw = splats.forward(values, latent, count, anchors.data(), tape);
    SplatCloud cloud, gradient;
    activateSplats(outputs, {anchors, units}, raw.data(), outputs.outputs(), cloud);
    gradient.sh_degree = 0;
    gradient.resize(cloud.size());
    for (auto* numbers : {&gradient.positions, &gradient.scales, &gradient.rotations,
                          &gradient.opacities, &gradient.sh}) {
      std::fill(numbers->begin(), numbers->end(), 0.0f);
    }
    addWeighted(b, cloud, gradient);
    const double share = 1.0 / static_cast<double>(batch);
    const SplatLosses found =
        addSplatLosses({static_cast<double>(loss_weights[1]), static_cast<double>(loss_weights[2]),
                        static_cast<double>(loss_weights[3])},
                       share, anchors, gaussians, cloud, gradient);
    losses[1] += share * found.volume;
    losses[2] += share * found.opacity;
    losses[6] += share * found.off_centre;
    losses[7] += share * found.overlap;
    std::vector<float> by_raw(raw.size());
    activateSplatsBackward(outputs, {anchors, units}, raw.data(), outputs.outputs(), cloud,
                           gradient, by_raw.data());
    splats.backward(values, latent, count, anchors.data(), tape, by_raw, gradients, by_latent);
    keep("expect.features", raw);
    keep("grad.expect.features", by_raw);
    keep("expect.gaussians.scale", cloud.scales);
    keep("expect.gaussians.opacity", cloud.opacities);
    keep("expect.gaussians.rotation_wxyz", cloud.rotations);
  }

  /// The same of where its density is.
  void densityOf(size_t b, const ContextRows& latent, float* by_latent) {
    const std::vector<float> points = part("input.surface_points", b);
    std::vector<uint64_t> leaves;
    for (size_t i = 0; i < points.size() / 3; ++i) leaves.push_back(leafOf(&points[i * 3]));
    const std::vector<double> shares(leaves.size(), 1.0 / static_cast<double>(leaves.size()));
    const std::vector<OctreeLevel> levels =
        levelsAbove(leaves, file.config().at("levels").get<int>(), shares);
    TrainedOctree::Tape tape;
    const std::vector<float> logits =
        octree.forward(values, latent.count, latent.values, levels, tape);
    std::vector<float> by_logits(logits.size());
    const auto weight = static_cast<double>(loss_weights[5]);
    const double share = 1.0 / static_cast<double>(batch);
    losses[5] += weighLogProbabilities(levels, logits, -weight * share, by_logits) / weight;
    for (const OctreeLevel& level : levels) {
      losses[5] -= share * leastCrossEntropy(level);
      const std::vector<float> least = {static_cast<float>(leastCrossEntropy(level))};
      keep("expect.struct.base", least);
    }
    octree.backward(values, latent.count, latent.values, levels, tape, by_logits, gradients,
                    by_latent);
  }

  void addSample(size_t b, StageReport& report) {
    const std::vector<float> points1 = part("input.points1", b), feat1 = part("input.feat1", b);
    const std::vector<float> points2 = part("input.points2", b), feat2 = part("input.feat2", b);
    const std::vector<float> noise = part("input.eps", b);
    const std::vector<int64_t> recorded = sampleOf(file.integers("input.fps_index"), batch, b);
    const std::vector<uint32_t> queries = farthestPoints(points1, recorded.size());
    const std::vector<int64_t> taken(queries.begin(), queries.end());
    report.compareExactly("farthest points " + std::to_string(b), taken, recorded);
    const std::vector<FeaturePoints> points = {{points1.size() / 3, points1.data(), feat1.data()},
                                               {points2.size() / 3, points2.data(), feat2.data()}};
    TrainedEncoder::Tape tape;
    const EncodedLatent encoded = encoder.forward(values, points, queries, tape);
    const std::vector<float> z = drawLatent(encoded, noise);
    std::vector<float> by_z(z.size(), 0.0f);
    splatsOf(b, {queries.size(), z.data()}, by_z.data());
    densityOf(b, {queries.size(), z.data()}, by_z.data());
    EncodedLatent by;
    by.mean.assign(z.size(), 0.0f);
    by.log_variance.assign(z.size(), 0.0f);
    losses[4] += addDivergence(encoded, static_cast<double>(batch * z.size()),
                               static_cast<double>(loss_weights[4]), by);
    drawLatentBackward(encoded, noise, by_z, by);
    std::vector<float> by_feat1(feat1.size()), by_feat2(feat2.size());
    float* const by_features[] = {by_feat1.data(), by_feat2.data()};
    encoder.backward(values, points, tape, by, gradients, by_features);
    keep("expect.mu", encoded.mean);
    keep("expect.logvar", encoded.log_variance);
    keep("expect.z", z);
    keep("grad.expect.z", by_z);
    keep("grad.expect.mu", by.mean);
    keep("grad.expect.logvar", by.log_variance);
    keep("grad.input.feat1", by_feat1);
    keep("grad.input.feat2", by_feat2);
  }
};

/// A step of the autoencoder: losses, and the derivative of their sum by every weight.
void autoencoderStages(const GoldenFile& file, StageReport& report) {
  if (!file.has("input.surface_points")) return;
  Autoencoder all(file);
  for (size_t b = 0; b < all.batch; ++b) all.addSample(b, report);
  all.losses[3] = all.losses[6] + all.losses[7];
  for (size_t i = 0; i < all.loss_weights.size(); ++i) {
    all.losses[8] += static_cast<double>(all.loss_weights[i]) * all.losses[i];
  }
  const std::vector<float> expected = file.floats("expect.losses");
  const std::vector<std::string> order =
      file.config().at("loss_order").get<std::vector<std::string>>();
  for (size_t i = 0; i < order.size(); ++i) {
    const std::vector<float> loss = {static_cast<float>(all.losses[i])};
    compareShare("loss " + order[i], loss, std::span(expected).subspan(i, 1), kShareOfLargest,
                 report);
  }
  for (const auto& [name, numbers] : all.seen) {
    compareShare(name, numbers, file.floats(name), kShareOfLargest, report);
  }
  compareGradients(file, all.layout, all.gradients, report);
}

}  // namespace

void trainingStages(const GoldenFile& file, StageReport& report) {
  densityStages(file, report);
  autoencoderStages(file, report);
}

}  // namespace stipple
