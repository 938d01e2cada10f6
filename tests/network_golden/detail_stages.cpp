#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "decode/detail/detail_network.h"
#include "network_golden/compare_share.h"
#include "network_golden/stages.h"

namespace stipple {
namespace {

// A run of this golden in float32 is off by 7e-5 of the largest number of a tensor: offsets are
// encoded with frequencies of up to 16,384.
constexpr double kShareOfLargest = 3e-4;
constexpr size_t kHarmonics = 12, kOpacity = 12, kScale = 13, kRotation = 16, kAttributes = 20;

using Kept = std::map<std::string, std::vector<float>>;

void keep(Kept& seen, const std::string& name, std::span<const float> numbers) {
  seen[name].insert(seen[name].end(), numbers.begin(), numbers.end());
}

/// Ends of samples in rows: [0, 41, 52].
std::vector<size_t> boundsOf(const GoldenFile& file, const std::string& name) {
  std::vector<size_t> bounds = {0};
  for (const int64_t end : file.integers(name)) bounds.push_back(static_cast<size_t>(end));
  return bounds;
}

std::vector<float> rowsOf(const std::vector<float>& all, size_t width, size_t begin, size_t end) {
  return {all.begin() + static_cast<long>(begin * width),
          all.begin() + static_cast<long>(end * width)};
}

DetailSizes sizesOf(const GoldenFile& file, DetailAttributes kind) {
  const nlohmann::json& config = file.config();
  DetailSizes sizes;
  sizes.kind = kind;
  sizes.attributes = kAttributes;
  for (size_t l = 0; l < config.at("channels").size(); ++l) {
    DetailLayerSizes layer;
    layer.block.channels = config.at("channels").at(l).get<size_t>();
    layer.block.heads = config.at("heads").at(l).get<size_t>();
    layer.block.patch = config.at("patch_size").get<size_t>();
    layer.block.mlp_ratio = config.at("mlp_ratio").get<size_t>();
    layer.blocks = config.at("depths").at(l).get<size_t>();
    layer.children = config.at("upscale").at(l).get<size_t>();
    layer.ratio = config.at("ratio").get<double>();
    sizes.layers.push_back(layer);
  }
  return sizes;
}

/// What splats of raw attributes are weighed by, and the derivatives by them.
class Weighing {
 public:
  Weighing(const GoldenFile& file, size_t layer, size_t begin, size_t end, double factor)
      : factor_(factor),
        opacity_shift_(file.config().at("opacity_shift").get<double>()),
        scale_shift_(file.config().at("fine_scale_shift").get<double>()) {
    const std::string stem = "input.w.layer" + std::to_string(layer) + ".";
    const auto read = [&](const char* name, size_t width) {
      return rowsOf(file.floats(stem + name), width, begin, end);
    };
    position_ = read("position", 3);
    harmonics_ = read("sh", kHarmonics);
    opacity_ = read("opacity", 1);
    scale_ = read("scale", 3);
    rotation_ = read("rotation", 4);
  }

  double add(const DetailNetwork::Leaves& leaves, DetailNetwork::Leaves& by) const {
    by = leaves;
    double loss = 0;
    for (size_t i = 0; i < leaves.points.size(); ++i) {
      const double weight = static_cast<double>(position_[i]) / factor_;
      loss += weight * static_cast<double>(leaves.points[i]);
      by.points[i] = static_cast<float>(weight);
    }
    for (size_t row = 0; row < opacity_.size(); ++row) {
      const float* raw = &leaves.attributes[row * kAttributes];
      float* to = &by.attributes[row * kAttributes];
      for (size_t i = 0; i < kHarmonics; ++i) {
        to[i] = harmonics_[row * kHarmonics + i];
        loss += static_cast<double>(to[i]) * static_cast<double>(raw[i]);
      }
      const double opacity =
          1 / (1 + std::exp(-static_cast<double>(raw[kOpacity]) - opacity_shift_));
      loss += static_cast<double>(opacity_[row]) * opacity;
      to[kOpacity] =
          static_cast<float>(static_cast<double>(opacity_[row]) * opacity * (1 - opacity));
      for (size_t i = 0; i < 3; ++i) {
        const double scale = static_cast<double>(scale_[row * 3 + i]) *
                             std::exp(static_cast<double>(raw[kScale + i]) + scale_shift_);
        loss += scale;
        to[kScale + i] = static_cast<float>(scale);
      }
      loss += addRotation(row, raw + kRotation, to + kRotation);
    }
    return loss;
  }

 private:
  double addRotation(size_t row, const float* raw, float* to) const {
    double squared = 0, along = 0;
    for (size_t i = 0; i < 4; ++i) {
      squared += static_cast<double>(raw[i]) * static_cast<double>(raw[i]);
      along += static_cast<double>(raw[i]) * static_cast<double>(rotation_[row * 4 + i]);
    }
    const double length = std::sqrt(squared);
    for (size_t i = 0; i < 4; ++i) {
      to[i] = static_cast<float>((static_cast<double>(rotation_[row * 4 + i]) -
                                  along * static_cast<double>(raw[i]) / squared) /
                                 length);
    }
    return along / length;
  }

