#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "decode/detail/point_order.h"
#include "nn/training/parameter_layout.h"

namespace stipple {

/// The 27 cells around a cell and itself.
constexpr size_t kCellTaps = 27;

/// Which point stands for each of the cells around every point. Of several in a cell the first
/// does; for its own cell each point stands itself.
class CellNeighbours {
 public:
  explicit CellNeighbours(const PointCells& cells);

  /// Pairs of a point and its neighbour in one direction, points ascending.
  struct Pairs {
    std::vector<uint32_t> points, neighbours;
  };
  const Pairs& pairs(size_t tap) const { return pairs_[tap]; }
  size_t count() const { return count_; }

 private:
  size_t count_ = 0;
  std::array<Pairs, kCellTaps> pairs_;
};

/// A convolution over cells that have points, with its way back: out of a point is the bias and the
/// sum over its neighbours of weight [outputs, 3, 3, 3, inputs] times theirs.
class SparseConvolution {
 public:
  SparseConvolution() = default;
  /// Adds `name`.weight and `name`.bias.
  SparseConvolution(ParameterLayout& layout, const std::string& name, size_t inputs,
                    size_t outputs);

  /// In: in [points, inputs]. Out: out [points, outputs], written over. Threads and determinism:
  /// products in parallel, directions one after the other: same bits for any number of threads.
  void apply(std::span<const float> values, const CellNeighbours& neighbours, const float* in,
             float* out) const;
  /// Out: gradients, and in_gradient [points, inputs], both of which this adds to.
  void backward(std::span<const float> values, const CellNeighbours& neighbours, const float* in,
                const float* out_gradient, std::span<float> gradients, float* in_gradient) const;

 private:
  /// The weight of a direction starts here, and its rows are kCellTaps inputs apart.
  const float* tapOf(std::span<const float> values, size_t tap) const {
    return values.data() + weight_ + tap * inputs_;
  }

  size_t inputs_ = 0, outputs_ = 0;
  size_t weight_ = 0, bias_ = 0;
};

}  // namespace stipple
