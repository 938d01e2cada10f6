#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "nn/made_weights.h"

namespace stipple {

/// Random weights of a vision transformer: patches of 16 pixels, 4 registers, heads as the caller
/// likes. In: layer_prefix: "layer." or "model.layer."; left_out: a tensor that is missing.
inline MadeWeights madeDino(uint64_t width, uint64_t inner, size_t layers,
                            const std::string& layer_prefix = "layer.",
                            const std::string& left_out = "") {
  MadeWeights made;
  made.leaveOut(left_out);
  made.addLayer("embeddings.patch_embeddings", {width, 3, 16, 16});
  made.addRandom("embeddings.cls_token", {1, 1, width}, 1.0f);
  made.addRandom("embeddings.mask_token", {1, 1, width}, 1.0f);
  made.addRandom("embeddings.register_tokens", {1, 4, width}, 1.0f);
  for (size_t i = 0; i < layers; ++i) {
    const std::string name = layer_prefix + std::to_string(i) + ".";
    made.addNorm(name + "norm1", width);
    made.addNorm(name + "norm2", width);
    for (const char* projection : {"q_proj", "v_proj", "o_proj"}) {
      made.addLayer(name + "attention." + projection, {width, width});
    }
    made.addRandom(name + "attention.k_proj.weight", {width, width}, 0.2f);
    made.addRandom(name + "layer_scale1.lambda1", {width}, 0.5f);
    made.addRandom(name + "layer_scale2.lambda1", {width}, 0.5f);
    made.addLayer(name + "mlp.gate_proj", {inner, width});
    made.addLayer(name + "mlp.up_proj", {inner, width});
    made.addLayer(name + "mlp.down_proj", {width, inner});
  }
  made.addNorm("norm", width);
  return made;
}

inline void addResidual(MadeWeights& made, const std::string& name, uint64_t inputs,
                        uint64_t outputs) {
  made.addNorm(name + ".norm1", inputs);
  made.addLayer(name + ".conv1", {outputs, inputs, 3, 3});
  made.addNorm(name + ".norm2", outputs);
  made.addLayer(name + ".conv2", {outputs, outputs, 3, 3});
  if (inputs != outputs) made.addLayer(name + ".conv_shortcut", {outputs, inputs, 1, 1});
}

/// Random weights of an autoencoder's encoder: a level for each of `channels`, two residuals each.
inline MadeWeights madeVae(const std::vector<uint64_t>& channels, uint64_t latent,
                           const std::string& left_out = "") {
  MadeWeights made;
  made.leaveOut(left_out);
  made.addLayer("encoder.conv_in", {channels[0], 3, 3, 3});
  uint64_t before = channels[0];
  for (size_t i = 0; i < channels.size(); ++i) {
    const std::string name = "encoder.down_blocks." + std::to_string(i) + ".";
    addResidual(made, name + "resnets.0", before, channels[i]);
    addResidual(made, name + "resnets.1", channels[i], channels[i]);
    before = channels[i];
    if (i + 1 < channels.size()) {
      made.addLayer(name + "downsamplers.0.conv", {before, before, 3, 3});
    }
  }
  addResidual(made, "encoder.mid_block.resnets.0", before, before);
  addResidual(made, "encoder.mid_block.resnets.1", before, before);
  const std::string attention = "encoder.mid_block.attentions.0.";
  made.addNorm(attention + "group_norm", before);
  for (const char* layer : {"to_q", "to_k", "to_v", "to_out.0"}) {
    made.addLayer(attention + layer, {before, before});
  }
  made.addNorm("encoder.conv_norm_out", before);
  made.addLayer("encoder.conv_out", {2 * latent, before, 3, 3});
  made.addLayer("quant_conv", {2 * latent, 2 * latent, 1, 1});
  made.addRandom("bn.running_mean", {4 * latent}, 0.1f);
  made.add("bn.running_var", {4 * latent}, std::vector<float>(4 * latent, 0.8f));
  return made;
}

}  // namespace stipple
