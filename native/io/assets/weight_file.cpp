#include "io/assets/weight_file.h"
#include "math/half_float.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "base/error.h"
#include "io/assets/flat_json.h"
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

LatentRange latentRangeOf(const std::map<std::string, std::string>& metadata,
                          const std::string& name) {
  LatentRange range;
  const auto found = metadata.find(kTrainedKey);
  if (found == metadata.end()) return range;
  constexpr uint64_t kMostAnchors = uint64_t{1} << 20;
  uint64_t leaf_level = 0, least = kMostAnchors, most = 0;
  for (const auto& [key, value] : readFlatJson(found->second)) {
    const auto* whole = std::get_if<uint64_t>(&value);
    if (whole == nullptr) continue;
    if (key == "network.leaf_level") leaf_level = *whole;
    if (key.ends_with(".least_anchors")) least = std::min(least, *whole);
    if (key.ends_with(".most_anchors")) most = std::max(most, *whole);
  }
  constexpr uint64_t kMostLevels = 10;
  if (leaf_level < 1 || leaf_level > kMostLevels || least < 1 || least > most ||
      most > kMostAnchors) {
    fail(ErrorCode::kFormat, name + ": its settings of training have the leaf level " +
                                 std::to_string(leaf_level) + " and " + std::to_string(least) +
                                 " to " + std::to_string(most) + " anchors, which cannot be");
  }
  range.leaf_level = static_cast<int>(leaf_level);
  range.least_anchors = least;
  range.most_anchors = most;
  range.usual_anchors = most;
  return range;
}

void requireTrainedWeightsPlace(const std::string& path) {
  requireOutputKind(path, "trained weights", [](const std::string& file) {
    return SafeTensorsReader(file).metadata().count(kTrainedKey) != 0;
  });
}

std::string latentsOf(const std::map<std::string, std::string>& metadata) {
  for (const char* key : {kLatentsKey, kTrainedKey}) {
    const auto found = metadata.find(key);
    if (found != metadata.end()) return found->second;
  }
  return {};
}

void writeTrainedWeights(const TensorTable& tensors, const std::string& settings_json,
                         const std::string& path, const std::string& latents) {
  requireTrainedWeightsPlace(path);
  SafeTensorsWriter file;
  file.setMetadata(kTrainedKey, settings_json);
  if (!latents.empty()) file.setMetadata(kLatentsKey, latents);
  for (const auto& [name, tensor] : tensors) file.add(name, tensor);
  file.write(path);
}

void writeHalfSizedWeights(const std::string& from, const std::string& to) {
  std::map<std::string, std::string> metadata;
  const WeightTable weights = openWeightFile(from, &metadata);
  const auto settings = metadata.find(kTrainedKey);
  if (settings == metadata.end()) {
    fail(ErrorCode::kInvalidArgument,
         from + " was not written by a training of ours: its metadata has no '" +
             std::string(kTrainedKey) + "'");
  }
  requireTrainedWeightsPlace(to);
  std::map<std::string, CarriedTensor> halves;
  for (const std::string& name : weights.names()) {
    const WeightTensor& tensor = *weights.find(name);
    CarriedTensor& half = halves[name];
    half = {"F16", tensor.shape, {}};
    half.bytes.reserve(2 * tensor.count());
    for (const float value : weights.floats(name, tensor.shape)) {
      const uint16_t bits = floatToHalf(value);
      if ((bits & 0x7fff) == 0x7c00) {
        fail(ErrorCode::kInvalidArgument, from + " has " + std::to_string(value) + " in '" + name +
                                              "'; 16 bits hold no more than 65504");
      }
      half.bytes.push_back(static_cast<uint8_t>(bits));
      half.bytes.push_back(static_cast<uint8_t>(bits >> 8));
    }
  }
  SafeTensorsWriter file;
  for (const char* key : {kTrainedKey, kLatentsKey}) {
    const auto found = metadata.find(key);
    if (found != metadata.end()) file.setMetadata(key, found->second);
  }
  for (const auto& [name, half] : halves) file.carry(name, half);
  file.write(to);
}

}  // namespace stipple
