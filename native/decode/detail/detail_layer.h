#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "nn/training/trained_linear.h"
#include "nn/training/trained_mlp.h"

namespace stipple {

/// Frequencies of the encoding of offsets: 1, 2, ... 2^14.
constexpr size_t kOffsetFrequencies = 15;

/// Every point becomes S children, each within half of a cell of it on every axis, with its way
/// back.
class PointUpsampling {
 public:
  struct Tape {
    std::vector<float> normal;  ///< [points, channels]
    TrainedMlp::Tape offset_mlp, child_mlp;
    std::vector<float> raw;  ///< [points, S, 3], of which the hyperbolic tangent is taken
    std::vector<float> encoded, encoded_normal;  ///< [points S, 90 + channels]
    std::vector<float> sums;  ///< [points S, next channels], before the last norm
  };
  /// Children, S beside each other for each point.
  struct Children {
    std::vector<float> points;    ///< [points S, 3]
    std::vector<float> features;  ///< [points S, next channels]
  };

  PointUpsampling() = default;
  /// Adds `prefix`delta_x, skip and delta_f.
  PointUpsampling(ParameterLayout& layout, const std::string& prefix, size_t channels,
                  size_t next_channels, size_t children);

  /// In: points [n,3]; f [n, channels]; side of a cell.
  Children apply(std::span<const float> values, std::span<const float> points,
                 const std::vector<float>& f, double side, Tape& tape) const;
  /// In: f, side and tape as apply() had them; by: derivatives by the children. Out: gradients and
  /// by_points [n,3], which this adds to; by_f [n, channels], written over.
  void backward(std::span<const float> values, const std::vector<float>& f, double side,
                const Tape& tape, const Children& by, std::span<float> gradients,
                std::span<float> by_points, std::vector<float>& by_f) const;

 private:
  size_t channels_ = 0, next_ = 0, children_ = 0;
  TrainedMlp offset_;
  TrainedLinear skip_;
  TrainedMlp child_;
};

/// How the score of a point becomes a probability.
enum class DetailScore {
  kLogistic,  ///< of each by itself
  kSoftmax,   ///< over all points
};

/// Which points go on to the next layer: the ceil(ratio n) of the largest probabilities, of equal
/// ones the first. The choice has no derivative; features are handed on with one of probability:
/// their values as they are, and of their derivative g, p g goes to the features and f . g to p.
class PointSelection {
 public:
  struct Tape {
    TrainedMlp::Tape mlp;
    std::vector<float> probabilities;  ///< [n]
  };

  PointSelection() = default;
  /// Adds `prefix`net.0 and net.2.
  PointSelection(ParameterLayout& layout, const std::string& prefix, size_t channels,
                 DetailScore score);

  /// Out: [n], 1 for points that go on.
  std::vector<uint8_t> choose(std::span<const float> values, const std::vector<float>& f,
                              double ratio, Tape& tape) const;
  /// In: by_handed [n, channels], by the features that were handed on. Out: gradients; by_f, which
  /// this adds to.
  void backward(std::span<const float> values, const std::vector<float>& f, const Tape& tape,
                const std::vector<float>& by_handed, std::span<float> gradients,
                std::vector<float>& by_f) const;

 private:
  size_t channels_ = 0;
  TrainedMlp net_;
  DetailScore score_ = DetailScore::kLogistic;
};

/// The ceil(ratio n) largest, of equal ones the first: 1.
std::vector<uint8_t> largestShare(std::span<const float> values, double ratio);

}  // namespace stipple
