#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "decode/detail/detail_block.h"
#include "decode/detail/detail_layer.h"

namespace stipple {

/// One layer of a network of detail.
struct DetailLayerSizes {
  DetailBlockSizes block;
  size_t blocks = 2;
  size_t children = 2;  ///< of every point
  double ratio = 0.8;   ///< of its children that go on; of the last layer none do
};

enum class DetailAttributes {
  kDirect,    ///< of each child by itself
  kResidual,  ///< added to those of the point that it comes from
};

struct DetailSizes {
  std::vector<DetailLayerSizes> layers;
  size_t attributes = 20;  ///< raw numbers of a splat: harmonics, opacity, scale, rotation
  DetailAttributes kind = DetailAttributes::kDirect;
};

/// Points with features become finer points, layer by layer: blocks in which points look at each
/// other, up-sampling, and a choice of those that go on to the next, finer layer. All others end as
/// splats. With its way back.
class DetailNetwork {
 public:
  /// Splats that end at one layer.
  struct Leaves {
    std::vector<float> points;      ///< [count,3]
    std::vector<float> attributes;  ///< [count, attributes], raw
  };
  struct Layer {
    double side = 0;                           ///< of its cells
    std::vector<float> points;                 ///< [n,3]
    std::vector<std::vector<float>> features;  ///< before each block and after the last
    std::vector<PointNeighbourhood> around;    ///< one
    PointUpsampling::Tape upsampling;
    PointUpsampling::Children children;
    PointSelection::Tape selection;
    std::vector<uint8_t> goes_on;  ///< [children]
    TrainedMlp::Tape head;
    std::vector<uint32_t> head_rows;  ///< children that the head looks at
    std::vector<float> head_in;
  };
  using Tape = std::vector<Layer>;
  /// Derivatives by what the network is given.
  struct InputGradients {
    std::vector<float> points, features;
  };

  /// Adds its tensors, under `prefix` ("dec.").
  DetailNetwork(ParameterLayout& layout, const std::string& prefix, const DetailSizes& sizes);

  /// In: points [n,3]; features [n, channels of the first layer]; side of a cell of the first
  /// layer, half as large in every next one. n >= 1. Out: leaves of each layer, in the order of
  /// their parents; tape. Errors: kInvalidArgument (cellsOf()). Threads and determinism: parallel;
  /// same bits for any number of threads.
  std::vector<Leaves> forward(std::span<const float> values, std::span<const float> points,
                              std::span<const float> features, double side, Tape& tape) const;
  /// In: tape of forward(); by: derivatives by its leaves. Out: gradients, which this adds to.
  InputGradients backward(std::span<const float> values, const Tape& tape,
                          std::span<const Leaves> by, std::span<float> gradients) const;

 private:
  struct Parts {
    std::vector<DetailBlock> blocks;
    PointUpsampling upsampling;
    PointSelection selection;
    TrainedMlp head;
  };

  bool isLast(size_t layer) const { return layer + 1 == parts_.size(); }

  DetailSizes sizes_;
  std::vector<Parts> parts_;
};

}  // namespace stipple
