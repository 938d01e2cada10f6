#include "decode/latent/latent_networks.h"

#include <span>
#include <string>

#include "base/error.h"

namespace stipple {

namespace {

constexpr const char* kOctreePrefixes[] = {"octree.", "decoder.", "models.decoder."};
constexpr const char* kGaussianPrefixes[] = {"gs.", "decoder_gs.", "models.decoder_gs."};

/// The tensors of a network: those under the first prefix that has `telltale`, which no other
/// network has.
WeightTable findNetwork(const WeightTable& file, std::span<const char* const> prefixes,
                        const std::string& telltale, const char* what) {
  std::string looked_for;
  for (const char* prefix : prefixes) {
    const WeightTable network = file.under(prefix);
    if (network.has(telltale)) return network;
    looked_for += (looked_for.empty() ? "" : ", ") + (prefix + telltale);
  }
  const std::vector<std::string> names = file.names();
  fail(ErrorCode::kFormat,
       file.source() + " has no " + what + ": no tensor is called " + looked_for + "; " +
           (names.empty()
                ? "it has none at all"
                : "its first of " + std::to_string(names.size()) + " is " + names.front()));
}

void refuseUnread(const WeightTable& network) {
  const std::vector<std::string> unread = network.unread();
  if (unread.empty()) return;
  fail(ErrorCode::kFormat, network.source() + " has " + std::to_string(unread.size()) +
                               (unread.size() == 1 ? " tensor" : " tensors") +
                               " that a decoder of latents does not have, the first is " +
                               unread.front() + "; none are allowed");
}

}  // namespace

LatentNetworks readLatentNetworks(const WeightTable& file) {
  const WeightTable octree =
      findNetwork(file, kOctreePrefixes, "l_embedder.mlp.0.weight", "density network of latents");
  const WeightTable gaussians = findNetwork(file, kGaussianPrefixes, "points_offset_perturbation",
                                            "Gaussian network of latents");
  LatentNetworks networks = {std::make_shared<const OctreeNetwork>(octree),
                             std::make_shared<const GaussianNetwork>(gaussians)};
  refuseUnread(octree);
  refuseUnread(gaussians);
  if (networks.octree->latentWidth() != networks.gaussians->latentWidth()) {
    fail(ErrorCode::kFormat, file.source() + ": its density network reads latents of " +
                                 std::to_string(networks.octree->latentWidth()) +
                                 " numbers for each token, its Gaussian "
                                 "network of " +
                                 std::to_string(networks.gaussians->latentWidth()) +
                                 "; both must read the same");
  }
  return networks;
}

}  // namespace stipple
