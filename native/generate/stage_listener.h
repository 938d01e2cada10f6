#pragma once

#include <cstddef>
#include <functional>
#include <string>

namespace stipple {

/// Numbers of a network on their way, for whoever compares them: rows [rows, width], `stride`
/// floats from row to row. They are the network's own, until the call returns.
struct StageNumbers {
  size_t rows = 0;
  size_t width = 0;
  size_t stride = 0;
  const float* values = nullptr;
};

/// Hears of each stage of a network by a name such as "layer0.attn"; empty: nobody listens.
using StageListener = std::function<void(const std::string& stage, const StageNumbers& numbers)>;

}  // namespace stipple
