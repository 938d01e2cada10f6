#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "data/weight_table.h"
#include "generate/stage_listener.h"
#include "nn/convolution.h"
#include "nn/group_norm.h"
#include "nn/linear.h"
#include "nn/network_run.h"

namespace stipple {

struct VaeOptions {
  size_t groups = 32;           ///< of group normalisations, which no tensor tells
  float norm_epsilon = 1e-6f;   ///< of group normalisations
  float token_epsilon = 1e-5f;  ///< beside the variances of the tokens' numbers
};

/// The encoder of the FLUX.2 autoencoder, and smaller ones of its kind: an image becomes tokens
/// that hold its colours, one for each square of 16 pixels. Channels and levels are those of the
/// file; its decoder is left alone.
/// Source: the autoencoder of Black Forest Labs' FLUX.2, in the names of the diffusers library.
class VaeEncoder {
 public:
  /// Reads what is small and checks the shapes of everything else. Errors: kFormat, naming file,
  /// tensor, what was seen and what is allowed.
  explicit VaeEncoder(const WeightTable& weights, const VaeOptions& options = {});

  size_t latentChannels() const { return moments_.outputs() / 2; }
  size_t tokenWidth() const { return 4 * latentChannels(); }
  /// Sides of an image are multiples of this: 16.
  size_t tokenSize() const { return size_t{1} << levels_.size(); }
  size_t rowsFor(size_t height, size_t width) const {
    return height / tokenSize() * (width / tokenSize());
  }
  /// How many numbers of noise an image of that size takes.
  size_t noiseCount(size_t height, size_t width) const {
    return tokenWidth() * rowsFor(height, width);
  }
  /// Multiplications and additions for an image of that size.
  double flops(size_t height, size_t width) const;

  /// In: rgb [height, width, 3] of 0..1, display sRGB; noise [latentChannels(), height / 8,
  /// width / 8], normally distributed, from which one of the latents that fit the image is made; or
  /// empty for their mean. Out: [rowsFor(), tokenWidth()], row by row.
  /// Listener: conv_in, down{i}.res{j}, down{i}.sampled, mid.res0, mid.attn, mid.res1, conv_out,
  /// moments, latent (channels last), tokens.
  /// Errors: kInvalidArgument; kCancelled; kFormat for NaN or infinity among the weights.
  /// Threads and determinism: parallel; same bits for any number of threads.
  /// Cost: flops(); memory: two maps of the first level, 2 * 4 height width channels bytes, beside
  /// what convolutions take (nn/convolution.h).
  std::vector<float> encode(const NetworkRun& run, std::span<const float> rgb, size_t height,
                            size_t width, std::span<const float> noise,
                            const StageListener& listener = {}) const;
  /// The part of encode() that knows nothing of noise, which is nearly all of it: means of the
  /// latent and behind them logarithms of variances, of [height / 8, width / 8] pixels.
  FeatureMap momentsOf(const NetworkRun& run, std::span<const float> rgb, size_t height,
                       size_t width, const StageListener& listener = {}) const;
  /// The rest of it. In: moments, as momentsOf() gives them. Errors: kInvalidArgument.
  std::vector<float> tokensOf(const FeatureMap& moments, std::span<const float> noise,
                              const StageListener& listener = {}) const;

 private:
  class Pass;
  /// x + conv2(norm2(conv1(norm1(x)))), each norm followed by SiLU; x through a 1x1 convolution
  /// where the number of channels changes.
  struct Residual {
    GroupNorm norm1, norm2;
    Convolution conv1, conv2, shortcut;
    bool has_shortcut = false;

    Residual() = default;
    Residual(const WeightTable& weights, const std::string& name, size_t inputs, size_t outputs,
             const VaeOptions& options);
    double flops(size_t height, size_t width) const;
  };
  struct Level {
    std::vector<Residual> residuals;
    Convolution down;
    bool has_down = false;
  };
  struct Attention {
    GroupNorm norm;
    Linear query, key, value, output;
  };

  void requireNoise(std::span<const float> noise, size_t height, size_t width) const;
  std::vector<float> packed(const FeatureMap& latent) const;

  Convolution in_;
  std::vector<Level> levels_;
  Residual middle_[2];
  Attention attention_;
  GroupNorm out_norm_;
  Convolution out_, moments_;
  std::vector<float> token_mean_, token_factor_;  ///< [tokenWidth()]
};

}  // namespace stipple
