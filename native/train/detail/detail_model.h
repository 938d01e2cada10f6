#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "data/clouds/splat_cloud.h"
#include "data/tensor_table.h"
#include "decode/detail/detail_network.h"
#include "nn/training/parameter_layout.h"
#include "train/detail/child_splats.h"
#include "train/detail/coarse_evidence.h"
#include "train/detail/detail_input.h"

namespace stipple {

/// Sizes of the network that adds detail.
struct DetailModelSizes {
  size_t heads = 4, head_width = 16;
  size_t layers = 1;  ///< 1 or 2
  size_t blocks = 2;  ///< of each layer
  size_t mlp_ratio = 4;
  size_t patch = 48;
  size_t children = 4;  ///< of a splat in each layer: 1, 2, 4 or 8
  double ratio = 0.5;   ///< of the first of two layers' children that go on
};

/// Errors: kInvalidArgument with the number, its value and what is allowed.
void validate(const DetailModelSizes& sizes);

/// Coarse splats, of which those that matter most become finer ones in one pass: what views say of
/// them (CoarseEvidence), features (DetailInput), finer points (DetailNetwork), splats
/// (ChildSplats). With its way back to all weights.
class DetailModel {
 public:
  struct Tape {
    DetailInput::Tape input;
    DetailNetwork::Tape network;
    std::vector<DetailNetwork::Leaves> leaves;
  };

  /// In: precision, of the factors of products in blocks. Errors: kInvalidArgument (validate());
  /// kUnavailable (requirePrecision()).
  explicit DetailModel(const DetailModelSizes& sizes,
                       FactorPrecision precision = FactorPrecision::kFloat32);

  const ParameterLayout& layout() const { return layout_; }
  const DetailModelSizes& sizes() const { return sizes_; }
  /// Weights to begin with: Xavier-uniform, keyed by the seed; what the network says of children is
  /// 0, so that they begin as the parts of their splats.
  std::vector<float> startValues(uint64_t seed) const;
  /// All tensors by their names.
  TensorTable tensors(std::span<const float> values) const;

  /// Splats that there are when `points` of `coarse` become finer; and the most points with which
  /// there are no more than `wanted`, at most all of them.
  uint64_t splatCount(uint64_t coarse, uint64_t points) const;
  uint64_t pointsFor(uint64_t coarse, uint64_t wanted) const;

  /// Coarse splats that stay, in their order, then finer ones. In: evidence, of this cloud.
  SplatCloud forward(std::span<const float> values, const SplatCloud& coarse,
                     const CoarseEvidence& evidence, Tape& tape) const;
  /// In: tape and fine of forward(); by_fine: derivatives by its stored values. Out: gradients of
  /// the layout, which this adds to.
  void backward(std::span<const float> values, const SplatCloud& coarse,
                const CoarseEvidence& evidence, const Tape& tape, const SplatCloud& fine,
                const SplatCloud& by_fine, std::span<float> gradients) const;

 private:
  ChildSplats childrenOf(const SplatCloud& coarse, const CoarseEvidence& evidence,
                         const Tape& tape) const;

  DetailModelSizes sizes_;
  std::vector<size_t> children_;  ///< of each layer
  ParameterLayout layout_;
  DetailInput input_;
  DetailNetwork network_;
};

}  // namespace stipple
