#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace stipple {

/// Names and shapes of the tensors of a network.
using WeightShapes = std::vector<std::pair<std::string, std::vector<uint64_t>>>;

/// `name`.weight of that shape and `name`.bias.
inline void addLayerShapes(WeightShapes& shapes, const std::string& name,
                           const std::vector<uint64_t>& shape) {
  shapes.push_back({name + ".weight", shape});
  shapes.push_back({name + ".bias", {shape[0]}});
}

/// A DINOv3 vision transformer with patches of 16 pixels and 4 registers. The released ViT-H/16+
/// has a width of 1280, 5120 inner numbers and 32 layers. In: layer_prefix: "layer." or
/// "model.layer.".
inline WeightShapes dinoShapes(uint64_t width, uint64_t inner, size_t layers,
                               const std::string& layer_prefix = "layer.") {
  WeightShapes shapes;
  addLayerShapes(shapes, "embeddings.patch_embeddings", {width, 3, 16, 16});
  shapes.push_back({"embeddings.cls_token", {1, 1, width}});
  shapes.push_back({"embeddings.mask_token", {1, 1, width}});
  shapes.push_back({"embeddings.register_tokens", {1, 4, width}});
  for (size_t i = 0; i < layers; ++i) {
    const std::string name = layer_prefix + std::to_string(i) + ".";
    addLayerShapes(shapes, name + "norm1", {width});
    addLayerShapes(shapes, name + "norm2", {width});
    for (const char* projection : {"q_proj", "v_proj", "o_proj"}) {
      addLayerShapes(shapes, name + "attention." + projection, {width, width});
    }
    shapes.push_back({name + "attention.k_proj.weight", {width, width}});
    shapes.push_back({name + "layer_scale1.lambda1", {width}});
    shapes.push_back({name + "layer_scale2.lambda1", {width}});
    addLayerShapes(shapes, name + "mlp.gate_proj", {inner, width});
    addLayerShapes(shapes, name + "mlp.up_proj", {inner, width});
    addLayerShapes(shapes, name + "mlp.down_proj", {width, inner});
  }
  addLayerShapes(shapes, "norm", {width});
  return shapes;
}

inline void addResidualShapes(WeightShapes& shapes, const std::string& name, uint64_t inputs,
                              uint64_t outputs) {
  addLayerShapes(shapes, name + ".norm1", {inputs});
  addLayerShapes(shapes, name + ".conv1", {outputs, inputs, 3, 3});
  addLayerShapes(shapes, name + ".norm2", {outputs});
  addLayerShapes(shapes, name + ".conv2", {outputs, outputs, 3, 3});
  if (inputs != outputs) addLayerShapes(shapes, name + ".conv_shortcut", {outputs, inputs, 1, 1});
}

/// The encoder of an autoencoder: a level for each of `channels`, two residuals each. That of
/// FLUX.2 has 128, 256, 512 and 512 channels and a latent of 32.
inline WeightShapes vaeShapes(const std::vector<uint64_t>& channels, uint64_t latent) {
  WeightShapes shapes;
  addLayerShapes(shapes, "encoder.conv_in", {channels[0], 3, 3, 3});
  uint64_t before = channels[0];
  for (size_t i = 0; i < channels.size(); ++i) {
    const std::string name = "encoder.down_blocks." + std::to_string(i) + ".";
    addResidualShapes(shapes, name + "resnets.0", before, channels[i]);
    addResidualShapes(shapes, name + "resnets.1", channels[i], channels[i]);
    before = channels[i];
    if (i + 1 == channels.size()) continue;
    addLayerShapes(shapes, name + "downsamplers.0.conv", {before, before, 3, 3});
  }
  addResidualShapes(shapes, "encoder.mid_block.resnets.0", before, before);
  addResidualShapes(shapes, "encoder.mid_block.resnets.1", before, before);
  const std::string attention = "encoder.mid_block.attentions.0.";
  addLayerShapes(shapes, attention + "group_norm", {before});
  for (const char* layer : {"to_q", "to_k", "to_v", "to_out.0"}) {
    addLayerShapes(shapes, attention + layer, {before, before});
  }
  addLayerShapes(shapes, "encoder.conv_norm_out", {before});
  addLayerShapes(shapes, "encoder.conv_out", {2 * latent, before, 3, 3});
  addLayerShapes(shapes, "quant_conv", {2 * latent, 2 * latent, 1, 1});
  shapes.push_back({"bn.running_mean", {4 * latent}});
  shapes.push_back({"bn.running_var", {4 * latent}});
  return shapes;
}

}  // namespace stipple
