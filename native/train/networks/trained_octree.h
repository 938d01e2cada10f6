#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "train/networks/octree_losses.h"
#include "train/networks/trained_layers.h"

namespace stipple {

/// decode/latent/octree_network.h as it is trained: which of the eight children of a cell the
/// surface of a latent's object is in. Cells of all levels are asked about at once, since none
/// looks at another.
class TrainedOctree {
 public:
  /// What forward() leaves for backward(): the tokens before each block. What is inside a block is
  /// made again on the way back, so that memory is that of one block.
  struct Tape {
    std::vector<std::vector<float>>
        tokens;                      ///< before each block and after the last, [rows, width]
    std::vector<LatentRows> latent;  ///< of each block
  };

  /// Adds its tensors, under `prefix` ("octree.").
  TrainedOctree(ParameterLayout& layout, const std::string& prefix, const NetworkShape& shape);

  /// In: values of the layout; latent [tokens, latent_width]; levels: cells to ask about. Out:
  /// tape; logits [rows, 8], the rows of `levels` in their order. Threads and determinism:
  /// parallel; same bits for any number of threads.
  std::vector<float> forward(std::span<const float> values, size_t tokens, const float* latent,
                             std::span<const OctreeLevel> levels, Tape& tape) const;
  /// In: what forward() had and left; logit_gradient [rows, 8]. Out: gradients of the layout and
  /// latent_gradient [tokens, latent_width], which this adds to.
  void backward(std::span<const float> values, size_t tokens, const float* latent,
                std::span<const OctreeLevel> levels, Tape& tape,
                std::span<const float> logit_gradient, std::span<float> gradients,
                float* latent_gradient) const;

 private:
  struct Block {
    TrainedCrossAttention attention;
    TrainedMlp mlp;
  };
  /// Rows of one level, which share a modulation.
  struct Segment {
    size_t first = 0, count = 0;
    std::vector<float> encoding;                           ///< of the level
    std::vector<float> hidden, activated, embedded, silu;  ///< what the modulation is made by
    std::vector<float> modulation;  ///< shift, scale, gate of attention and MLP [6, width]
    std::vector<float> gradient;    ///< by the modulation
  };
  /// The inside of a block.
  struct Inside {
    std::vector<float> before_attention, looked, middle, before_mlp, passed;
    TrainedCrossAttention::Tape attention;
    TrainedMlp::Tape mlp;
  };

  std::vector<Segment> segmentsOf(std::span<const float> values,
                                  std::span<const OctreeLevel> levels) const;
  std::vector<float> runBlock(std::span<const float> values, const Block& block,
                              std::span<const Segment> segments, const LatentRows& latent,
                              const std::vector<float>& tokens, Inside& inside) const;
  /// In: by_tokens: the derivative by what the block makes; it becomes that by its tokens.
  void backwardOfBlock(std::span<const float> values, const Block& block,
                       std::span<Segment> segments, LatentRows& latent,
                       const std::vector<float>& tokens, std::vector<float>& by_tokens,
                       std::span<float> gradients) const;
  void backwardOfModulation(std::span<const float> values, const Segment& segment,
                            std::span<float> gradients) const;

  NetworkShape shape_;
  TrainedLinear level_in_, level_out_, modulation_;
  TrainedPointEmbedding embedding_;
  std::vector<Block> blocks_;
  TrainedLinear out_;
};

}  // namespace stipple
