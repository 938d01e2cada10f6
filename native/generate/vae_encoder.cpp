// Based on: R. Rombach et al., High-Resolution Image Synthesis with Latent Diffusion Models, CVPR
// 2022, and the autoencoder of FLUX.2. Differs: maps are walked over in tiles, and norms applied
// while a tile is read, so that no more than two maps exist.
#include "generate/vae_encoder.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "base/number_text.h"
#include "base/parallel.h"
#include "nn/attention.h"

namespace stipple {

namespace {

/// Zeros on the right and below alone: outputs see rows 2 y to 2 y + 2.
constexpr ConvolutionGrid kHalving = {3, 2, 0, 1};
constexpr ConvolutionGrid kSame = {3, 1, 1, 1};

void say(const StageListener& listener, const std::string& stage, const FeatureMap& map) {
  if (listener) listener(stage, {map.pixelCount(), map.channels, map.channels, map.values.data()});
}

/// The outputs of a convolution of the file, by the shape of its weight.
size_t outputsOf(const WeightTable& weights, const std::string& name, size_t kernel) {
  return static_cast<size_t>(
      weights.require(name + ".weight", {kAnySize, kAnySize, kernel, kernel}).shape[0]);
}

}  // namespace

VaeEncoder::Residual::Residual(const WeightTable& weights, const std::string& name, size_t inputs,
                               size_t outputs, const VaeOptions& options)
    : norm1(weights, name + ".norm1", inputs, options.groups, options.norm_epsilon),
      norm2(weights, name + ".norm2", outputs, options.groups, options.norm_epsilon),
      conv1(weights, name + ".conv1", inputs, outputs, kSame),
      conv2(weights, name + ".conv2", outputs, outputs, kSame),
      has_shortcut(inputs != outputs) {
  if (has_shortcut) {
    shortcut = Convolution(weights, name + ".conv_shortcut", inputs, outputs, kPixelGrid);
  }
}

double VaeEncoder::Residual::flops(size_t height, size_t width) const {
  return conv1.flops(height, width) + conv2.flops(height, width) +
         (has_shortcut ? shortcut.flops(height, width) : 0.0);
}

VaeEncoder::VaeEncoder(const WeightTable& weights, const VaeOptions& options)
    : in_(weights, "encoder.conv_in", 3, kAnySize, kSame) {
  size_t channels = in_.outputs();
  // Refuses a file without levels by the name of the first one's tensor.
  const size_t level_count = std::max<size_t>(weights.countBlocks("encoder.down_blocks."), 1);
  if (level_count > 8) {
    fail(ErrorCode::kFormat, weights.source() + ": encoder.down_blocks has " +
                                 std::to_string(level_count) + " levels; 1 to 8 are allowed.");
  }
  for (size_t i = 0; i < level_count; ++i) {
    const std::string name = "encoder.down_blocks." + std::to_string(i) + ".";
    Level level;
    const size_t count = std::max<size_t>(weights.countBlocks(name + "resnets."), 1);
    for (size_t j = 0; j < count; ++j) {
      const std::string residual = name + "resnets." + std::to_string(j);
      const size_t outputs = outputsOf(weights, residual + ".conv1", 3);
      level.residuals.emplace_back(weights, residual, channels, outputs, options);
      channels = outputs;
    }
    level.has_down = i + 1 < level_count;
    if (level.has_down) {
      level.down = Convolution(weights, name + "downsamplers.0.conv", channels, channels, kHalving);
    }
    levels_.push_back(std::move(level));
  }
  const std::string middle = "encoder.mid_block.";
  for (size_t i = 0; i < 2; ++i) {
    middle_[i] =
        Residual(weights, middle + "resnets." + std::to_string(i), channels, channels, options);
  }
  const std::string attention = middle + "attentions.0.";
  attention_.norm =
      GroupNorm(weights, attention + "group_norm", channels, options.groups, options.norm_epsilon);
  attention_.query = Linear(weights, attention + "to_q", channels, channels);
  attention_.key = Linear(weights, attention + "to_k", channels, channels);
  attention_.value = Linear(weights, attention + "to_v", channels, channels);
  attention_.output = Linear(weights, attention + "to_out.0", channels, channels);
  out_norm_ =
      GroupNorm(weights, "encoder.conv_norm_out", channels, options.groups, options.norm_epsilon);
  out_ = Convolution(weights, "encoder.conv_out", channels, kAnySize, kSame);
  moments_ = Convolution(weights, "quant_conv", out_.outputs(), out_.outputs(), kPixelGrid);
  if (moments_.outputs() == 0 || moments_.outputs() % 2 != 0) {
    fail(ErrorCode::kFormat, weights.source() + ": quant_conv.weight has " +
                                 std::to_string(moments_.outputs()) +
                                 " outputs; means and logarithms of variances, as many of each, "
                                 "are needed.");
  }
  token_mean_ = weights.floats("bn.running_mean", {tokenWidth()});
  token_factor_ = weights.floats("bn.running_var", {tokenWidth()});
  for (float& factor : token_factor_) {
    if (factor < 0.0f) {
      fail(ErrorCode::kFormat, weights.source() + ": bn.running_var has a negative number, " +
                                   numberText(static_cast<double>(factor)) +
                                   "; variances are at least 0.");
    }
    factor = 1.0f / std::sqrt(factor + options.token_epsilon);
  }
}

double VaeEncoder::flops(size_t height, size_t width) const {
  double sum = in_.flops(height, width);
  for (const Level& level : levels_) {
    for (const Residual& residual : level.residuals) sum += residual.flops(height, width);
    if (!level.has_down) continue;
    sum += level.down.flops(height, width);
    height /= 2;
    width /= 2;
  }
  const auto pixels = static_cast<double>(height * width);
  const auto channels = static_cast<double>(out_.inputs());
  for (const Residual& residual : middle_) sum += residual.flops(height, width);
  sum += 8.0 * pixels * channels * channels + 4.0 * pixels * pixels * channels;
  return sum + out_.flops(height, width) + moments_.flops(height, width);
}

/// One run of the encoder: the map that it is at, and how far it is.
class VaeEncoder::Pass {
 public:
  Pass(const NetworkRun& run, double flops, const StageListener& listener)
      : run_(run), flops_(flops), listener_(listener) {
    did(0.0);
  }

