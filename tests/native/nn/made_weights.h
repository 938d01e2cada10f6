#pragma once

#include <cmath>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/random.h"
#include "data/weight_table.h"

namespace stipple {

/// Numbers of -1..1, keyed by the seed.
inline std::vector<float> evenNumbers(size_t count, uint64_t seed) {
  std::vector<float> out(count);
  for (size_t i = 0; i < count; ++i) {
    out[i] = 2.0f * unitFloat(keyedBits(seed, RandomUse::kNetworkStart, i)) - 1.0f;
  }
  return out;
}

/// Weights that are made in a test, as a table that came from a file called "made".
class MadeWeights {
 public:
  void add(const std::string& name, std::vector<uint64_t> shape, std::vector<float> values) {
    values_->push_back(std::move(values));
    WeightTensor tensor;
    tensor.type = WeightType::kFloat32;
    tensor.type_name = "F32";
    tensor.shape = std::move(shape);
    tensor.bytes = reinterpret_cast<const uint8_t*>(values_->back().data());
    tensors_[name] = std::move(tensor);
  }

  /// Even numbers, times `scale`.
  void addRandom(const std::string& name, const std::vector<uint64_t>& shape, float scale) {
    size_t count = 1;
    for (const uint64_t size : shape) count *= static_cast<size_t>(size);
    std::vector<float> values = evenNumbers(count, ++seed_);
    for (float& value : values) value *= scale;
    add(name, shape, std::move(values));
  }

  /// name.weight and name.bias of a layer whose outputs are about as large as its inputs.
  void addLayer(const std::string& name, const std::vector<uint64_t>& shape) {
    float inputs = 1.0f;
    for (size_t i = 1; i < shape.size(); ++i) inputs *= static_cast<float>(shape[i]);
    addRandom(name + ".weight", shape, std::sqrt(3.0f / inputs));
    addRandom(name + ".bias", {shape[0]}, 0.1f);
  }

  /// name.weight near 1 and name.bias.
  void addNorm(const std::string& name, uint64_t channels) {
    std::vector<float> values = evenNumbers(static_cast<size_t>(channels), ++seed_);
    for (float& value : values) value = 1.0f + 0.2f * value;
    add(name + ".weight", {channels}, std::move(values));
    addRandom(name + ".bias", {channels}, 0.1f);
  }

  void remove(const std::string& name) { tensors_.erase(name); }
  WeightTable table() const { return {"made", tensors_, values_}; }

 private:
  // A deque, so that numbers stay where they are.
  std::shared_ptr<std::deque<std::vector<float>>> values_ =
      std::make_shared<std::deque<std::vector<float>>>();
  std::map<std::string, WeightTensor> tensors_;
  uint64_t seed_ = 0;
};

}  // namespace stipple
