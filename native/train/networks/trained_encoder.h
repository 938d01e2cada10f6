#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "train/networks/trained_block.h"

namespace stipple {

/// Points of an object's surface in the unit cube, and what views show there.
struct FeaturePoints {
  size_t count = 0;
  const float* points = nullptr;    ///< [count,3]
  const float* features = nullptr;  ///< [count, width of its features]
};

/// Latents as distributions: each number is drawn around a mean.
struct EncodedLatent {
  std::vector<float> mean, log_variance;  ///< [tokens, latent width] each
};

/// The encoder of density-sampled Gaussians: a set of tokens, one at each of some points that are
/// far from each other, looks at all points with their features. Features of a second kind, at
/// points of their own, are looked at after the first.
class TrainedEncoder {
 public:
  struct Tape {
    std::vector<float> queries;              ///< [tokens,3]
    std::array<std::vector<float>, 2> rows;  ///< [count, width] what tokens look at
    TrainedTokenStack::Tape blocks;
    std::vector<float> normal;  ///< [tokens, width], before the last layers
  };

  /// Adds its tensors, under `prefix` ("encoder."). In: shape: latent_width is that of the latent;
  /// feature_widths: of one or two kinds of features.
  TrainedEncoder(ParameterLayout& layout, const std::string& prefix, const NetworkShape& shape,
                 std::span<const size_t> feature_widths);

  /// In: points: one for each kind of features; queries: which points of the first are tokens.
  EncodedLatent forward(std::span<const float> values, std::span<const FeaturePoints> points,
                        std::span<const uint32_t> queries, Tape& tape) const;
  /// In: what forward() had and left; by: derivatives by its results. Out: gradients, which this
  /// adds to; by_features: of each kind [count, width], written over, or null.
  void backward(std::span<const float> values, std::span<const FeaturePoints> points, Tape& tape,
                const EncodedLatent& by, std::span<float> gradients,
                std::span<float* const> by_features) const;

 private:
  std::vector<ContextRows> contextsOf(std::span<const FeaturePoints> points,
                                      const Tape& tape) const;

  size_t width_;
  TrainedPointEmbedding embedding_;
  std::vector<TrainedLinear> features_;
  TrainedTokenStack blocks_;
  TrainedLinear mean_, log_variance_;
};

/// Points that are far from each other: the first, then again and again the one that is farthest
/// from all that are taken; of equally far ones the first; none twice. In: points [count,3], count
/// >= 1; wanted, at most count. Threads and determinism: parallel; same result for any number of
/// threads. Cost: O(count * wanted). Source: Eldar et al., The Farthest Point Strategy for
/// Progressive Image Sampling, 1997.
std::vector<uint32_t> farthestPoints(std::span<const float> points, size_t wanted);

/// z = mean + exp(log_variance / 2) noise. In: noise, as many. Out: z.
std::vector<float> drawLatent(const EncodedLatent& encoded, std::span<const float> noise);
/// In: by_latent: the derivative by z. Out: by, which this adds to.
void drawLatentBackward(const EncodedLatent& encoded, std::span<const float> noise,
                        std::span<const float> by_latent, EncodedLatent& by);

}  // namespace stipple
