#pragma once

#include <string>

#include "data/tensor_table.h"
#include "decode/anchors/scaffold.h"

namespace stipple {

/// Calls visit(name, values, row length) for every array of a scaffold, in a fixed order:
/// "scaffold.positions", "scaffold.features", "scaffold.log_scales", "scaffold.offsets", and
/// "scaffold.opacity.layerI.weights" and ".biases" of each network. `Scaffold` may be const.
template <class Scaffold, class Visit>
void forEachScaffoldArray(Scaffold& scaffold, const Visit& visit) {
  visit(std::string("scaffold.positions"), scaffold.positions, size_t{3});
  visit(std::string("scaffold.features"), scaffold.features, kScaffoldFeatures);
  visit(std::string("scaffold.log_scales"), scaffold.log_scales, kScaffoldScales);
  visit(std::string("scaffold.offsets"), scaffold.offsets, size_t{scaffold.gaussians} * 3);
  const auto layers = [&](const char* name, auto& network) {
    for (size_t l = 0; l < network.layers().size(); ++l) {
      auto& layer = network.layers()[l];
      const std::string stem = "scaffold." + std::string(name) + ".layer" + std::to_string(l);
      visit(stem + ".weights", layer.weights, layer.outputs);
      visit(stem + ".biases", layer.biases, size_t{1});
    }
  };
  layers("opacity", scaffold.opacity);
  layers("covariance", scaffold.covariance);
  layers("colour", scaffold.colour);
}

/// Everything that it has learned, as named tensors.
TensorTable tensorsOfScaffold(const ScaffoldParameters& scaffold);

/// The other way round. In: like: everything that is no tensor. Errors: kFormat for tensors that
/// are missing, of another type, or do not fit together.
ScaffoldParameters scaffoldOfTensors(const TensorTable& table, const ScaffoldShape& like);

}  // namespace stipple
