#include "io/assets/network_tensors.h"

#include <cmath>
#include <vector>

#include "io/assets/asset_header.h"
#include "io/splats/ply/ply_file.h"

namespace stipple {

void requireNetworkTensors(const TensorTable& tensors, const std::string& stem,
                           const std::string& name, ErrorCode code) {
  const std::string kind = stem.substr(0, stem.size() - 1);
  if (tensors.empty()) fail(code, name + " has no tensors of a " + kind + "; they are needed");
  for (const auto& [tensor_name, tensor] : tensors) {
    const auto* values = std::get_if<std::vector<float>>(&tensor.values);
    if (!tensor_name.starts_with(stem) || values == nullptr) {
      fail(code, name + ": tensor " + tensor_name + " is not one of a " + kind +
                     "; names begin with '" + stem + "', values are float32");
    }
    for (const float value : *values) {
      if (std::isfinite(value)) continue;
      fail(code, name + ": tensor " + tensor_name + " holds " + std::to_string(value) +
                     "; every value must be a finite number");
    }
  }
}

TensorTable readNetworkTensors(const SafeTensorsReader& file, const std::string& stem) {
  TensorTable tensors;
  for (const auto& [name, tensor] : file.tensors()) {
    if (name.starts_with(stem)) tensors[name] = file.readTensor(name);
  }
  return tensors;
}

void setSplatFlags(SafeTensorsWriter& file, ColourSpace colour_space, Antialias antialias) {
  const bool display = colour_space == ColourSpace::kDisplay;
  file.setMetadata("colour_space", display ? kColourSpaceDisplay : kColourSpaceLinear);
  file.setMetadata("antialias", antialias == Antialias::kMip ? "mip" : "classic");
}

void readSplatFlags(const SafeTensorsReader& file, ColourSpace& colour_space,
                    Antialias& antialias) {
  colour_space = isFirstText(file, "colour_space", kColourSpaceDisplay, kColourSpaceLinear)
                     ? ColourSpace::kDisplay
                     : ColourSpace::kLinear;
  antialias =
      isFirstText(file, "antialias", "mip", "classic") ? Antialias::kMip : Antialias::kClassic;
}

}  // namespace stipple
