// Based on: Nam et al., Generative Densification, CVPR 2025, and its released code. Differs: cells
// begin at the least of each sample's own coordinates, orders are not shuffled, and selection is by
// (score, index), so that results are reproducible.
#include "decode/detail/detail_network.h"

#include <algorithm>
#include <utility>

#include "nn/activations.h"

namespace stipple {

namespace {

std::vector<float> rowsOf(std::span<const uint32_t> rows, size_t width,
                          const std::vector<float>& from) {
  std::vector<float> made(rows.size() * width);
  for (size_t i = 0; i < rows.size(); ++i) {
    std::copy_n(&from[rows[i] * width], width, &made[i * width]);
  }
  return made;
}

void addRows(std::span<const uint32_t> rows, size_t width, const std::vector<float>& from,
             std::vector<float>& to) {
  for (size_t i = 0; i < rows.size(); ++i) {
    for (size_t c = 0; c < width; ++c) to[rows[i] * width + c] += from[i * width + c];
  }
}

/// Those that go on, or those that do not.
std::vector<uint32_t> chosen(std::span<const uint8_t> goes_on, bool which) {
  std::vector<uint32_t> rows;
  for (uint32_t i = 0; i < goes_on.size(); ++i) {
    if ((goes_on[i] != 0) == which) rows.push_back(i);
  }
  return rows;
}

/// [n children, width] from [n, width].
std::vector<float> repeated(size_t children, size_t width, const std::vector<float>& from) {
  std::vector<float> made(from.size() * children);
  for (size_t i = 0; i < made.size(); ++i) {
    made[i] = from[i / width / children * width + i % width];
  }
  return made;
}

}  // namespace

DetailNetwork::DetailNetwork(ParameterLayout& layout, const std::string& prefix,
                             const DetailSizes& sizes)
    : sizes_(sizes) {
  for (size_t l = 0; l < sizes.layers.size(); ++l) {
    const DetailLayerSizes& layer = sizes.layers[l];
    const bool is_last = l + 1 == sizes.layers.size();
    const size_t channels = layer.block.channels;
    const size_t next = is_last ? channels : sizes.layers[l + 1].block.channels;
    const std::string name = prefix + std::to_string(l) + ".";
    Parts parts;
    for (size_t i = 0; i < layer.blocks; ++i) {
      parts.blocks.emplace_back(layout, name + "block" + std::to_string(i) + ".", layer.block);
    }
    parts.upsampling = PointUpsampling(layout, name + "up.", channels, next, layer.children);
    const DetailScore score =
        sizes.kind == DetailAttributes::kDirect ? DetailScore::kLogistic : DetailScore::kSoftmax;
    if (!is_last) parts.selection = PointSelection(layout, name + "mask.", next, score);
    parts.head = TrainedMlp(layout, name + "head.feat2attr.0", name + "head.feat2attr.2",
                            {next, next, sizes.attributes}, Activation::kGeluErf);
    parts_.push_back(std::move(parts));
  }
}

std::vector<DetailNetwork::Leaves> DetailNetwork::forward(std::span<const float> values,
                                                          std::span<const float> points,
                                                          std::span<const float> features,
                                                          double side, Tape& tape) const {
  std::vector<Leaves> leaves;
  std::vector<float> now(points.begin(), points.end()), f(features.begin(), features.end());
  std::vector<float> inherited;  // raw attributes of `now`, of the residual kind
  tape.clear();
  for (size_t l = 0; l < parts_.size(); ++l, side /= 2) {
    const Parts& parts = parts_[l];
    const size_t children = sizes_.layers[l].children;
    tape.emplace_back();
    Layer& layer = tape.back();
    layer.side = side;
    layer.points = std::move(now);
    layer.around.emplace_back(layer.points, side);
    layer.features.push_back(std::move(f));
    for (size_t i = 0; i < parts.blocks.size(); ++i) {
      layer.features.push_back(parts.blocks[i].apply(values, layer.around.front(), i % kCellCurves,
                                                     layer.features.back()));
    }
    layer.children =
        parts.upsampling.apply(values, layer.points, layer.features.back(), side, layer.upsampling);
    const size_t count = layer.children.points.size() / 3;
    const size_t width = layer.children.features.size() / count;
    layer.goes_on.assign(count, 0);
    if (!isLast(l)) {
      layer.goes_on = parts.selection.choose(values, layer.children.features,
                                             sizes_.layers[l].ratio, layer.selection);
    }
    const std::vector<uint32_t> ends = chosen(layer.goes_on, false);
    const std::vector<uint32_t> on = chosen(layer.goes_on, true);
    const bool is_direct = sizes_.kind == DetailAttributes::kDirect;
    layer.head_rows = ends;
    if (!is_direct) {  // All children have attributes, which their own children inherit.
      layer.head_rows.resize(count);
      for (uint32_t i = 0; i < count; ++i) layer.head_rows[i] = i;
    }
    layer.head_in = rowsOf(layer.head_rows, width, layer.children.features);
    std::vector<float> attributes(layer.head_rows.size() * sizes_.attributes);
    parts.head.apply(values, layer.head_rows.size(), layer.head_in.data(), layer.head,
                     attributes.data());
    if (!is_direct && l > 0) {
      const std::vector<float> more = repeated(children, sizes_.attributes, inherited);
      for (size_t i = 0; i < attributes.size(); ++i) attributes[i] += more[i];
    }
    Leaves made;
    made.points = rowsOf(ends, 3, layer.children.points);
    made.attributes = is_direct ? attributes : rowsOf(ends, sizes_.attributes, attributes);
    leaves.push_back(std::move(made));
    now = rowsOf(on, 3, layer.children.points);
    f = rowsOf(on, width, layer.children.features);
    if (!is_direct) inherited = rowsOf(on, sizes_.attributes, attributes);
  }
  return leaves;
}

DetailNetwork::InputGradients DetailNetwork::backward(std::span<const float> values,
                                                      const Tape& tape, std::span<const Leaves> by,
                                                      std::span<float> gradients) const {
  // Derivatives by what goes on from a layer: places, features, and inherited attributes.
  std::vector<float> by_points, by_f, by_inherited;
  for (size_t l = parts_.size(); l-- > 0;) {
    const Parts& parts = parts_[l];
    const Layer& layer = tape[l];
    const size_t count = layer.children.points.size() / 3;
    const size_t width = layer.children.features.size() / count;
    const bool is_direct = sizes_.kind == DetailAttributes::kDirect;
    const std::vector<uint32_t> ends = chosen(layer.goes_on, false);
    const std::vector<uint32_t> on = chosen(layer.goes_on, true);
    PointUpsampling::Children by_children;
    by_children.points.assign(count * 3, 0.0f);
    by_children.features.assign(count * width, 0.0f);
    addRows(ends, 3, by[l].points, by_children.points);
    addRows(on, 3, by_points, by_children.points);

    std::vector<float> by_attributes = by[l].attributes;
    if (!is_direct) {
      by_attributes.assign(count * sizes_.attributes, 0.0f);
      addRows(ends, sizes_.attributes, by[l].attributes, by_attributes);
      addRows(on, sizes_.attributes, by_inherited, by_attributes);
      by_inherited.assign(count / sizes_.layers[l].children * sizes_.attributes, 0.0f);
      for (size_t i = 0; i < by_attributes.size(); ++i) {
        const size_t parent = i / sizes_.attributes / sizes_.layers[l].children;
        by_inherited[parent * sizes_.attributes + i % sizes_.attributes] += by_attributes[i];
      }
    }
    std::vector<float> by_head(layer.head_in.size());
    parts.head.backward(values, layer.head_rows.size(), layer.head_in.data(), layer.head,
                        by_attributes.data(), gradients, by_head.data());
    // Features that are handed on, to the next layer and, directly, to the head.
    std::vector<float> by_handed(count * width, 0.0f);
    addRows(on, width, by_f, by_handed);
    addRows(layer.head_rows, width, by_head, is_direct ? by_handed : by_children.features);
    if (isLast(l)) {
      for (size_t i = 0; i < by_handed.size(); ++i) by_children.features[i] += by_handed[i];
    } else {
      parts.selection.backward(values, layer.children.features, layer.selection, by_handed,
                               gradients, by_children.features);
    }
    by_points.assign(layer.points.size(), 0.0f);
    parts.upsampling.backward(values, layer.features.back(), layer.side, layer.upsampling,
                              by_children, gradients, by_points, by_f);
    for (size_t i = parts.blocks.size(); i-- > 0;) {
      parts.blocks[i].backward(values, layer.around.front(), i % kCellCurves, layer.features[i],
                               by_f, gradients);
    }
  }
  return {std::move(by_points), std::move(by_f)};
}

}  // namespace stipple
