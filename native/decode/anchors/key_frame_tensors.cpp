#include <cmath>
#include <string>
#include <vector>

#include "base/error.h"
#include "decode/anchors/key_frame.h"
#include "decode/anchors/scaffold_tensors.h"

namespace stipple {

namespace {

/// Corners and unit; files from before changes grew with the time have no eighth number.
constexpr size_t kBoxNumbers = 8;

Tensor rowsOf(const std::vector<float>& values, size_t width) {
  return {{values.size() / width, width}, values};
}

template <class T>
const std::vector<T>& valuesOf(const TensorTable& table, const std::string& name) {
  const auto found = table.find(name);
  const auto* values =
      found == table.end() ? nullptr : std::get_if<std::vector<T>>(&found->second.values);
  if (values == nullptr) {
    fail(ErrorCode::kFormat, "the key frame has no tensor " + name + " of its type");
  }
  for (const T& value : *values) {
    if (std::isfinite(static_cast<double>(value))) continue;
    fail(ErrorCode::kFormat,
         "tensor " + name + " of the key frame has a number that is not finite");
  }
  return *values;
}

/// Numbers as many as there are already.
void take(const TensorTable& table, const std::string& name, std::vector<float>& values) {
  const std::vector<float>& stored = valuesOf<float>(table, name);
  if (stored.size() != values.size()) {
    fail(ErrorCode::kFormat, "tensor " + name + " of the key frame has " +
                                 std::to_string(stored.size()) + " values; " +
                                 std::to_string(values.size()) + " are needed");
  }
  values = stored;
}

}  // namespace

TensorTable tensorsOfKeyFrame(const KeyFrame& frame, const std::string& prefix) {
  TensorTable table;
  for (auto& [name, tensor] : tensorsOfScaffold(frame.scaffold)) {
    table[prefix + name] = std::move(tensor);
  }
  if (frame.scaffold.coarsening > 0) {
    table[prefix + "coarsening"] = {{1}, std::vector<double>{frame.scaffold.coarsening}};
  }
  if (frame.scaffold.size() > 0) table[prefix + "blend"] = rowsOf(frame.blend, kBlendNumbers);
  if (!frame.deformation.isThere()) return table;
  const HexPlaneShape& shape = frame.deformation.planes.shape();
  table[prefix + "box"] = {
      {kBoxNumbers},
      std::vector<double>{shape.lowest[0], shape.lowest[1], shape.lowest[2], shape.highest[0],
                          shape.highest[1], shape.highest[2], frame.deformation.unit,
                          frame.deformation.grows_from_key ? 1.0 : 0.0}};
  std::vector<uint32_t> sizes = {shape.texels, shape.moments, shape.channels};
  sizes.insert(sizes.end(), shape.multipliers.begin(), shape.multipliers.end());
  table[prefix + "planes"] = {{sizes.size()}, sizes};
  for (size_t p = 0; p < frame.deformation.planes.planes().size(); ++p) {
    const HexPlane& plane = frame.deformation.planes.planes()[p];
    table[prefix + "planes." + std::to_string(p)] = {{plane.height, plane.width, shape.channels},
                                                     plane.values};
  }
  for (size_t l = 0; l < frame.deformation.heads.layers().size(); ++l) {
    const LinearLayer& layer = frame.deformation.heads.layers()[l];
    const std::string stem = prefix + "heads.layer" + std::to_string(l);
    table[stem + ".weights"] = rowsOf(layer.weights, layer.outputs);
    table[stem + ".biases"] = {{layer.biases.size()}, layer.biases};
  }
  return table;
}

KeyFrame keyFrameOfTensors(const TensorTable& table, const std::string& prefix,
                           const ScaffoldShape& like) {
  TensorTable own;
  for (auto found = table.lower_bound(prefix); found != table.end(); ++found) {
    if (!found->first.starts_with(prefix)) break;
    own[found->first.substr(prefix.size())] = found->second;
  }
  KeyFrame frame;
  frame.scaffold = scaffoldOfTensors(own, like);
  if (own.contains("coarsening")) {
    const std::vector<double>& coarsening = valuesOf<double>(own, "coarsening");
    if (coarsening.size() != 1 || !(coarsening[0] >= 0 && coarsening[0] <= 1)) {
      fail(ErrorCode::kFormat, "the key frame has a coarsening that is no number from 0 to 1");
    }
    frame.scaffold.coarsening = coarsening[0];
  }
  frame.blend.resize(frame.scaffold.size() * kBlendNumbers);
  take(own, "blend", frame.blend);
  if (!own.contains("planes")) return frame;
  const std::vector<uint32_t>& sizes = valuesOf<uint32_t>(own, "planes");
  const std::vector<double>& box = valuesOf<double>(own, "box");
  if (sizes.size() < 4 || (box.size() != kBoxNumbers && box.size() != kBoxNumbers - 1) ||
      !(box[6] > 0)) {
    fail(ErrorCode::kFormat, "the key frame says not how large its planes are");
  }
  HexPlaneShape shape;
  for (size_t axis = 0; axis < 3; ++axis) {
    shape.lowest[axis] = box[axis];
    shape.highest[axis] = box[3 + axis];
  }
  shape.texels = sizes[0];
  shape.moments = sizes[1];
  shape.channels = sizes[2];
  shape.multipliers.assign(sizes.begin() + 3, sizes.end());
  try {
    // Before anything is allocated: a file may say any size.
    const std::vector<uint64_t> plane_sizes = planeSizes(shape);
    for (size_t p = 0; p < plane_sizes.size(); ++p) {
      const std::string name = "planes." + std::to_string(p);
      if (valuesOf<float>(own, name).size() == plane_sizes[p]) continue;
      fail(ErrorCode::kFormat, "tensor " + name + " of the key frame is not as large as it says");
    }
    frame.deformation = makeDeformation(shape, like.gaussians);
  } catch (const Error& error) {
    fail(ErrorCode::kFormat, error.what());
  }
  frame.deformation.unit = box[6];
  frame.deformation.grows_from_key = box.size() == kBoxNumbers && box[7] != 0;
  for (size_t p = 0; p < frame.deformation.planes.planes().size(); ++p) {
    take(own, "planes." + std::to_string(p), frame.deformation.planes.planes()[p].values);
  }
  for (size_t l = 0; l < frame.deformation.heads.layers().size(); ++l) {
    LinearLayer& layer = frame.deformation.heads.layers()[l];
    const std::string stem = "heads.layer" + std::to_string(l);
    take(own, stem + ".weights", layer.weights);
    take(own, stem + ".biases", layer.biases);
  }
  return frame;
}

}  // namespace stipple
