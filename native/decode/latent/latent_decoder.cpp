#include "decode/latent/latent_decoder.h"

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "decode/anchor_spacing.h"
#include "decode/splat_layout.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 14;
/// From the network's unit cube to the world, on each axis.
constexpr float kMiddle = 0.5f;

}  // namespace

LatentDecoder::LatentDecoder(std::shared_ptr<const GaussianNetwork> network,
                             std::shared_ptr<const Latent> latent, const NetworkRun& run)
    : network_(std::move(network)), latent_(std::move(latent)), run_(run) {
  requireLatent(*latent_, network_->latentWidth());
  run_.progress = nullptr;
}

SplatCloud LatentDecoder::decode(const DecodeRequest& request) const {
  if (request.gaussians_per_anchor != network_->gaussians()) {
    fail(ErrorCode::kInvalidArgument,
         "gaussians per anchor is " + std::to_string(request.gaussians_per_anchor) +
             "; these weights make " + std::to_string(network_->gaussians()));
  }
  NetworkRun run = run_;
  run.progress = request.progress;
  const AnchorSet& anchors = *request.anchors;
  const auto keys = keys_.get([&] { return network_->keysOf(run, *latent_); });
  const std::vector<float> features =
      network_->features(run, *keys, anchors.size(), anchors.positions.data());
  SplatCloud cloud = splatsOf(anchors, features);
  place(latent_->placement, cloud);
  advance(request.progress, 1.0, "Decoding splats");
  return cloud;
}

SplatCloud LatentDecoder::splatsOf(const AnchorSet& anchors,
                                   std::span<const float> features) const {
  const SplatLayout layout = {network_->gaussians(), 0};
  const std::vector<float> units = lengthUnits(anchors, network_->spacingUnit());
  const SplatBiases biases = {network_->lattice(), network_->spreadBias()};
  SplatCloud cloud;
  cloud.frame = Frame::kRFU;
  cloud.antialias = Antialias::kMip;
  activateSplats(layout, {anchors.positions, units}, features.data(), layout.outputs(), cloud,
                 &biases);
  parallelFor(cloud.positions.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) cloud.positions[i] -= kMiddle;
  });
  return cloud;
}

uint64_t LatentDecoder::memoryBound(uint64_t anchor_count, uint32_t gaussians_per_anchor) const {
  // Position, rotation, scale, opacity, colour; a unit for each anchor.
  constexpr uint64_t kSplat = (3 + 4 + 3 + 1 + 3) * sizeof(float);
  const uint64_t splats = anchor_count * (gaussians_per_anchor * kSplat + sizeof(float));
  // Packed weights and tiles of scores of each thread.
  constexpr uint64_t kLayers = uint64_t{64} << 20;
  const uint64_t spacing = network_->spacingUnit() > 0 ? anchor_count * kSpacingBytes : 0;
  return network_->keyBytes(latent_->token_count) + spacing + network_->memoryBound(anchor_count) +
         splats + kLayers;
}

void place(const LatentPlacement& placement, SplatCloud& cloud) {
  if (placement.scale == 1 && placement.offset == std::array<double, 3>{}) return;
  parallelFor(cloud.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = 3 * begin; i < 3 * end; ++i) {
      cloud.positions[i] = static_cast<float>(
          placement.scale * static_cast<double>(cloud.positions[i]) + placement.offset[i % 3]);
      cloud.scales[i] = static_cast<float>(placement.scale * static_cast<double>(cloud.scales[i]));
    }
  });
}

}  // namespace stipple
