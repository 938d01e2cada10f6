#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <variant>
#include <vector>

namespace stipple {

/// Numbers with a shape, row-major.
struct Tensor {
  std::vector<uint64_t> shape;
  std::variant<std::vector<float>, std::vector<double>, std::vector<uint8_t>, std::vector<uint32_t>,
               std::vector<uint64_t>>
      values;
};

/// Named tensors: what a checkpoint or an asset file keeps of a part of the program. Names are
/// paths with points ("raw.positions", "adam.first.logits", "strategy.gradient_sums").
using TensorTable = std::map<std::string, Tensor>;

}  // namespace stipple
