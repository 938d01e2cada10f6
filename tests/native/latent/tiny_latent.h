#pragma once

#include <cstdint>
#include <cstring>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "data/latent.h"
#include "data/weight_table.h"
#include "decode/latent/latent_networks.h"
#include "io/assets/weight_file.h"

namespace stipple {

/// A small network of random weights with the names and the wiring of the published one, and a
/// latent of it.
inline WeightTable tinyFile(const std::string& path) {
  return openWeightFile(path).under("weights.");
}

inline std::shared_ptr<const Latent> tinyLatent(const std::string& path) {
  const WeightTable file = openWeightFile(path);
  auto latent = std::make_shared<Latent>();
  latent->tokens = file.floats("input.latent", {1, kAnySize, kAnySize});
  latent->token_count = latent->tokens.size() / latent->width;
  return latent;
}

/// Tensors of a file, for changing them. The bytes stay the file's.
inline std::map<std::string, WeightTensor> tensorsOf(const WeightTable& file) {
  std::map<std::string, WeightTensor> tensors;
  for (const std::string& name : file.names()) tensors[name] = *file.find(name);
  return tensors;
}

}  // namespace stipple
