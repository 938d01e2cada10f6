#include "network_golden/golden_file.h"

#include <cstring>
#include <fstream>

#include "base/error.h"
#include "io/assets/weight_file.h"
#include "network_golden/rounded_weights.h"

namespace stipple {
namespace {

/// The text `config` of a safetensors file's metadata.
nlohmann::json readConfig(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  uint64_t size = 0;
  file.read(reinterpret_cast<char*>(&size), sizeof(size));
  constexpr uint64_t kLongest = 100 << 20;  // of a header, as the format says
  if (!file || size > kLongest) fail(ErrorCode::kFormat, path + " is not a safetensors file.");
  std::string text(size, '\0');
  file.read(text.data(), static_cast<std::streamsize>(size));
  const nlohmann::json header = nlohmann::json::parse(text, nullptr, false);
  if (!file || !header.is_object()) {
    fail(ErrorCode::kFormat, path + " is not a safetensors file.");
  }
  const auto metadata = header.find("__metadata__");
  if (metadata == header.end() || !metadata->contains("config")) return nlohmann::json::object();
  nlohmann::json config =
      nlohmann::json::parse(metadata->at("config").get<std::string>(), nullptr, false);
  if (!config.is_object()) {
    fail(ErrorCode::kFormat, path + ": the text config of the metadata is not a JSON object.");
  }
  return config;
}

template <typename T>
std::vector<int64_t> integersOf(const WeightTensor& tensor) {
  std::vector<int64_t> values(tensor.count());
  for (size_t i = 0; i < values.size(); ++i) {
    T value;
    std::memcpy(&value, tensor.bytes + i * sizeof(T), sizeof(T));
    values[i] = static_cast<int64_t>(value);
  }
  return values;
}

}  // namespace

GoldenFile::GoldenFile(const std::string& path, const GoldenNumbers& numbers)
    : path_(path), numbers_(numbers), tensors_(openWeightFile(path)), config_(readConfig(path)) {}

bool GoldenFile::hasUnder(const std::string& prefix) const {
  for (const std::string& name : tensors_.names()) {
    if (name.starts_with(prefix)) return true;
  }
  return false;
}

const WeightTensor& GoldenFile::tensor(const std::string& name) const {
  const WeightTensor* found = tensors_.find(name);
  if (found == nullptr) fail(ErrorCode::kFormat, path_ + " has no tensor " + name + ".");
  return *found;
}

std::vector<uint64_t> GoldenFile::shape(const std::string& name) const {
  return tensor(name).shape;
}

std::vector<float> GoldenFile::floats(const std::string& name) const {
  const WeightTensor& found = tensor(name);
  if (found.type == WeightType::kOther) {
    fail(ErrorCode::kFormat, path_ + ": " + name + " is of type " + found.type_name +
                                 ", a floating-point type is needed.");
  }
  std::vector<float> values(found.count());
  widen(found, 0, values);
  return values;
}

std::vector<int64_t> GoldenFile::integers(const std::string& name) const {
  const WeightTensor& found = tensor(name);
  if (found.type_name == "U8") return integersOf<uint8_t>(found);
  if (found.type_name == "I32") return integersOf<int32_t>(found);
  if (found.type_name == "I64") return integersOf<int64_t>(found);
  fail(ErrorCode::kFormat,
       path_ + ": " + name + " is of type " + found.type_name + ", U8, I32 or I64 is needed.");
}

std::vector<uint8_t> GoldenFile::bytes(const std::string& name) const {
  const WeightTensor& found = tensor(name);
  if (found.type_name != "U8") {
    fail(ErrorCode::kFormat,
         path_ + ": " + name + " is of type " + found.type_name + ", U8 is needed.");
  }
  return std::vector<uint8_t>(found.bytes, found.bytes + found.count());
}

WeightTable GoldenFile::weights(const std::string& prefix) const {
  const WeightTable weights = tensors_.under("weights." + prefix);
  return numbers_.weights ? roundedWeights(weights, *numbers_.weights) : weights;
}

}  // namespace stipple