  FeatureMap& map() { return map_; }
  const NetworkRun& run() const { return run_; }

  void saySoFar(const std::string& stage) const { say(listener_, stage, map_); }

  /// map becomes what the convolution makes of it.
  void convolve(const Convolution& convolution, const GroupNorm* norm = nullptr) {
    const double flops = convolution.flops(map_.height, map_.width);
    ChannelNorm statistics;
    if (norm != nullptr) statistics = norm->of(run_, map_);
    map_ = convolution.apply(run_, map_, norm != nullptr ? &statistics : nullptr);
    did(flops);
  }

  void addResidual(const Residual& residual) {
    const double flops = residual.conv1.flops(map_.height, map_.width);
    const ChannelNorm norm1 = residual.norm1.of(run_, map_);
    const FeatureMap inner = residual.conv1.apply(run_, map_, &norm1);
    did(flops);
    const ChannelNorm norm2 = residual.norm2.of(run_, inner);
    if (residual.has_shortcut) convolve(residual.shortcut);
    residual.conv2.apply(run_, inner, &norm2, map_, ConvolutionResult::kAdds);
    did(residual.conv2.flops(map_.height, map_.width));
  }

  void attend(const Attention& layer) {
    const size_t pixels = map_.pixelCount(), channels = map_.channels;
    const ChannelNorm norm = layer.norm.of(run_, map_);
    const auto room = [&] { return FeatureMap::ofSize(map_.height, map_.width, channels); };
    FeatureMap tokens = room();
    parallelFor(pixels, 256, [&](size_t begin, size_t end) {
      normalise(norm, end - begin, map_.values.data() + begin * channels,
                tokens.values.data() + begin * channels);
    });
    FeatureMap q = room(), k = room(), v = room();
    layer.query.apply(run_, pixels, tokens.values.data(), q.values.data());
    layer.key.apply(run_, pixels, tokens.values.data(), k.values.data());
    layer.value.apply(run_, pixels, tokens.values.data(), v.values.data());
    const AttentionShape shape = {1, channels, pixels, pixels};
    attention(run_, shape, {q.values.data(), channels}, {k.values.data(), channels},
              {v.values.data(), channels}, q.values.data(), channels);
    layer.output.apply(run_, pixels, q.values.data(), tokens.values.data());
    parallelFor(pixels * channels, 1 << 16, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) map_.values[i] += tokens.values[i];
    });
    const auto count = static_cast<double>(pixels), wide = static_cast<double>(channels);
    did(8.0 * count * wide * wide + 4.0 * count * count * wide);
  }

 private:
  void did(double flops) {
    done_ += flops;
    advance(run_.progress, std::min(1.0, done_ / flops_), "Colours of the image");
  }

  const NetworkRun& run_;
  double flops_;
  const StageListener& listener_;
  FeatureMap map_;
  double done_ = 0.0;
};

