#include "io/assets/weight_file.h"

#include <memory>
#include <utility>

#include "io/bytes/output_kind.h"
#include "io/bytes/safetensors.h"

namespace stipple {

namespace {

WeightType typeOf(const std::string& dtype) {
  if (dtype == "F32") return WeightType::kFloat32;
  if (dtype == "F16") return WeightType::kFloat16;
  if (dtype == "BF16") return WeightType::kBfloat16;
  return WeightType::kOther;
}

}  // namespace

WeightTable openWeightFile(const std::string& path, std::map<std::string, std::string>* metadata) {
  const SafeTensorsReader reader(path);
  const std::shared_ptr<const uint8_t> memory = reader.map();
  std::map<std::string, WeightTensor> tensors;
  for (const auto& [name, tensor] : reader.tensors()) {
    tensors[name] = {typeOf(tensor.dtype), tensor.dtype, tensor.shape,
                     memory.get() + tensor.offset};
  }
  if (metadata != nullptr) *metadata = reader.metadata();
  return WeightTable(path, std::move(tensors), memory);
}

void requireTrainedWeightsPlace(const std::string& path) {
  requireOutputKind(path, "trained weights", [](const std::string& file) {
    return SafeTensorsReader(file).metadata().count(kTrainedKey) != 0;
  });
}

void writeTrainedWeights(const TensorTable& tensors, const std::string& settings_json,
                         const std::string& path) {
  requireTrainedWeightsPlace(path);
  SafeTensorsWriter file;
  file.setMetadata(kTrainedKey, settings_json);
  for (const auto& [name, tensor] : tensors) file.add(name, tensor);
  file.write(path);
}

}  // namespace stipple
