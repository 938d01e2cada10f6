#include "nn/training/parameter_layout.h"

#include <algorithm>
#include <map>
#include <utility>

#include "base/error.h"
#include "nn/matrix_backend.h"

namespace stipple {

ParameterLayout::ParameterLayout(FactorPrecision precision) : precision_(precision) {
  requirePrecision(precision);
}

size_t ParameterLayout::add(const std::string& name, std::vector<uint64_t> shape) {
  for (const Parameter& other : parameters_) {
    if (other.name == name) fail(ErrorCode::kInternal, "a network has '" + name + "' twice");
  }
  Parameter parameter = {name, std::move(shape), size_, 1};
  for (const uint64_t side : parameter.shape) parameter.count *= side;
  size_ += parameter.count;
  parameters_.push_back(std::move(parameter));
  return parameters_.back().first;
}

const Parameter& ParameterLayout::find(const std::string& name) const {
  for (const Parameter& parameter : parameters_) {
    if (parameter.name == name) return parameter;
  }
  fail(ErrorCode::kInvalidArgument, "the network has no tensor '" + name + "'");
}

std::vector<float> ParameterLayout::read(const WeightTable& weights) const {
  std::vector<float> values(size_);
  for (const Parameter& parameter : parameters_) {
    const std::vector<float> read = weights.floats(parameter.name, parameter.shape);
    std::copy(read.begin(), read.end(), &values[parameter.first]);
  }
  return values;
}

WeightTable ParameterLayout::table(const std::string& source,
                                   std::shared_ptr<const std::vector<float>> values) const {
  std::map<std::string, WeightTensor> tensors;
  for (const Parameter& parameter : parameters_) {
    tensors[parameter.name] = {WeightType::kFloat32, "F32", parameter.shape,
                               reinterpret_cast<const uint8_t*>(values->data() + parameter.first)};
  }
  return WeightTable(source, std::move(tensors), std::move(values));
}

}  // namespace stipple
