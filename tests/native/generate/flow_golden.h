#pragma once

#include <algorithm>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "data/latent.h"
#include "data/weight_table.h"
#include "generate/flow_network.h"
#include "generate/image_condition.h"
#include "io/assets/weight_file.h"

namespace stipple::testing {

/// A recorded run of a small flow network (tests/data/networks): weights, inputs, expectations.
class FlowGolden {
 public:
  /// In: weights_prefix: of the names of the flow network's weights.
  FlowGolden(const std::string& path, const std::string& weights_prefix)
      : file_(openWeightFile(path)), weights_(file_.under(weights_prefix)) {}

  /// A new table each time, of which nothing has been read yet.
  WeightTable weights() const {
    return weightsWith([](auto&) {});
  }
  /// The same with changed tensors. In: change(tensors by name).
  template <typename Change>
  WeightTable weightsWith(const Change& change) const {
    std::map<std::string, WeightTensor> tensors;
    for (const std::string& name : weights_.names()) tensors[name] = *weights_.find(name);
    change(tensors);
    return WeightTable("flow.safetensors", tensors, nullptr);
  }

  std::vector<float> floats(const std::string& name) const {
    std::vector<float> values(tensor(name).count());
    widen(tensor(name), 0, values);
    return values;
  }
  Latent latent(const std::string& name) const {
    Latent latent;
    latent.token_count = tensor(name + ".latent").shape.at(1);
    latent.width = static_cast<uint32_t>(tensor(name + ".latent").shape.at(2));
    latent.tokens = floats(name + ".latent");
    const std::vector<float> camera = floats(name + ".camera");
    std::copy_n(camera.begin(), kCameraWidth, latent.camera.begin());
    return latent;
  }
  ImageCondition condition(const std::string& structure, const std::string& colour) const {
    ImageCondition condition;
    condition.rows = tensor(structure).shape.at(1);
    condition.structure_width = static_cast<uint32_t>(tensor(structure).shape.at(2));
    condition.colour_width = static_cast<uint32_t>(tensor(colour).shape.at(2));
    condition.structure = floats(structure);
    condition.colour = floats(colour);
    return condition;
  }

 private:
  const WeightTensor& tensor(const std::string& name) const {
    const WeightTensor* found = file_.find(name);
    if (found == nullptr) throw std::out_of_range("the golden file has no " + name);
    return *found;
  }

  WeightTable file_, weights_;
};

/// One call of a network of 96 channels, 64 tokens, 20 rows of context, and four steps with it.
const FlowGolden& flowGolden();
ImageCondition flowCondition();
constexpr double kFlowGoldenTime = 0.7;

/// Four steps of a network of 64 channels, 64 tokens, 21 rows of context, call by call.
const FlowGolden& pipelineGolden();
ImageCondition pipelineCondition();

void expectLatentsNear(const Latent& seen, const Latent& expected, float tolerance);
void expectSameLatents(const Latent& seen, const Latent& expected);

}  // namespace stipple::testing
