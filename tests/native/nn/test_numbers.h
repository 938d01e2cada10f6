#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/random.h"
#include "data/weight_table.h"

namespace stipple {

/// Uniform in -1..1, keyed by the seed.
inline std::vector<float> numbers(size_t count, uint64_t seed) {
  std::vector<float> out(count);
  for (size_t i = 0; i < count; ++i) {
    out[i] = 2.0f * unitFloat(keyedBits(seed, RandomUse::kNetworkStart, i)) - 1.0f;
  }
  return out;
}

/// A table in memory that is filled tensor by tensor.
class TableBuilder {
 public:
  TableBuilder& add(const std::string& name, std::vector<uint64_t> shape,
                    const std::vector<float>& values) {
    return addBytes(name, WeightType::kFloat32, "F32", std::move(shape), values.data(),
                    values.size() * sizeof(float));
  }
  /// Cut to bfloat16, which the upper halves of float32 numbers are.
  TableBuilder& addBfloat16(const std::string& name, std::vector<uint64_t> shape,
                            const std::vector<float>& values) {
    std::vector<uint16_t> halves;
    for (const float value : values) {
      halves.push_back(static_cast<uint16_t>(std::bit_cast<uint32_t>(value) >> 16));
    }
    return addBytes(name, WeightType::kBfloat16, "BF16", std::move(shape), halves.data(),
                    halves.size() * sizeof(uint16_t));
  }
  TableBuilder& addBytes(const std::string& name, WeightType type, const std::string& type_name,
                         std::vector<uint64_t> shape, const void* data, size_t size) {
    // At an odd address, as a tensor of a file may lie.
    auto bytes = std::make_shared<std::vector<uint8_t>>(size + 1);
    if (size > 0) std::memcpy(bytes->data() + 1, data, size);
    tensors_[name] = {type, type_name, std::move(shape), bytes->data() + 1};
    memory_->push_back(bytes);
    return *this;
  }
  WeightTable table() const { return WeightTable("net.safetensors", tensors_, memory_); }

 private:
  std::map<std::string, WeightTensor> tensors_;
  std::shared_ptr<std::vector<std::shared_ptr<std::vector<uint8_t>>>> memory_ =
      std::make_shared<std::vector<std::shared_ptr<std::vector<uint8_t>>>>();
};

}  // namespace stipple
