#include "decode/latent/latent_density.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "base/error.h"

namespace stipple {

LatentDensity::LatentDensity(std::shared_ptr<const OctreeNetwork> network,
                             std::shared_ptr<const Latent> latent, const NetworkRun& run,
                             int leaf_level)
    : network_(std::move(network)), latent_(std::move(latent)), run_(run), leaf_level_(leaf_level) {
  if (leaf_level < 1 || leaf_level > kMaxLeafLevel) {
    fail(ErrorCode::kInvalidArgument, "the leaf level of a latent's density is " +
                                          std::to_string(leaf_level) + "; allowed is 1 to " +
                                          std::to_string(kMaxLeafLevel));
  }
  requireLatent(*latent_, network_->latentWidth());
  const LatentPlacement& placement = latent_->placement;
  root_.side = placement.scale;
  for (size_t axis = 0; axis < 3; ++axis) {
    root_.origin[axis] = placement.offset[axis] - placement.scale / 2;
  }
  run_.progress = nullptr;
}

void LatentDensity::childLogProbabilities(int level, std::span<const uint64_t> cells,
                                          std::span<float> out, Progress* progress) const {
  if (level < 0 || level >= leaf_level_) {
    fail(ErrorCode::kInvalidArgument, "the level of the cells is " + std::to_string(level) +
                                          "; allowed is 0 to " + std::to_string(leaf_level_ - 1));
  }
  NetworkRun run = run_;
  run.progress = progress;
  const auto keys = keys_.get([&] { return network_->keysOf(run, *latent_); });
  network_->logits(run, *keys, level, cells, out);
  for (size_t i = 0; i < cells.size(); ++i) {
    float* logits = &out[i * 8];
    const double most = static_cast<double>(*std::max_element(logits, logits + 8));
    double sum = 0;
    for (size_t k = 0; k < 8; ++k) sum += std::exp(static_cast<double>(logits[k]) - most);
    const double whole = most + std::log(sum);
    for (size_t k = 0; k < 8; ++k) {
      logits[k] = static_cast<float>(static_cast<double>(logits[k]) - whole);
    }
  }
}

uint64_t LatentDensity::answerMemoryBound() const {
  return network_->keyBytes(latent_->token_count) + network_->workBytes();
}

}  // namespace stipple
