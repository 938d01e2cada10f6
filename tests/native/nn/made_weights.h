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

  /// Random numbers of a size that suits what the name says: weights of layers make outputs about
  /// as large as inputs, those of norms are near 1, everything else is small.
  void addAsNamed(const std::string& name, const std::vector<uint64_t>& shape) {
    const bool is_weight = name.ends_with(".weight");
    if (is_weight && shape.size() == 1) {
      std::vector<float> values = numbers(static_cast<size_t>(shape[0]), ++seed_);
      for (float& value : values) value = 1.0f + 0.2f * value;
      add(name, shape, values);
      return;
    }
    float inputs = 1.0f;
    for (size_t i = 1; i < shape.size(); ++i) inputs *= static_cast<float>(shape[i]);
    addRandom(name, shape, is_weight ? std::sqrt(3.0f / inputs) : 0.2f);
  }

  /// name.weight and name.bias. In: shape: of the weight.
  void addLayer(const std::string& name, const std::vector<uint64_t>& shape) {
    addAsNamed(name + ".weight", shape);
    addAsNamed(name + ".bias", {shape[0]});
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
