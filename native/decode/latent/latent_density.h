#pragma once

#include <memory>

#include "decode/latent/octree_network.h"
#include "density/density_model.h"

namespace stipple {

/// Log-softmax of each cell's eight logits. In: logits [cells, 8]. Out: [cells, 8]; it may be
/// `logits`.
void logProbabilitiesOf(std::span<const float> logits, std::span<float> out);

/// The density of a latent's object over the cube of side 1 around the origin, or where the
/// latent's placement has that cube, as a network tells it. What cells see of the latent is
/// computed at the first question and kept: a float for each token, head and block, and the tokens
/// twice (3 MiB for the published network and 8,192 tokens).
class LatentDensity final : public DensityModel {
 public:
  /// In: run: how the network is run; its progress is not looked at.
  /// Errors: kInvalidArgument for a latent that the network cannot read, a leaf level outside
  /// 1..kMaxLeafLevel.
  LatentDensity(std::shared_ptr<const OctreeNetwork> network, std::shared_ptr<const Latent> latent,
                const NetworkRun& run = {}, int leaf_level = OctreeNetwork::kLeafLevel);

  int leafLevel() const override { return leaf_level_; }
  const RootCube& root() const override { return root_; }
  /// Errors: kInvalidArgument for a level that is no parents'; those of OctreeNetwork::logits().
  void childLogProbabilities(int level, std::span<const uint64_t> cells, std::span<float> out,
                             Progress* progress = nullptr) const override;
  size_t questionCells() const override { return OctreeNetwork::kRows; }
  uint64_t answerMemoryBound() const override;

 private:
  std::shared_ptr<const OctreeNetwork> network_;
  std::shared_ptr<const Latent> latent_;
  NetworkRun run_;
  int leaf_level_;
  RootCube root_;
  KeptKeys keys_;
};

}  // namespace stipple
