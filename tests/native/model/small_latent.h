#pragma once

#include <memory>
#include <string>

#include "io/assets/weight_file.h"
#include "model/latent_splats.h"
#include "pipeline_weights.h"

namespace stipple::test {

/// Generated splats of a small random network of K = 32, which a golden holds.
/// In: golden: deg_pipeline_a.safetensors; folder: gets the network as decoder.safetensors.
inline std::shared_ptr<const SplatModel> smallLatent(const std::string& golden,
                                                     const std::string& folder) {
  splitPipelineWeights(golden, folder);
  const std::string file = folder + "/decoder.safetensors";
  const WeightTable numbers = openWeightFile(golden);
  auto latent = std::make_shared<Latent>();
  latent->tokens = numbers.floats("expect.sample.latent", {1, kAnySize, kAnySize});
  latent->token_count = latent->tokens.size() / latent->width;
  latent->camera = {1, 0, 0, 0.5f, 0.7f};
  return makeLatentSplats(readLatentNetworks(openWeightFile(file)), std::move(latent),
                          referenceOf(file), {"{\"seed\":42}", {}});
}

}  // namespace stipple::test
