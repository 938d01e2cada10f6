#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "data/weight_table.h"
#include "nn/network_run.h"

namespace stipple {

/// A tensor of a network that is trained: which part of an array of all numbers it is.
struct Parameter {
  std::string name;  ///< as published files have it
  std::vector<uint64_t> shape;
  size_t first = 0;
  size_t count = 0;
};

/// The tensors of a network, one after the other. Values, derivatives, moments and means of a
/// network that is trained are arrays of size() floats each, so that an optimiser and a sum over
/// machines see one array, and the same layers run with any of them.
class ParameterLayout {
 public:
  /// In: precision: of the factors of products in blocks of the networks that add their tensors to
  /// it; what reads numbers from outside and what says them multiplies in float32. Errors:
  /// kUnavailable (requirePrecision()).
  explicit ParameterLayout(FactorPrecision precision = FactorPrecision::kFloat32);

  FactorPrecision precision() const { return precision_; }
  /// Returns where the tensor begins. Errors: kInternal for a name that is there already.
  size_t add(const std::string& name, std::vector<uint64_t> shape);

  size_t size() const { return size_; }
  const std::vector<Parameter>& parameters() const { return parameters_; }
  /// Errors: kInvalidArgument for a name that is not there.
  const Parameter& find(const std::string& name) const;
  /// The numbers of all tensors. Errors: kFormat (WeightTable::floats).
  std::vector<float> read(const WeightTable& weights) const;
  /// The other way round, in float32, which networks that are only run can read. In: values
  /// [size()], which the table keeps.
  WeightTable table(const std::string& source,
                    std::shared_ptr<const std::vector<float>> values) const;

 private:
  FactorPrecision precision_;
  std::vector<Parameter> parameters_;
  size_t size_ = 0;
};

}  // namespace stipple
