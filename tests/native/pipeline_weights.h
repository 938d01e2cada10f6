#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <utility>

#include "io/bytes/safetensors.h"

namespace stipple {

/// Writes the four files of weights that a golden pipeline holds, as users have them. In: golden,
/// deg_pipeline_a.safetensors, whose tensors are named "weights.NETWORK.NAME"; folder, which
/// exists. Out: dino.safetensors, vae.safetensors, flow.safetensors, decoder.safetensors in it.
inline void splitPipelineWeights(const std::string& golden, const std::string& folder) {
  const SafeTensorsReader reader(golden);
  const std::map<std::string, CarriedTensor> tensors = reader.readOthers();
  for (const char* network : {"dino", "vae", "flow", "decoder"}) {
    const std::string prefix = std::string("weights.") + network + ".";
    SafeTensorsWriter writer;
    for (const auto& [name, tensor] : tensors) {
      if (name.rfind(prefix, 0) == 0) writer.carry(name.substr(prefix.size()), tensor);
    }
    writer.write(
        (std::filesystem::path(folder) / (network + std::string(".safetensors"))).string());
  }
}

}  // namespace stipple