  double factor_, opacity_shift_, scale_shift_;
  std::vector<float> position_, harmonics_, opacity_, scale_, rotation_;
};

void codeStages(const GoldenFile& file, StageReport& report) {
  const std::vector<int64_t> cells = file.integers("input.codes.cell");
  for (const int bits : {16, 5}) {
    std::vector<int64_t> codes;
    for (size_t curve = 0; curve < kCellCurves; ++curve) {
      for (size_t i = 0; i < cells.size(); i += 3) {
        // Those of fewer bits are of the lower ones.
        const auto at = [&](size_t axis) {
          return static_cast<uint32_t>(cells[i + axis]) & ((1u << bits) - 1);
        };
        codes.push_back(static_cast<int64_t>(
            curveCode(static_cast<CellCurve>(curve), {at(0), at(1), at(2)}, bits)));
      }
    }
    const std::string name = "expect.codes.code" + std::to_string(bits);
    report.compareExactly(name, codes, file.integers(name));
  }
  const std::vector<float> scores = file.floats("input.ties.score");
  const std::vector<size_t> bounds = boundsOf(file, "input.ties.offset");
  std::vector<int64_t> goes_on;
  for (size_t b = 0; b + 1 < bounds.size(); ++b) {
    const std::vector<uint8_t> of_sample = largestShare(
        rowsOf(scores, 1, bounds[b], bounds[b + 1]), file.config().at("ties_ratio").get<double>());
    goes_on.insert(goes_on.end(), of_sample.begin(), of_sample.end());
  }
  report.compareExactly("expect.ties.go_on", goes_on, file.integers("expect.ties.go_on"));
}

void networkStages(const GoldenFile& file, const std::string& suffix, DetailAttributes kind,
                   StageReport& report) {
  const std::string expect = "expect" + suffix + ".", grad = "grad" + suffix + ".";
  const char* name = kind == DetailAttributes::kDirect ? "direct" : "residual";
  const auto factor = file.config().at("coord_factor").at(name).get<double>();
  const auto side = file.config().at("grid_size").at(name).get<double>();
  ParameterLayout layout;
  const DetailNetwork network(layout, "dec.", sizesOf(file, kind));
  const std::vector<float> values = layout.read(file.weights());
  std::vector<float> gradients(layout.size(), 0.0f);
  const std::vector<size_t> bounds = boundsOf(file, "input.offset");
  const std::vector<float> coords = file.floats("input.coord"), feats = file.floats("input.feat");
  const size_t channels = file.shape("input.feat").at(1);
  std::array<size_t, 2> leaf_row = {};
  Kept seen;
  double loss = 0;
  std::vector<int64_t> goes_on;
  for (size_t b = 0; b + 1 < bounds.size(); ++b) {
    std::vector<float> points = rowsOf(coords, 3, bounds[b], bounds[b + 1]);
    for (float& value : points) value *= static_cast<float>(factor);
    DetailNetwork::Tape tape;
    std::vector<DetailNetwork::Leaves> leaves = network.forward(
        values, points, rowsOf(feats, channels, bounds[b], bounds[b + 1]), side, tape);
    std::vector<DetailNetwork::Leaves> by(leaves.size());
    for (size_t l = 0; l < leaves.size(); ++l) {
      const size_t count = leaves[l].points.size() / 3;
      loss += Weighing(file, l, leaf_row[l], leaf_row[l] + count, factor).add(leaves[l], by[l]);
      leaf_row[l] += count;
      const std::string stem = "layer" + std::to_string(l) + ".";
      for (float& value : leaves[l].points) value /= static_cast<float>(factor);
      keep(seen, expect + stem + "leaf.coord", leaves[l].points);
      keep(seen, expect + stem + "leaf.attribute", leaves[l].attributes);
      keep(seen, grad + "expect." + stem + "leaf.attribute", by[l].attributes);
      keep(seen, expect + stem + "up.feat", tape[l].children.features);
      for (size_t i = 0; i + 1 < tape[l].features.size(); ++i) {
        keep(seen, expect + stem + "block" + std::to_string(i) + ".out", tape[l].features[i + 1]);
      }
    }
    goes_on.insert(goes_on.end(), tape[0].goes_on.begin(), tape[0].goes_on.end());
    const DetailNetwork::InputGradients inputs = network.backward(values, tape, by, gradients);
    std::vector<float> by_coord = inputs.points;
    for (float& value : by_coord) value *= static_cast<float>(factor);
    keep(seen, grad + "input.coord", by_coord);
    keep(seen, grad + "input.feat", inputs.features);
  }
  report.compareExactly(expect + "layer0.mask.go_on", goes_on,
                        file.integers(expect + "layer0.mask.go_on"));
  const std::vector<float> whole = {static_cast<float>(loss)};
  compareShare(expect + "loss", whole, file.floats(expect + "loss"), kShareOfLargest, report);
  for (const auto& [stage, numbers] : seen) {
    compareShare(stage, numbers, file.floats(stage), kShareOfLargest, report);
  }
  for (const Parameter& parameter : layout.parameters()) {
    const std::string stage = grad + "weights." + parameter.name;
    if (parameter.name == "dec.0.mask.net.2.bias" && kind == DetailAttributes::kResidual) {
      // Softmax stays where all logits change alike: what is left is the rounding of float32 sums.
      report.compare(stage, std::span(gradients).subspan(parameter.first, 1), file.floats(stage),
                     {1e-7, 0});
      continue;
    }
    compareShare(stage, std::span(gradients).subspan(parameter.first, parameter.count),
                 file.floats(stage), kShareOfLargest, report);
  }
}

}  // namespace

void detailStages(const GoldenFile& file, StageReport& report) {
  if (!file.has("input.codes.cell")) return;
  codeStages(file, report);
  networkStages(file, "", DetailAttributes::kDirect, report);
  networkStages(file, "_residual", DetailAttributes::kResidual, report);
}

}  // namespace stipple
