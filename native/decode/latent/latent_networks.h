#pragma once

#include <memory>

#include "data/weight_table.h"
#include "decode/latent/gaussian_network.h"
#include "decode/latent/octree_network.h"

namespace stipple {

/// The two networks that decode a latent. They read the same latents.
struct LatentNetworks {
  std::shared_ptr<const OctreeNetwork> octree;
  std::shared_ptr<const GaussianNetwork> gaussians;
  LatentRange range = {};  ///< for whoever knows another than the published one
};

/// Finds them in a file by the names of its tensors: "octree." and "gs.", as they are published, or
/// "decoder." and "decoder_gs.", as they are trained, with "models." before them or without.
/// Errors: kFormat, naming file and tensor, for a file that has none of them, and for tensors that
/// are missing, too many, or of other shapes than the rest of the file wants.
LatentNetworks readLatentNetworks(const WeightTable& file);

}  // namespace stipple
