#include "decode/latent/latent_density.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "base/error.h"

namespace stipple {

void logProbabilitiesOf(std::span<const float> logits, std::span<float> out) {
  for (size_t first = 0; first < logits.size(); first += 8) {
    const std::span<const float> of = logits.subspan(first, 8);
    const auto peak = static_cast<double>(*std::max_element(of.begin(), of.end()));
    double sum = 0;
    for (const float logit : of) sum += std::exp(static_cast<double>(logit) - peak);
    const double whole = peak + std::log(sum);
    for (size_t k = 0; k < 8; ++k) {
      out[first + k] = static_cast<float>(static_cast<double>(of[k]) - whole);
    }
  }
}

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
  logProbabilitiesOf(out.first(8 * cells.size()), out);
}

uint64_t LatentDensity::answerMemoryBound() const {
  return network_->keyBytes(latent_->token_count) + network_->workBytes();
}

}  // namespace stipple
