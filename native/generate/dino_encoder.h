#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "data/weight_table.h"
#include "generate/stage_listener.h"
#include "nn/convolution.h"
#include "nn/linear.h"
#include "nn/network_run.h"

namespace stipple {

struct DinoOptions {
  size_t head_width = 64;  ///< numbers of an attention head, which no tensor tells; a multiple of 4
};

/// A DINOv3 vision transformer with gated layers (ViT-H/16+ and smaller ones): an image becomes a
/// vector of features for each patch, and for a few tokens that belong to the whole image. Sizes
/// are those of the file.
/// Source: O. Siméoni et al., DINOv3, arXiv 2508.10104; its released code.
class DinoEncoder {
 public:
  /// Reads what is small and checks the shapes of everything else. Layers may be called
  /// "model.layer.", too. Errors: kFormat, naming file, tensor, what was seen and what is allowed.
  explicit DinoEncoder(const WeightTable& weights, const DinoOptions& options = {});

  size_t width() const { return width_; }
  size_t patchSize() const { return patch_size_; }
  size_t prefixRows() const { return prefix_.size() / width_; }  ///< tokens of the whole image
  size_t rowsFor(size_t height, size_t width) const {
    return prefixRows() + height / patch_size_ * (width / patch_size_);
  }
  /// Multiplications and additions for an image of that size.
  double flops(size_t height, size_t width) const;

  /// In: rgb [height, width, 3] of 0..1, display sRGB; sides that are multiples of the patch.
  /// Out: [rowsFor(), width()]: first the tokens of the whole image, then the patches row by row;
  /// normalised twice, the second time without weights.
  /// Listener: patch_embed, tokens0, layer{i}.norm1, q_rope, k_rope, attn, after_attn, norm2, mlp,
  /// out, then norm and feature1.
  /// Errors: kInvalidArgument; kCancelled; kFormat for NaN or infinity among the weights.
  /// Threads and determinism: parallel; same bits for any number of threads.
  /// Cost: flops(); memory: rows * (2 width + 2 inner width of the MLP) floats.
  std::vector<float> encode(const NetworkRun& run, std::span<const float> rgb, size_t height,
                            size_t width, const StageListener& listener = {}) const;

 private:
  struct Layer {
    std::vector<float> norm1_weight, norm1_bias, norm2_weight, norm2_bias;
    std::vector<float> scale1, scale2;  ///< of what attention and MLP add
    Linear query, key, value, output, gate, up, down;
  };
  struct Buffers;

  void attend(const NetworkRun& run, const Layer& layer, const std::string& name, Buffers& buffers,
              const StageListener& listener) const;
  void transform(const NetworkRun& run, const Layer& layer, const std::string& name,
                 Buffers& buffers, const StageListener& listener) const;

  Convolution patches_;
  std::vector<float> prefix_;  ///< class token and registers, [prefix rows, width]
  std::vector<Layer> layers_;
  std::vector<float> norm_weight_, norm_bias_;
  size_t width_ = 0;
  size_t patch_size_ = 0;
  size_t inner_width_ = 0;  ///< of the MLPs
  size_t head_width_ = 0;
};

}  // namespace stipple
