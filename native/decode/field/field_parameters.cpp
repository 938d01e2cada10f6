#include "decode/field/field_parameters.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string>

#include "base/error.h"
#include "density/anchor_sampling.h"

namespace stipple {

namespace {

/// Of features and of details each.
constexpr int kGridLevels = 6;
constexpr size_t kFeatureChannels = 8;
constexpr size_t kHidden = 64;
/// Numbers of the input beside features, levels and neighbours: place in the leaf 3, budget,
/// spacing.
constexpr size_t kOtherInputs = 5;
/// Vectors of 16 floats are the widest there are.
constexpr size_t kVector = 16;

constexpr uint32_t kLeastRows = 1 << 12;
constexpr uint32_t kMostRows = 1 << 19;
constexpr float kFeatureAmplitude = 1e-2f;
/// Outputs start near 0, which is the lattice, and yet pass derivatives on.
constexpr float kLastLayerScale = 0.1f;
/// At the start Gaussians of an anchor close a plane between them: 0.6 of their own spacing.
constexpr double kStartingScale = 0.6;

size_t wholeVectors(size_t width) {
  return (width + kVector - 1) / kVector * kVector;
}

/// What softplus takes to give y.
double inverseSoftplus(double y) {
  return std::log(std::expm1(y));
}

void requireShape(int leaf_level, const SplatLayout& layout, uint64_t least, uint64_t most,
                  ErrorCode code) {
  const auto require = [code](bool good, const char* what, uint64_t seen, const char* allowed) {
    if (good) return;
    fail(code, std::string(what) + " of the field is " + std::to_string(seen) + "; " + allowed +
                   " is allowed");
  };
  require(leaf_level >= 1 && leaf_level <= kMaxLeafLevel, "leaf level",
          static_cast<uint64_t>(std::max(leaf_level, 0)), "1 to 10");
  require(layout.gaussians >= 4 && layout.gaussians <= 32, "count of Gaussians per anchor",
          layout.gaussians, "4 to 32");
  require(layout.sh_degree >= 0 && layout.sh_degree <= kMaxShDegree, "harmonic degree",
          static_cast<uint64_t>(std::max(layout.sh_degree, 0)), "0 to 4");
  require(least >= 1 && least <= most, "least budget", least, "1 to the largest budget");
  require(most <= kMaxAnchorCount, "largest budget", most, "at most 2^28");
}

/// Cells half as wide as places on surfaces are apart, which cover about the cube's own six faces,
/// so that what one place learns is not its neighbour's: of finer ones most are never read twice,
/// and what they learn is noise.
int finestLevel(uint64_t places, const FieldShape& shape) {
  const double level = 1 + std::ceil(0.5 * std::log2(static_cast<double>(places)));
  return std::clamp(static_cast<int>(level) + (shape.contracted ? 1 : 0), 1, shape.leaf_level);
}

/// Levels that end with `finest`, none below 1; with as many rows as surface cells need there.
FeatureGrid gridOf(size_t channels, int finest, const FieldShape& shape, float amplitude,
                   uint64_t seed) {
  std::vector<int> levels;
  std::vector<uint32_t> rows;
  for (int level = std::max(1, finest - kGridLevels + 1); level <= finest; ++level) {
    // A surface has a quarter of its cells one level above; corners are about twice the cells.
    const double cells =
        2.0 * static_cast<double>(shape.surface_cells) * std::pow(4.0, level - shape.leaf_level);
    const uint64_t needed = std::bit_ceil(static_cast<uint64_t>(std::min(cells, 1e9)) + 1);
    levels.push_back(level);
    rows.push_back(static_cast<uint32_t>(std::clamp<uint64_t>(needed, kLeastRows, kMostRows)));
  }
  return FeatureGrid(channels, levels, rows, amplitude, seed);
}

}  // namespace

uint64_t FieldParameters::bytes() const {
  uint64_t bytes = features.bytes() + details.bytes();
  for (const LinearLayer& layer : network.layers()) {
    bytes += (layer.weights.size() + layer.biases.size()) * sizeof(float);
  }
  return bytes;
}

bool seesNeighbours(const FieldParameters& field) {
  return field.details.channels() != kColourChannels;
}

size_t fieldInputWidth(const FieldParameters& field) {
  const size_t levels = field.features.levels().size();
  const size_t neighbours = seesNeighbours(field) ? kNeighbourInputs : 0;
  return wholeVectors(levels * field.features.channels() + kOtherInputs + levels + neighbours);
}

size_t fieldOutputWidth(const SplatLayout& layout) {
  return wholeVectors(layout.outputs());
}

FieldParameters makeFieldParameters(const FieldShape& shape) {
  requireShape(shape.leaf_level, shape.layout, shape.least_anchors, shape.most_anchors,
               ErrorCode::kInvalidArgument);
  FieldParameters field;
  field.root = shape.root;
  field.contracted = shape.contracted;
  field.leaf_level = shape.leaf_level;
  field.layout = shape.layout;
  field.least_anchors = shape.least_anchors;
  field.most_anchors = shape.most_anchors;
  field.colour_space = shape.colour_space;
  field.antialias = shape.antialias;
  const uint64_t splats = shape.most_anchors * shape.layout.gaussians;
  field.features = gridOf(kFeatureChannels, finestLevel(shape.most_anchors, shape), shape,
                          kFeatureAmplitude, shape.seed);
  field.details = gridOf(kDetailChannels, finestLevel(splats, shape), shape, 0.0f, shape.seed);
  const size_t widths[] = {fieldInputWidth(field), kHidden, kHidden,
                           fieldOutputWidth(shape.layout)};
  field.network = Mlp(widths, shape.seed, kLastLayerScale);
  std::vector<float>& biases = field.network.layers().back().biases;
  const double scale = kLatticeSide * kStartingScale / std::sqrt(shape.layout.gaussians);
  const double odds = shape.starting_opacity / (1 - shape.starting_opacity);
  for (size_t k = 0; k < shape.layout.gaussians; ++k) {
    std::fill_n(&biases[shape.layout.scale(k)], 3,
                static_cast<float>(inverseSoftplus(scale) - inverseSoftplus(kLatticeScale)));
    biases[shape.layout.opacity(k)] = static_cast<float>(std::log(odds) - std::log(1 / 9.0));
  }
  return field;
}

void validate(const FieldParameters& field) {
  requireShape(field.leaf_level, field.layout, field.least_anchors, field.most_anchors,
               ErrorCode::kFormat);
  const auto require = [](const char* what, size_t seen, size_t needed) {
    if (seen == needed) return;
    fail(ErrorCode::kFormat, std::string(what) + " of the field is " + std::to_string(seen) + "; " +
                                 std::to_string(needed) + " is needed");
  };
  require("width of the network's input", field.network.inputWidth(), fieldInputWidth(field));
  require("width of the network's output", field.network.outputWidth(),
          fieldOutputWidth(field.layout));
  const size_t channels = field.details.channels();
  const bool is_earlier = channels == kColourChannels || channels == kChannelsWithoutShapes;
  require("count of detail channels", channels, is_earlier ? channels : kDetailChannels);
}

}  // namespace stipple