std::vector<float> VaeEncoder::packed(const FeatureMap& latent) const {
  const size_t channels = latent.channels, width = tokenWidth();
  std::vector<float> tokens(latent.pixelCount() / 4 * width);
  const size_t columns = latent.width / 2;
  for (size_t token = 0; token < tokens.size() / width; ++token) {
    for (size_t i = 0; i < width; ++i) {
      const size_t row = token / columns * 2 + i / 2 % 2, column = token % columns * 2 + i % 2;
      const float value = latent.values[(row * latent.width + column) * channels + i / 4];
      tokens[token * width + i] = (value - token_mean_[i]) * token_factor_[i];
    }
  }
  return tokens;
}

void VaeEncoder::requireNoise(std::span<const float> noise, size_t height, size_t width) const {
  if (!noise.empty() && noise.size() != noiseCount(height, width)) {
    fail(ErrorCode::kInvalidArgument, "The noise has " + std::to_string(noise.size()) +
                                          " numbers; it needs " +
                                          std::to_string(noiseCount(height, width)) + ", or 0.");
  }
  requireFinite(noise.data(), noise.size(), 1, "the noise");
}

std::vector<float> VaeEncoder::encode(const NetworkRun& run, std::span<const float> rgb,
                                      size_t height, size_t width, std::span<const float> noise,
                                      const StageListener& listener) const {
  requireNoise(noise, height, width);
  return tokensOf(momentsOf(run, rgb, height, width, listener), noise, listener);
}

FeatureMap VaeEncoder::momentsOf(const NetworkRun& run, std::span<const float> rgb, size_t height,
                                 size_t width, const StageListener& listener) const {
  if (height == 0 || width == 0 || height % tokenSize() != 0 || width % tokenSize() != 0) {
    fail(ErrorCode::kInvalidArgument, "The image has " + sizeText(width, height) +
                                          " pixels; multiples of " + std::to_string(tokenSize()) +
                                          " are allowed.");
  }
  if (rgb.size() != height * width * 3) {
    fail(ErrorCode::kInvalidArgument, "The image has " + std::to_string(rgb.size()) +
                                          " numbers; it needs " +
                                          std::to_string(height * width * 3) + ".");
  }
  requireFinite(rgb.data(), height * width, 3, "the image");
  Pass pass(run, flops(height, width), listener);
  pass.map() = FeatureMap::ofSize(height, width, 3);
  for (size_t i = 0; i < rgb.size(); ++i) pass.map().values[i] = 2.0f * rgb[i] - 1.0f;
  pass.convolve(in_);
  pass.saySoFar("conv_in");
  for (size_t i = 0; i < levels_.size(); ++i) {
    const std::string name = "down" + std::to_string(i) + ".";
    for (size_t j = 0; j < levels_[i].residuals.size(); ++j) {
      pass.addResidual(levels_[i].residuals[j]);
      pass.saySoFar(name + "res" + std::to_string(j));
    }
    if (!levels_[i].has_down) continue;
    pass.convolve(levels_[i].down);
    pass.saySoFar(name + "sampled");
  }
  pass.addResidual(middle_[0]);
  pass.saySoFar("mid.res0");
  pass.attend(attention_);
  pass.saySoFar("mid.attn");
  pass.addResidual(middle_[1]);
  pass.saySoFar("mid.res1");
  pass.convolve(out_, &out_norm_);
  pass.saySoFar("conv_out");
  pass.convolve(moments_);
  pass.saySoFar("moments");
  return std::move(pass.map());
}

std::vector<float> VaeEncoder::tokensOf(const FeatureMap& moments, std::span<const float> noise,
                                        const StageListener& listener) const {
  const size_t channels = latentChannels(), pixels = moments.pixelCount();
  if (moments.channels != 2 * channels || moments.height % 2 != 0 || moments.width % 2 != 0) {
    fail(ErrorCode::kInvalidArgument,
         "The moments are of " + sizeText(moments.width, moments.height) + " pixels and " +
             std::to_string(moments.channels) + " channels; even numbers of pixels and " +
             std::to_string(2 * channels) + " channels are needed.");
  }
  const size_t scale = tokenSize() / 2;
  requireNoise(noise, moments.height * scale, moments.width * scale);
  FeatureMap latent = FeatureMap::ofSize(moments.height, moments.width, channels);
  for (size_t i = 0; i < pixels; ++i) {
    const float* from = moments.values.data() + 2 * i * channels;
    for (size_t c = 0; c < channels; ++c) {
      float& value = latent.values[i * channels + c] = from[c];
      if (!noise.empty()) value += std::exp(0.5f * from[channels + c]) * noise[c * pixels + i];
    }
  }
  say(listener, "latent", latent);
  std::vector<float> tokens = packed(latent);
  if (listener) {
    listener("tokens", {tokens.size() / tokenWidth(), tokenWidth(), tokenWidth(), tokens.data()});
  }
  return tokens;
}

}  // namespace stipple
