#include "decode/field/field_tensors.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"

namespace stipple {

namespace {

constexpr char kFeatures[] = "field.features.level";
constexpr char kDetails[] = "field.details.level";
constexpr char kColours[] = "field.colours.level";  ///< of fields without other details
constexpr char kNetwork[] = "field.network.layer";

Tensor tensorOf(const std::vector<float>& values, size_t width) {
  return {{values.size() / width, width}, values};
}

const std::vector<float>& floatsOf(const Tensor& tensor, const std::string& name, size_t rank) {
  const auto* values = std::get_if<std::vector<float>>(&tensor.values);
  if (values == nullptr || tensor.shape.size() != rank) {
    fail(ErrorCode::kFormat, "tensor " + name + " of the field has another type or rank");
  }
  uint64_t count = 1;
  for (const uint64_t size : tensor.shape) count *= size;
  if (count != values->size() || count == 0) {
    fail(ErrorCode::kFormat, "tensor " + name + " of the field has " +
                                 std::to_string(values->size()) + " values; its shape needs " +
                                 std::to_string(count) + ", at least 1");
  }
  return *values;
}

/// All levels whose tensors begin with `stem`, ascending.
FeatureGrid gridOf(const TensorTable& table, const std::string& stem) {
  std::vector<FeatureLevel> levels;
  size_t channels = 0;
  for (int level = 0; level <= 64; ++level) {
    const std::string name = stem + std::to_string(level);
    const auto found = table.find(name);
    if (found == table.end()) continue;
    FeatureLevel one;
    one.level = level;
    one.values = floatsOf(found->second, name, 2);
    one.row_count = static_cast<uint32_t>(std::min<uint64_t>(found->second.shape[0], UINT32_MAX));
    channels = channels == 0 ? found->second.shape[1] : channels;
    levels.push_back(std::move(one));
  }
  if (levels.empty()) fail(ErrorCode::kFormat, "the field has no tensor " + stem + "0 or above");
  return FeatureGrid(channels, std::move(levels));
}

}  // namespace

TensorTable tensorsOfField(const FieldParameters& field) {
  TensorTable table;
  for (const FeatureLevel& level : field.features.levels()) {
    table[kFeatures + std::to_string(level.level)] =
        tensorOf(level.values, field.features.channels());
  }
  const std::string details = field.details.channels() == kColourChannels ? kColours : kDetails;
  for (const FeatureLevel& level : field.details.levels()) {
    table[details + std::to_string(level.level)] = tensorOf(level.values, field.details.channels());
  }
  for (size_t l = 0; l < field.network.layers().size(); ++l) {
    const LinearLayer& layer = field.network.layers()[l];
    const std::string stem = kNetwork + std::to_string(l);
    table[stem + ".weights"] = tensorOf(layer.weights, layer.outputs);
    table[stem + ".biases"] = {{layer.biases.size()}, layer.biases};
  }
  return table;
}

FieldParameters fieldOfTensors(const TensorTable& table, const FieldParameters& like) {
  FieldParameters field = like;
  field.features = gridOf(table, kFeatures);
  const auto first = table.lower_bound(kColours);
  const bool is_old = first != table.end() && first->first.starts_with(kColours);
  field.details = gridOf(table, is_old ? kColours : kDetails);
  std::vector<LinearLayer> layers;
  for (size_t l = 0;; ++l) {
    const std::string stem = kNetwork + std::to_string(l);
    const auto weights = table.find(stem + ".weights");
    const auto biases = table.find(stem + ".biases");
    if (weights == table.end() && biases == table.end()) break;
    if (weights == table.end() || biases == table.end()) {
      fail(ErrorCode::kFormat, "the field has weights or biases of layer " + std::to_string(l) +
                                   " alone; both are needed");
    }
    LinearLayer layer;
    layer.weights = floatsOf(weights->second, weights->first, 2);
    layer.biases = floatsOf(biases->second, biases->first, 1);
    layer.inputs = weights->second.shape[0];
    layer.outputs = weights->second.shape[1];
    layers.push_back(std::move(layer));
  }
  field.network = Mlp(std::move(layers));
  validate(field);
  return field;
}

}  // namespace stipple
