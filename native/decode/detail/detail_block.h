#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "decode/detail/sparse_convolution.h"
#include "nn/training/trained_linear.h"
#include "nn/training/trained_mlp.h"

namespace stipple {

/// Points of a layer as its blocks see them: what lies around each, and in which orders they are
/// cut into patches.
struct PointNeighbourhood {
  PointNeighbourhood(std::span<const float> points, double side);

  CellNeighbours neighbours;
  std::vector<std::vector<uint32_t>> orders;  ///< one for each CellCurve

 private:
  explicit PointNeighbourhood(const PointCells& cells);
};

/// Sizes of a block.
struct DetailBlockSizes {
  size_t channels = 0;
  size_t heads = 0;
  size_t patch = 48;  ///< points that look at each other
  size_t mlp_ratio = 4;
};

/// A block of a point transformer, with its way back: points look at the cells around them, at the
/// points of their patch, and go through an MLP; each is added to them. Patches are cut along one
/// curve. The last patch of a row of points is filled up with the last of the one before it, which
/// are looked at and do not look.
class DetailBlock {
 public:
  DetailBlock(ParameterLayout& layout, const std::string& prefix, const DetailBlockSizes& sizes);

  /// In: f [points, channels]; curve: which of the orders. Returns [points, channels].
  std::vector<float> apply(std::span<const float> values, const PointNeighbourhood& around,
                           size_t curve, const std::vector<float>& f) const;
  /// The block is run again. In: f as apply() had it; by_f: by what it made. Out: by_f: by `f`;
  /// gradients, which this adds to.
  void backward(std::span<const float> values, const PointNeighbourhood& around, size_t curve,
                const std::vector<float>& f, std::vector<float>& by_f,
                std::span<float> gradients) const;

 private:
  struct Inside;
  struct Patch {
    size_t first = 0, count = 0;          ///< rows that look
    size_t first_key = 0, key_count = 0;  ///< rows that are looked at
  };

  std::vector<Patch> patchesOf(size_t points) const;
  std::vector<float> run(std::span<const float> values, const PointNeighbourhood& around,
                         size_t curve, const std::vector<float>& f, Inside& inside) const;
  /// Out: by_qkv [points, 3 channels], in the order of the curve.
  void backwardOfPatches(const std::vector<float>& qkv, const std::vector<float>& attended,
                         const std::vector<float>& by_attended, std::vector<float>& by_qkv) const;

  DetailBlockSizes sizes_;
  SparseConvolution around_;
  TrainedLinear after_, to_all_, out_;
  TrainedMlp mlp_;
};

/// What the norms of the network add to variances.
constexpr float kDetailEpsilon = 1e-5f;

}  // namespace stipple
