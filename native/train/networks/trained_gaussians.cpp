// Based on: DeG, density-sampled Gaussians (arXiv 2605.16355), attribute decoder, and the released
// network of that name.
#include "train/networks/trained_gaussians.h"

#include <utility>

#include "decode/latent/token_layers.h"
#include "decode/splat_layout.h"
#include "nn/norms.h"
#include "nn/training/norms_backward.h"

namespace stipple {

TrainedGaussians::TrainedGaussians(ParameterLayout& layout, const std::string& prefix,
                                   const NetworkShape& shape, uint32_t gaussians)
    : width_(shape.width()),
      embedding_(layout, prefix, width_),
      blocks_(layout, prefix, shape, 1),
      out_(layout, prefix + "out_proj", width_, SplatLayout{gaussians, 0}.outputs()) {}

std::vector<float> TrainedGaussians::forward(std::span<const float> values,
                                             const ContextRows& latent, size_t rows,
                                             const float* points, Tape& tape) const {
  std::vector<float> tokens(rows * width_);
  embedding_.apply(values, rows, points, tokens.data());
  const std::vector<float>& last =
      blocks_.apply(values, {&latent, 1}, std::move(tokens), tape.blocks);
  tape.normal.resize(last.size());
  layerNorm(lastTokenNorm(width_), rows, last.data(), tape.normal.data());
  std::vector<float> made(rows * out_.outputs());
  out_.apply(values, rows, tape.normal.data(), made.data());
  return made;
}

void TrainedGaussians::backward(std::span<const float> values, const ContextRows& latent,
                                size_t rows, const float* points, Tape& tape,
                                std::span<const float> gradient, std::span<float> gradients,
                                float* latent_gradient) const {
  std::vector<float> by_normal(rows * width_), by_tokens(rows * width_, 0.0f);
  out_.backward(values, rows, tape.normal.data(), gradient.data(), gradients, by_normal.data());
  layerNormBackward(lastTokenNorm(width_), rows, tape.blocks.tokens.back().data(), by_normal.data(),
                    {}, by_tokens.data());
  blocks_.backward(values, {&latent, 1}, tape.blocks, by_tokens, gradients, {&latent_gradient, 1});
  embedding_.backward(values, rows, points, by_tokens.data(), gradients);
}

}  // namespace stipple
