#include "nn/convolution.h"

#include <algorithm>

#include "base/error.h"
#include "base/number_text.h"
#include "base/parallel.h"
#include "nn/kernels/matrix_kernel.h"
#include "nn/matrix_backend.h"
#include "nn/scratch.h"

namespace stipple {

namespace {

/// Outputs of a panel, as of linear layers.
constexpr size_t kPanelOutputs = 256;
/// Packed weights at a time: 16 MiB, whatever the layer, or one panel of it.
constexpr size_t kMostPacked = size_t{1} << 22;
/// Pixels of a tile of outputs. A wider one shares more of its border with itself, a smaller one
/// stays in the caches; a product takes kProductRows of its rows, 96 pixels.
constexpr size_t kTileRows = 8;
constexpr size_t kTileColumns = 24;
constexpr size_t kProductRows = 4;

void throwIfCancelled(const NetworkRun& run) {
  if (run.progress != nullptr) run.progress->throwIfCancelled();
}

/// A piece of the outputs: rows [top, top + rows), columns [left, left + columns).
struct Tile {
  size_t top, left, rows, columns;
};

/// The pixels that a tile sees: [side of rows, side of columns, channels], zeros for the padding.
struct TileInput {
  const ConvolutionGrid& grid;
  const FeatureMap& map;
  const ChannelNorm* norm;

  static size_t side(const ConvolutionGrid& grid, size_t outputs) {
    return (outputs - 1) * grid.stride + grid.kernel;
  }

