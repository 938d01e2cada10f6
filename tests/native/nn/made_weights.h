#pragma once

#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "data/weight_table.h"
#include "nn/test_numbers.h"

namespace stipple {

/// Random weights of whole layers, as a table.
class MadeWeights {
 public:
  void add(const std::string& name, std::vector<uint64_t> shape, const std::vector<float>& values) {
    if (name != left_out_) builder_.add(name, std::move(shape), values);
  }

  /// Even numbers, times `scale`.
  void addRandom(const std::string& name, const std::vector<uint64_t>& shape, float scale) {
    size_t count = 1;
    for (const uint64_t size : shape) count *= static_cast<size_t>(size);
    std::vector<float> values = numbers(count, ++seed_);
    for (float& value : values) value *= scale;
    add(name, shape, values);
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
    std::vector<float> values = numbers(static_cast<size_t>(channels), ++seed_);
    for (float& value : values) value = 1.0f + 0.2f * value;
    add(name + ".weight", {channels}, values);
    addRandom(name + ".bias", {channels}, 0.1f);
  }

  /// From now on, this tensor is not added.
  void leaveOut(const std::string& name) { left_out_ = name; }
  WeightTable table() const { return builder_.table(); }

 private:
  TableBuilder builder_;
  std::string left_out_;
  uint64_t seed_ = 0;
};

}  // namespace stipple
