#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "decode/latent/latent_decoder.h"
#include "decode/latent/latent_density.h"
#include "decode/latent/latent_networks.h"
#include "density/anchor_sampling.h"
#include "network_golden/recorded_splats.h"
#include "network_golden/stages.h"

namespace stipple {
namespace {

// The goldens are float32 sums in another order, on networks whose numbers are of order one.
constexpr StageTolerance kNetworkCall = {5e-5, 0};
// Anchors are multiples of 2^-24 here, and the encoding of positions multiplies them by up to
// 3,217.
constexpr StageTolerance kFromLatent = {1e-4, 1e-4};
// One float32 formula, and multiples of 2^-24.
constexpr StageTolerance kFormula = {1e-6, 1e-6};

/// Asks a network as the sampler does, and keeps the logits of each level for comparison.
class WatchedDensity final : public DensityModel {
 public:
  WatchedDensity(std::shared_ptr<const OctreeNetwork> network, std::shared_ptr<const Latent> latent,
                 const NetworkRun& run, int leaf_level)
      : density_(network, latent, run, leaf_level),
        network_(std::move(network)),
        run_(run),
        keys_(network_->keysOf(run, *latent)) {}
  int leafLevel() const override { return density_.leafLevel(); }
  const RootCube& root() const override { return density_.root(); }
  void childLogProbabilities(int level, std::span<const uint64_t> cells, std::span<float> out,
                             Progress* progress) const override {
    std::vector<float> logits(8 * cells.size());
    network_->logits(run_, keys_, level, cells, logits);
    seen.push_back(std::move(logits));
    density_.childLogProbabilities(level, cells, out, progress);
  }

  mutable std::vector<std::vector<float>> seen;  // per level

 private:
  LatentDensity density_;
  std::shared_ptr<const OctreeNetwork> network_;
  NetworkRun run_;
  LatentKeys keys_;
};

std::string levelName(const char* stem, int level) {
  return stem + std::to_string(level);
}

AnchorSet sampleStages(const GoldenFile& file, const LatentNetworks& networks,
                       std::shared_ptr<const Latent> latent, StageReport& report) {
  const int leaf_level = file.config().at("level").get<int>();
  const WatchedDensity density(networks.octree, std::move(latent), file.run(), leaf_level);
  RecordedUniformSource source(recordedUniforms(file));
  const uint64_t count = file.config().at("num_points").get<uint64_t>();
  AnchorSet anchors = sampleAnchors(density, {.count = count}, source);
  for (int level = 1; level <= leaf_level; ++level) {
    const std::string name = levelName("logits.level", level);
    report.compare(name, density.seen[static_cast<size_t>(level - 1)],
                   file.floats("expect." + name), kNetworkCall);
  }
  const std::vector<int64_t> drawn = {static_cast<int64_t>(source.drawnCount())};
  const std::vector<int64_t> recorded = {static_cast<int64_t>(recordedUniforms(file).size())};
  report.compareExactly("octree.draws", drawn, recorded);
  const std::vector<float> points = file.floats("expect.points");
  const std::vector<int64_t> leaves(anchors.leaves.begin(), anchors.leaves.end());
  report.compareExactly("octree.leaves", leaves, recordedLeaves(file));
  report.compare("points", anchors.positions, points, kFormula);
  report.compare("log_probs", anchors.log_q, file.floats("expect.log_probs"), kFromLatent);
  return anchors;
}

/// Logits of the cells that were recorded, whatever this network would draw.
AnchorSet recordedCellStages(const GoldenFile& file, const LatentNetworks& networks,
                             const Latent& latent, StageReport& report) {
  const int leaf_level = file.config().at("level").get<int>();
  const LatentKeys keys = networks.octree->keysOf(file.run(), latent);
  const std::vector<int64_t> leaves = recordedLeaves(file);
  for (int level = 1; level <= leaf_level; ++level) {
    std::vector<uint64_t> parents;
    for (const int64_t leaf : leaves) {
      parents.push_back(static_cast<uint64_t>(leaf) >> 3 * (leaf_level - level + 1));
    }
    std::sort(parents.begin(), parents.end());
    parents.erase(std::unique(parents.begin(), parents.end()), parents.end());
    std::vector<float> logits(8 * parents.size());
    networks.octree->logits(file.run(), keys, level - 1, parents, logits);
    const std::string name = levelName("logits.level", level);
    report.compare(name, logits, file.floats("expect." + name), kNetworkCall);
  }
  return recordedAnchors(file);
}

}  // namespace

void decoderStages(const GoldenFile& file, StageReport& report) {
  // Where anchors are given, the file is of training.
  if (!file.has("expect.gaussians.position") || file.has("input.anchors")) return;
  const bool is_pipeline = file.hasUnder("weights.decoder.");
  const LatentNetworks networks = readLatentNetworks(file.weights(is_pipeline ? "decoder." : ""));
  const std::string latent_name = is_pipeline ? "expect.sample.latent" : "input.latent";
  auto latent = std::make_shared<Latent>();
  latent->token_count = file.shape(latent_name).at(1);
  latent->width = static_cast<uint32_t>(file.shape(latent_name).at(2));
  latent->tokens = file.floats(latent_name);
  const AnchorSet anchors = report.judgement() == StageJudgement::kErrors
                                ? recordedCellStages(file, networks, *latent, report)
                                : sampleStages(file, networks, latent, report);

  const LatentDecoder decoder(networks.gaussians, latent, file.run());
  const std::vector<float> points = file.floats("expect.points");
  const std::vector<float> features = file.floats("expect.features");
  const LatentKeys keys = networks.gaussians->keysOf(file.run(), *latent);
  report.compare("features",
                 networks.gaussians->features(file.run(), keys, points.size() / 3, points.data()),
                 features, kNetworkCall);
  compareSplats("activated ", file, decoder.splatsOf(recordedAnchors(file), features), kFormula,
                report);
  DecodeRequest request;
  request.anchors = &anchors;
  request.gaussians_per_anchor = networks.gaussians->gaussians();
  compareSplats("decoded ", file, decoder.decode(request), kFromLatent, report);
}

}  // namespace stipple