  void read(const Tile& tile, float* out) const {
    const MatrixKernel kernel = chosenMatrixKernel();
    const size_t channels = map.channels;
    const size_t height = side(grid, tile.rows), width = side(grid, tile.columns);
    const size_t left = tile.left * grid.stride;
    const auto columnOf = [&](size_t padded) {
      return padded < left ? 0 : std::min(width, padded - left);
    };
    // Columns of the tile that lie on the map: [begin, end).
    const size_t begin = columnOf(grid.pad_before);
    const size_t end = columnOf(map.width + grid.pad_before);
    for (size_t y = 0; y < height; ++y, out += width * channels) {
      const size_t padded_row = tile.top * grid.stride + y;
      if (padded_row < grid.pad_before || padded_row >= map.height + grid.pad_before) {
        std::fill_n(out, width * channels, 0.0f);
        continue;
      }
      std::fill_n(out, begin * channels, 0.0f);
      std::fill_n(out + end * channels, (width - end) * channels, 0.0f);
      if (begin == end) continue;
      const size_t row = padded_row - grid.pad_before;
      const size_t column = left + begin - grid.pad_before;
      const float* from = map.values.data() + (row * map.width + column) * channels;
      float* to = out + begin * channels;
      const size_t count = (end - begin) * channels;
      if (norm == nullptr) {
        std::copy_n(from, count, to);
      } else {
        normalise(*norm, end - begin, from, to);
        kernel.silu(count, to, to);
      }
    }
  }
};

/// Row after row what each output of rows [first, first + rows) of a tile sees, as (row, column,
/// channel). In: input: of TileInput::read().
void gather(const ConvolutionGrid& grid, size_t channels, const float* input, size_t first,
            size_t rows, size_t columns, float* out) {
  const size_t width = TileInput::side(grid, columns);
  const size_t line = grid.kernel * channels;
  for (size_t y = first; y < first + rows; ++y) {
    for (size_t x = 0; x < columns; ++x) {
      for (size_t k = 0; k < grid.kernel; ++k) {
        const size_t pixel = (y * grid.stride + k) * width + x * grid.stride;
        out = std::copy_n(input + pixel * channels, line, out);
      }
    }
  }
}

/// In: sums [rows * columns of the tile, kPanelOutputs]; top: the first row of the map.
void store(const float* sums, const Tile& tile, size_t top, size_t rows, size_t first_output,
           size_t outputs, ConvolutionResult result, FeatureMap& out) {
  for (size_t i = 0; i < rows * tile.columns; ++i, sums += kPanelOutputs) {
    const size_t pixel = (top + i / tile.columns) * out.width + tile.left + i % tile.columns;
    float* to = out.values.data() + pixel * out.channels + first_output;
    if (result == ConvolutionResult::kReplaces) {
      std::copy_n(sums, outputs, to);
    } else {
      for (size_t c = 0; c < outputs; ++c) to[c] += sums[c];
    }
  }
}

}  // namespace

Convolution::Convolution(const WeightTable& weights, const std::string& name, uint64_t inputs,
                         uint64_t outputs, const ConvolutionGrid& grid)
    : weights_(weights), name_(name + ".weight"), grid_(grid) {
  weight_ = &weights.require(name_, {outputs, inputs, grid.kernel, grid.kernel});
  outputs_ = static_cast<size_t>(weight_->shape[0]);
  inputs_ = static_cast<size_t>(weight_->shape[1]);
  bias_ = weights.floats(name + ".bias", {outputs_});
}

double Convolution::flops(size_t height, size_t width) const {
  const double pixels = static_cast<double>(grid_.outputs(height) * grid_.outputs(width));
  return 2.0 * pixels * static_cast<double>(outputs_ * inputs_ * grid_.kernel * grid_.kernel);
}

FeatureMap Convolution::resultFor(const FeatureMap& in) const {
  const size_t height = grid_.outputs(in.height), width = grid_.outputs(in.width);
  if (height == 0 || width == 0) {
    fail(ErrorCode::kInvalidArgument, weights_.source() + ": " + name_ +
                                          " needs a map of at least " +
                                          std::to_string(grid_.kernel) + " pixels a side; it has " +
                                          sizeText(in.width, in.height) + ".");
  }
  return FeatureMap::ofSize(height, width, outputs_);
}

void Convolution::pack(const NetworkRun& run, size_t first_output, size_t count,
                       float* packed) const {
  const size_t area = grid_.kernel * grid_.kernel;
  const size_t inner = area * inputs_;
  weights_.requireFinite(name_, *weight_, first_output * inner, count * inner);
  if (area == 1) {
    backendOf(run).pack(*weight_, inner, first_output, count, precisionOf(run), packed);
    return;
  }
  // From (channel, row, column) in a file to (row, column, channel), as gather() has them.
  Scratch ordered(count * inner), output(inner);
  for (size_t i = 0; i < count; ++i) {
    widen(*weight_, (first_output + i) * inner, {output.data(), inner});
    float* to = ordered.data() + i * inner;
    for (size_t place = 0; place < area; ++place) {
      for (size_t c = 0; c < inputs_; ++c) *to++ = output.data()[c * area + place];
    }
  }
  WeightTensor tensor;
  tensor.type = WeightType::kFloat32;
  tensor.type_name = "F32";
  tensor.shape = {count, inner};
  tensor.bytes = reinterpret_cast<const uint8_t*>(ordered.data());
  backendOf(run).pack(tensor, inner, 0, count, precisionOf(run), packed);
}

void Convolution::apply(const NetworkRun& run, const FeatureMap& in, const ChannelNorm* norm,
                        FeatureMap& out, ConvolutionResult result) const {
  if (in.channels != inputs_ || out.channels != outputs_ ||
      out.height != grid_.outputs(in.height) || out.width != grid_.outputs(in.width)) {
    fail(ErrorCode::kInvalidArgument,
         weights_.source() + ": " + name_ + " is used for maps that do not fit it.");
  }
  const size_t inner = grid_.kernel * grid_.kernel * inputs_;
  const MatrixBackend& backend = backendOf(run);
  const FactorPrecision precision = precisionOf(run);
  const size_t panel_size = backend.packedSize(inner, std::min(kPanelOutputs, outputs_), precision);
  const size_t panels = rangeCount(outputs_, kPanelOutputs);
  const size_t most_panels =
      std::clamp<size_t>(kMostPacked / std::max<size_t>(panel_size, 1), 1, panels);
  const auto outputsOf = [&](size_t panel) {
    return std::min(kPanelOutputs, outputs_ - panel * kPanelOutputs);
  };
  const size_t tile_columns = rangeCount(out.width, kTileColumns);
  const size_t tiles = rangeCount(out.height, kTileRows) * tile_columns;
  const size_t input_floats = TileInput::side(grid_, std::min(kTileRows, out.height)) *
                              TileInput::side(grid_, std::min(kTileColumns, out.width)) * inputs_;
  const TileInput source = {grid_, in, norm};
  Scratch packed(panel_size * most_panels);
  for (size_t first = 0; first < panels; first += most_panels) {
    const size_t count = std::min(most_panels, panels - first);
    parallelFor(count, 1, [&](size_t begin, size_t) {
      throwIfCancelled(run);
      const size_t panel = first + begin;
      pack(run, panel * kPanelOutputs, outputsOf(panel), packed.data() + begin * panel_size);
    });
    parallelFor(tiles, 1, [&](size_t index, size_t) {
      throwIfCancelled(run);
      Tile tile = {index / tile_columns * kTileRows, index % tile_columns * kTileColumns, 0, 0};
      tile.rows = std::min(kTileRows, out.height - tile.top);
      tile.columns = std::min(kTileColumns, out.width - tile.left);
      Scratch input(input_floats), rows(kProductRows * kTileColumns * inner);
      Scratch sums(kProductRows * kTileColumns * kPanelOutputs);
      source.read(tile, input.data());
      for (size_t y = 0; y < tile.rows; y += kProductRows) {
        const size_t height = std::min(kProductRows, tile.rows - y);
        gather(grid_, inputs_, input.data(), y, height, tile.columns, rows.data());
        for (size_t panel = 0; panel < count; ++panel) {
          const size_t first_output = (first + panel) * kPanelOutputs;
          LinearPanel product;
          product.rows = height * tile.columns;
          product.inputs = inner;
          product.outputs = outputsOf(first + panel);
          product.in = rows.data();
          product.in_stride = inner;
          product.bias = bias_.data() + first_output;
          product.out = sums.data();
          product.out_stride = kPanelOutputs;
          backend.multiply(product, packed.data() + panel * panel_size, precision);
          store(sums.data(), tile, tile.top + y, height, first_output, product.outputs, result,
                out);
        }
      }
    });
  }
}

FeatureMap Convolution::apply(const NetworkRun& run, const FeatureMap& in,
                              const ChannelNorm* norm) const {
  FeatureMap out = resultFor(in);
  apply(run, in, norm, out);
  return out;
}

}  // namespace stipple
