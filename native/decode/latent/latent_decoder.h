#pragma once

#include <memory>

#include "decode/decoder.h"
#include "decode/latent/gaussian_network.h"

namespace stipple {

/// Anchors become K Gaussians each by a network that sees all anchors and a latent. Splats are in
/// the cube of side 1 around the origin or up to 0.75 of their spread outside it, z up, and then
/// where the latent's placement has them. What anchors see of the latent is computed by the first
/// decode and kept: a float for each token, head and block, and the tokens twice (9 MiB for the
/// published network and 8,192 tokens).
class LatentDecoder final : public Decoder {
 public:
  /// In: run: how the network is run; its progress is not looked at.
  /// Errors: kInvalidArgument for a latent that the network cannot read.
  LatentDecoder(std::shared_ptr<const GaussianNetwork> network,
                std::shared_ptr<const Latent> latent, const NetworkRun& run = {});

  const GaussianNetwork& network() const { return *network_; }
  /// Errors: kInvalidArgument for another K than the network's; those of
  /// GaussianNetwork::features(). Cost: O(anchors^2 + anchors * tokens).
  SplatCloud decode(const DecodeRequest& request) const override;
  uint64_t memoryBound(uint64_t anchor_count, uint32_t gaussians_per_anchor) const override;

  /// What decode() does behind the network, without the placement. In: features, as the network
  /// returns them.
  SplatCloud splatsOf(const AnchorSet& anchors, std::span<const float> features) const;

 private:
  std::shared_ptr<const GaussianNetwork> network_;
  std::shared_ptr<const Latent> latent_;
  NetworkRun run_;
  KeptKeys keys_;
};

/// Moves splats of the networks to where they shall stand.
void place(const LatentPlacement& placement, SplatCloud& cloud);

}  // namespace stipple
