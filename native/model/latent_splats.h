#pragma once

#include <memory>
#include <string>

#include "data/latent.h"
#include "decode/latent/latent_networks.h"
#include "io/assets/weights_reference.h"
#include "model/splat_model.h"

namespace stipple {

/// The networks of a file, with the range that they learned with. Errors: those of
/// openWeightFile(), readLatentNetworks() and latentRangeOf().
LatentNetworks openLatentNetworks(const std::string& path);

/// The kind "latent": a latent of density-sampled Gaussians, whose density and splats are the work
/// of two networks. In: networks, latent: what they read; weights: the file that the networks are
/// of, which assets name; run: how the networks are run.
/// Errors: kInvalidArgument for a latent that the networks cannot read.
std::shared_ptr<const SplatModel> makeLatentSplats(const LatentNetworks& networks,
                                                   std::shared_ptr<const Latent> latent,
                                                   WeightsReference weights, ModelNotes notes = {},
                                                   const NetworkRun& run = {});

}  // namespace stipple
