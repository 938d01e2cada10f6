// Based on: Nam et al., Generative Densification, CVPR 2025, and its released code.
#include "train/detail/detail_model.h"

#include <cmath>
#include <string>

#include "base/error.h"
#include "base/random.h"
#include "train/networks/start_weights.h"

namespace stipple {

namespace {

void require(size_t value, size_t least, size_t most, const char* what) {
  if (value >= least && value <= most) return;
  fail(ErrorCode::kInvalidArgument, std::string(what) + " is " + std::to_string(value) + "; " +
                                        std::to_string(least) + " to " + std::to_string(most) +
                                        " is allowed");
}

DetailSizes networkSizes(const DetailModelSizes& sizes) {
  DetailSizes made;
  made.attributes = kChildNumbers;
  made.kind = DetailAttributes::kResidual;
  DetailLayerSizes layer;
  layer.block = {sizes.heads * sizes.head_width, sizes.heads, sizes.patch, sizes.mlp_ratio};
  layer.blocks = sizes.blocks;
  layer.children = sizes.children;
  layer.ratio = sizes.ratio;
  made.layers.assign(sizes.layers, layer);
  return made;
}

}  // namespace

void validate(const DetailModelSizes& sizes) {
  require(sizes.heads, 1, 64, "the number of heads of the detail network");
  require(sizes.head_width, 1, 256, "the width of a head of the detail network");
  require(sizes.layers, 1, 2, "the number of layers of the detail network");
  require(sizes.blocks, 1, 16, "the number of blocks of a layer of the detail network");
  require(sizes.mlp_ratio, 1, 16, "the ratio of the detail network's MLPs");
  require(sizes.patch, 2, 4096, "the number of points of a patch of the detail network");
  if (!isChildCount(sizes.children)) {
    fail(ErrorCode::kInvalidArgument, "the number of children of a splat is " +
                                          std::to_string(sizes.children) +
                                          "; 1, 2, 4 or 8 is allowed");
  }
  if (sizes.ratio > 0 && sizes.ratio <= 1) return;
  fail(ErrorCode::kInvalidArgument, "the share of children that go on is " +
                                        std::to_string(sizes.ratio) +
                                        "; more than 0, up to 1, is allowed");
}

DetailModel::DetailModel(const DetailModelSizes& sizes, FactorPrecision precision)
    : sizes_((validate(sizes), sizes)),
      children_(sizes.layers, sizes.children),
      layout_(precision),
      input_(layout_, "detail.input.", sizes.heads, sizes.head_width),
      network_(layout_, "detail.layers.", networkSizes(sizes)) {}

std::vector<float> DetailModel::startValues(uint64_t seed) const {
  std::vector<std::string> silent;
  for (size_t l = 0; l < sizes_.layers; ++l) {
    const std::string layer = "detail.layers." + std::to_string(l) + ".";
    silent.push_back(layer + "head.feat2attr.2.weight");
    silent.push_back(layer + "up.delta_x.2.weight");
  }
  std::vector<float> values = startWeights(layout_, seed, silent);
  for (const Parameter& parameter : layout_.parameters()) {
    if (parameter.shape.size() != 5) continue;  // convolutions; most of their 27 cells are empty
    const auto sides = static_cast<double>(4 * (parameter.shape[0] + parameter.shape[4]));
    for (size_t i = 0; i < parameter.count; ++i) {
      const double u = unitDouble(keyedBits(seed, RandomUse::kNetworkStart, parameter.first + i));
      values[parameter.first + i] = static_cast<float>(std::sqrt(6 / sides) * (2 * u - 1));
    }
  }
  return values;
}

TensorTable DetailModel::tensors(std::span<const float> values) const {
  TensorTable table;
  for (const Parameter& parameter : layout_.parameters()) {
    const float* const first = values.data() + parameter.first;
    table[parameter.name] = {parameter.shape, std::vector<float>(first, first + parameter.count)};
  }
  return table;
}

uint64_t DetailModel::splatCount(uint64_t coarse, uint64_t points) const {
  uint64_t count = coarse - points, now = points;
  for (size_t l = 0; l < sizes_.layers; ++l) {
    now *= sizes_.children;
    if (l + 1 == sizes_.layers) return count + now;
    const auto on = static_cast<uint64_t>(std::ceil(sizes_.ratio * static_cast<double>(now)));
    count += now - on;
    now = on;
  }
  return count;
}

uint64_t DetailModel::pointsFor(uint64_t coarse, uint64_t wanted) const {
  uint64_t least = 0, most = coarse;
  while (least < most) {
    const uint64_t middle = least + (most - least + 1) / 2;
    if (splatCount(coarse, middle) <= wanted) {
      least = middle;
    } else {
      most = middle - 1;
    }
  }
  return least;
}

ChildSplats DetailModel::childrenOf(const SplatCloud& coarse, const CoarseEvidence& evidence,
                                    const Tape& tape) const {
  return ChildSplats(coarse, evidence, children_, tape.network);
}

SplatCloud DetailModel::forward(std::span<const float> values, const SplatCloud& coarse,
                                const CoarseEvidence& evidence, Tape& tape) const {
  const std::vector<float> features = input_.forward(values, evidence, tape.input);
  tape.leaves = network_.forward(values, evidence.places, features, evidence.side, tape.network);
  return childrenOf(coarse, evidence, tape).apply(tape.leaves);
}

void DetailModel::backward(std::span<const float> values, const SplatCloud& coarse,
                           const CoarseEvidence& evidence, const Tape& tape, const SplatCloud& fine,
                           const SplatCloud& by_fine, std::span<float> gradients) const {
  const std::vector<DetailNetwork::Leaves> by =
      childrenOf(coarse, evidence, tape).backward(tape.leaves, fine, by_fine);
  const DetailNetwork::InputGradients by_input =
      network_.backward(values, tape.network, by, gradients);
  input_.backward(values, evidence, tape.input, by_input.features, gradients);
}

}  // namespace stipple
