#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "data/weight_table.h"
#include "nn/network_run.h"

namespace stipple {

/// The numbers that networks are run in.
struct GoldenNumbers {
  FactorPrecision precision = FactorPrecision::kFloat32;  ///< of products
  /// Weights are rounded to this type of 16 bits first; none: they are what the file has.
  std::optional<WeightType> weights;
};

/// A file that holds a small network, what goes into it and what must come out, as made by other
/// programs: safetensors with tensors "weights." + the name in a published file, "input.…",
/// "expect.…", and the sizes of the network as JSON in the text `config` of the metadata.
/// Weights are of the published types, so that they test how files are read, too.
class GoldenFile {
 public:
  /// Errors: kIo, kFormat.
  explicit GoldenFile(const std::string& path, const GoldenNumbers& numbers = {});

  const std::string& path() const { return path_; }
  /// An empty object where the file has none.
  const nlohmann::json& config() const { return config_; }
  /// In: name: whole, "expect.feature1".
  bool has(const std::string& name) const { return tensors_.has(name); }
  /// Whether any tensor's name begins with `prefix`.
  bool hasUnder(const std::string& prefix) const;
  /// Errors: kFormat where there is no such tensor.
  std::vector<uint64_t> shape(const std::string& name) const;
  /// Numbers of floating point, widened. Errors: kFormat for a tensor that is missing or of another
  /// type.
  std::vector<float> floats(const std::string& name) const;
  /// Whole numbers (U8, I32, I64). Errors: likewise.
  std::vector<int64_t> integers(const std::string& name) const;
  /// Errors: kFormat for a tensor that is missing or not of U8.
  std::vector<uint8_t> bytes(const std::string& name) const;
  /// The weights whose names begin with "weights." + prefix ("dino."), by the rest of their names.
  WeightTable weights(const std::string& prefix = "") const;
  /// How its networks are run.
  NetworkRun run() const { return {.precision = numbers_.precision}; }

 private:
  const WeightTensor& tensor(const std::string& name) const;

  std::string path_;
  GoldenNumbers numbers_;
  WeightTable tensors_;
  nlohmann::json config_;
};

}  // namespace stipple
