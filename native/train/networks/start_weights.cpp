#include "train/networks/start_weights.h"

#include <algorithm>
#include <cmath>

#include "base/random.h"

namespace stipple {

std::vector<float> startWeights(const ParameterLayout& layout, uint64_t seed,
                                std::span<const std::string> silent) {
  std::vector<float> values(layout.size(), 0.0f);
  for (const Parameter& parameter : layout.parameters()) {
    const bool is_factor = parameter.name.ends_with("gamma") ||
                           (parameter.shape.size() == 1 && parameter.name.ends_with(".weight"));
    const bool is_silent = std::find(silent.begin(), silent.end(), parameter.name) != silent.end();
    for (size_t i = 0; i < parameter.count; ++i) {
      float& value = values[parameter.first + i];
      if (is_factor) value = 1.0f;
      if (is_factor || is_silent || parameter.shape.size() != 2) continue;
      const auto sides = static_cast<double>(parameter.shape[0] + parameter.shape[1]);
      const double u = unitDouble(keyedBits(seed, RandomUse::kNetworkStart, parameter.first + i));
      value = static_cast<float>(std::sqrt(6 / sides) * (2 * u - 1));
    }
  }
  return values;
}

}  // namespace stipple
