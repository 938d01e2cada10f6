#include "train/loop/splat_tables.h"

#include <algorithm>

#include "base/error.h"

namespace stipple {

namespace {

constexpr const char* kArrayNames[] = {"positions", "rotations", "log_scales", "logits", "sh"};

std::string nameOf(RawArray array) {
  const size_t index = static_cast<size_t>(array);
  return index < kRawArrayCount ? kArrayNames[index]
                                : "extra" + std::to_string(index - kRawArrayCount);
}

const Tensor& tensorOf(const TensorTable& table, const std::string& name) {
  const auto found = table.find(name);
  if (found == table.end()) fail(ErrorCode::kFormat, "the checkpoint has no '" + name + "'");
  return found->second;
}

template <class T>
const std::vector<T>& valuesOf(const TensorTable& table, const std::string& name) {
  const Tensor& tensor = tensorOf(table, name);
  if (!std::holds_alternative<std::vector<T>>(tensor.values)) {
    fail(ErrorCode::kFormat, "'" + name + "' of the checkpoint holds numbers of another type");
  }
  return std::get<std::vector<T>>(tensor.values);
}

void putSplats(const RawSplats& splats, const std::string& prefix, TensorTable& table) {
  for (size_t i = 0; i < arrayCount(splats); ++i) {
    const RawArray array = static_cast<RawArray>(i);
    const auto& values = arrayOf(splats, array);
    table[prefix + nameOf(array)] = {{splats.size(), rowLength(splats, array)},
                                     std::vector<float>(values.begin(), values.end())};
  }
}

RawSplats takeSplats(const TensorTable& table, const std::string& prefix, const RawSplats& like) {
  RawSplats splats;
  splats.sh_degree = like.sh_degree;
  splats.colour_space = like.colour_space;
  splats.antialias = like.antialias;
  splats.extra_lengths = like.extra_lengths;
  const size_t count = valuesOf<float>(table, prefix + nameOf(RawArray::kLogits)).size();
  splats.resize(count);
  for (size_t i = 0; i < arrayCount(splats); ++i) {
    const RawArray array = static_cast<RawArray>(i);
    const std::string name = prefix + nameOf(array);
    const std::vector<float>& values = valuesOf<float>(table, name);
    const size_t needed = count * rowLength(splats, array);
    if (values.size() != needed) {
      fail(ErrorCode::kFormat, "'" + name + "' of the checkpoint holds " +
                                   std::to_string(values.size()) + " values; " +
                                   std::to_string(needed) + " are needed");
    }
    std::copy(values.begin(), values.end(), arrayOf(splats, array).begin());
    try {
      requireFinite(values.data(), values.size(), rowLength(splats, array), name.c_str());
    } catch (const Error& error) {
      fail(ErrorCode::kFormat, error.what());
    }
  }
  return splats;
}

}  // namespace

void putTrainingState(const TrainingState& state, TensorTable& table) {
  putSplats(state.splats, "raw.", table);
  putSplats(state.first_moments, "adam.first.", table);
  putSplats(state.second_moments, "adam.second.", table);
  if (state.kept_gradients.size() > 0) putSplats(state.kept_gradients, "kept.", table);
  table["adam.step"] = {{1}, std::vector<uint64_t>{state.step}};
}

TrainingState takeTrainingState(const TensorTable& table, const RawSplats& like) {
  TrainingState state;
  state.splats = takeSplats(table, "raw.", like);
  state.first_moments = takeSplats(table, "adam.first.", like);
  state.second_moments = takeSplats(table, "adam.second.", like);
  if (table.contains("kept.logits")) state.kept_gradients = takeSplats(table, "kept.", like);
  const auto requireCount = [&](const RawSplats& splats, const char* what) {
    if (splats.size() == state.splats.size()) return;
    fail(ErrorCode::kFormat, std::string("the checkpoint has ") + what + " of " +
                                 std::to_string(splats.size()) + " splats; there are " +
                                 std::to_string(state.splats.size()));
  };
  requireCount(state.first_moments, "first moments");
  requireCount(state.second_moments, "second moments");
  if (state.kept_gradients.size() > 0) requireCount(state.kept_gradients, "kept gradients");
  const std::string name = "adam.step";  // GCC 14 warns of a reference made with a temporary
  const std::vector<uint64_t>& step = valuesOf<uint64_t>(table, name);
  if (step.size() != 1) {
    fail(ErrorCode::kFormat, "'adam.step' of the checkpoint holds " + std::to_string(step.size()) +
                                 " values; 1 is needed");
  }
  state.step = step[0];
  return state;
}

void putText(const std::string& text, const std::string& name, TensorTable& table) {
  table[name] = {{text.size()}, std::vector<uint8_t>(text.begin(), text.end())};
}

std::string takeText(const TensorTable& table, const std::string& name) {
  const std::vector<uint8_t>& bytes = valuesOf<uint8_t>(table, name);
  return {bytes.begin(), bytes.end()};
}

TensorTable takePart(const TensorTable& table, const std::string& prefix) {
  TensorTable part;
  for (auto entry = table.lower_bound(prefix);
       entry != table.end() && entry->first.starts_with(prefix); ++entry) {
    part[entry->first.substr(prefix.size())] = entry->second;
  }
  return part;
}

}  // namespace stipple
