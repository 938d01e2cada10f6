#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "nn/training/trained_linear.h"
#include "nn/training/trained_mlp.h"
#include "train/detail/coarse_evidence.h"

namespace stipple {

/// Makes the features of points from what they and the views say: each point's own numbers through
/// an MLP, and to them what it finds when it looks at all views that it is in, by attention of
/// several heads, each view's numbers having gone through an MLP. With its way back.
class DetailInput {
 public:
  struct Tape {
    TrainedMlp::Tape own_mlp, seen_mlp;
    std::vector<float> own;                  ///< [points, width]
    std::vector<float> seen;                 ///< [points views, width]
    std::vector<float> query, keys, values;  ///< [points, width]; [points views, width] each
    std::vector<float> shares;               ///< [points, heads, views]
    std::vector<float> found;                ///< [points, width]
  };

  /// Adds its tensors, under `prefix`. In: heads * head_width is the width.
  DetailInput(ParameterLayout& layout, const std::string& prefix, size_t heads, size_t head_width);

  /// Returns [points, width]. Threads and determinism: parallel; same bits for any number of
  /// threads.
  std::vector<float> forward(std::span<const float> values, const CoarseEvidence& evidence,
                             Tape& tape) const;
  /// In: by_features [points, width]. Out: gradients, which this adds to.
  void backward(std::span<const float> values, const CoarseEvidence& evidence, const Tape& tape,
                std::span<const float> by_features, std::span<float> gradients) const;

 private:
  size_t heads_, head_width_, width_;
  TrainedMlp own_, seen_;
  TrainedLinear query_, key_, value_, out_;
};

}  // namespace stipple
