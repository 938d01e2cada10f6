#include "network_golden/rounded_weights.h"

#include <bit>
#include <cmath>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace stipple {
namespace {

/// Keeps all but the lowest `dropped` bits of the mantissa: to the nearest, ties to even. A carry
/// goes on into the exponent, as it should.
float withoutBits(float value, int dropped) {
  uint32_t bits = std::bit_cast<uint32_t>(value);
  const uint32_t half = uint32_t{1} << (dropped - 1);
  bits += half - 1 + (bits >> dropped & 1);
  return std::bit_cast<float>(bits >> dropped << dropped);
}

float toFloat16(float value) {
  constexpr float kSmallestNormal = 0x1p-14f, kLargest = 65504.0f;
  // Below, all numbers are multiples of 2^-24.
  if (std::abs(value) < kSmallestNormal) return std::nearbyint(value * 0x1p24f) * 0x1p-24f;
  const float rounded = withoutBits(value, 13);
  return std::abs(rounded) > kLargest ? std::copysign(INFINITY, value) : rounded;
}

}  // namespace

WeightTable roundedWeights(const WeightTable& weights, WeightType type) {
  auto numbers = std::make_shared<std::map<std::string, std::vector<float>>>();
  std::map<std::string, WeightTensor> tensors;
  for (const std::string& name : weights.names()) {
    WeightTensor tensor = *weights.find(name);
    if (tensor.type != WeightType::kOther) {
      std::vector<float>& values = (*numbers)[name];
      values.resize(tensor.count());
      widen(tensor, 0, values);
      for (float& value : values) {
        value = type == WeightType::kFloat16 ? toFloat16(value) : withoutBits(value, 16);
      }
      tensor.type = WeightType::kFloat32;
      tensor.type_name = "F32";
      tensor.bytes = reinterpret_cast<const uint8_t*>(values.data());
    }
    tensors[name] = std::move(tensor);
  }
  return WeightTable(weights.source(), std::move(tensors), numbers);
}

}  // namespace stipple
