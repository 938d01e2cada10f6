#pragma once

#include <cstdint>
#include <string>

#include "generate/encoder_shapes.h"

// Names and shapes of the tensors of the published networks behind the image encoders, as their
// readers in native/ want them. Sizes of the published files are in io/assets/weights_folder.cpp.

namespace stipple {

constexpr uint64_t kFlowChannels = 1024, kLatentWidth = 16, kHeads = 16, kHeadWidth = 64;
constexpr size_t kPublishedFlowBlocks = 24, kPublishedGaussianBlocks = 16;

inline void addFlowBlockShapes(WeightShapes& shapes, const std::string& block,
                               const std::string& rotary, bool has_time) {
  constexpr uint64_t c = kFlowChannels, kRotary = 128;
  shapes.push_back({rotary + ".norm.weight", {c}});
  shapes.push_back({rotary + ".norm.bias", {c}});
  shapes.push_back({rotary + ".gate_map.weight", {kRotary, c}});
  shapes.push_back({rotary + ".content_map.weight", {kRotary, c}});
  shapes.push_back({rotary + ".final_map.weight", {3 * kHeads, kRotary}});
  shapes.push_back({rotary + ".freqs_0", {10}});
  shapes.push_back({rotary + ".freqs_1", {10}});
  shapes.push_back({rotary + ".freqs_2", {12}});
  addLayerShapes(shapes, block + ".attn.qkv", {3 * c, c});
  addLayerShapes(shapes, block + ".attn.out", {c, c});
  shapes.push_back({block + ".attn.q_norm.gamma", {kHeads, kHeadWidth}});
  shapes.push_back({block + ".attn.k_norm.gamma", {kHeads, kHeadWidth}});
  addLayerShapes(shapes, block + ".mlp.mlp.0", {4 * c, c});
  addLayerShapes(shapes, block + ".mlp.mlp.2", {c, 4 * c});
  if (has_time) {
    shapes.push_back({block + ".shift_table", {1, 6 * c}});
    return;
  }
  addLayerShapes(shapes, block + ".norm1", {c});
  addLayerShapes(shapes, block + ".norm2", {c});
}

/// The flow network. In: blocks: kPublishedFlowBlocks, or fewer.
inline WeightShapes flowShapes(size_t blocks = kPublishedFlowBlocks) {
  constexpr uint64_t c = kFlowChannels, kCamera = 5;
  WeightShapes shapes;
  addLayerShapes(shapes, "t_embedder.mlp.0", {c, 256});
  addLayerShapes(shapes, "t_embedder.mlp.2", {c, c});
  addLayerShapes(shapes, "adaLN_modulation.1", {6 * c, c});
  addLayerShapes(shapes, "input_layer", {c, kLatentWidth});
  addLayerShapes(shapes, "cond_embedder", {c, 1280});
  addLayerShapes(shapes, "cond_embedder2", {c, 128});
  addLayerShapes(shapes, "cam_refiner.mlp.0", {c, kCamera});
  addLayerShapes(shapes, "cam_refiner.mlp.2", {c, c});
  addLayerShapes(shapes, "out_layer", {kLatentWidth, c});
  addLayerShapes(shapes, "cam_out_layer", {kCamera, c});
  shapes.push_back({"shift_table", {1, 2, c}});
  for (size_t i = 0; i < 2; ++i) {
    const std::string index = std::to_string(i);
    addFlowBlockShapes(shapes, "noise_refiner." + index, "noise_repo_layers." + index, true);
    addFlowBlockShapes(shapes, "context_refiner." + index, "context_repo_layers." + index, false);
  }
  for (size_t i = 0; i < blocks; ++i) {
    const std::string index = std::to_string(i);
    addFlowBlockShapes(shapes, "blocks." + index, "repo_layers." + index, true);
  }
  return shapes;
}

inline void addTokenNetworkShapes(WeightShapes& shapes, const std::string& prefix, uint64_t outputs,
                                  size_t blocks) {
  constexpr uint64_t c = kFlowChannels;
  addLayerShapes(shapes, prefix + "in_proj", {c, 3});
  addLayerShapes(shapes, prefix + "input_layer", {c, c});
  addLayerShapes(shapes, prefix + "out_proj", {outputs, c});
  for (size_t i = 0; i < blocks; ++i) {
    const std::string block = prefix + "blocks." + std::to_string(i) + ".";
    addLayerShapes(shapes, block + "cross_attn.to_q", {c, c});
    addLayerShapes(shapes, block + "cross_attn.to_kv", {2 * c, kLatentWidth});
    addLayerShapes(shapes, block + "cross_attn.to_out", {c, c});
    shapes.push_back({block + "cross_attn.q_rms_norm.gamma", {kHeads, kHeadWidth}});
    shapes.push_back({block + "cross_attn.k_rms_norm.gamma", {kHeads, kHeadWidth}});
    addLayerShapes(shapes, block + "mlp.mlp.0", {4 * c, c});
    addLayerShapes(shapes, block + "mlp.mlp.2", {c, 4 * c});
  }
}

/// The two networks of the decoder. In: blocks of the Gaussian network: kPublishedGaussianBlocks,
/// or fewer.
inline WeightShapes decoderShapes(size_t blocks = kPublishedGaussianBlocks) {
  constexpr uint64_t c = kFlowChannels, kGaussians = 32, kNumbers = 15, kOctreeBlocks = 4;
  WeightShapes shapes;
  addLayerShapes(shapes, "octree.l_embedder.mlp.0", {c, 256});
  addLayerShapes(shapes, "octree.l_embedder.mlp.2", {c, c});
  addLayerShapes(shapes, "octree.adaLN_modulation.1", {6 * c, c});
  addTokenNetworkShapes(shapes, "octree.", 8, kOctreeBlocks);
  shapes.push_back({"gs.points_offset_perturbation", {kGaussians, 3}});
  shapes.push_back({"gs.base_offset_scale", {}});
  addTokenNetworkShapes(shapes, "gs.", kGaussians * kNumbers, blocks);
  for (size_t i = 0; i < blocks; ++i) {
    const std::string block = "gs.blocks." + std::to_string(i) + ".";
    addLayerShapes(shapes, block + "norm2", {c});
    addLayerShapes(shapes, block + "self_attn.to_qkv", {3 * c, c});
    addLayerShapes(shapes, block + "self_attn.to_out", {c, c});
    shapes.push_back({block + "self_attn.q_rms_norm.gamma", {kHeads, kHeadWidth}});
    shapes.push_back({block + "self_attn.k_rms_norm.gamma", {kHeads, kHeadWidth}});
  }
  return shapes;
}

/// What the published autoencoder's file has beside its encoder, which nothing here reads.
inline WeightShapes vaeDecoderShapes() {
  constexpr uint64_t kLatent = 32;
  WeightShapes shapes;
  addLayerShapes(shapes, "post_quant_conv", {kLatent, kLatent, 1, 1});
  addLayerShapes(shapes, "decoder.conv_in", {512, kLatent, 3, 3});
  addResidualShapes(shapes, "decoder.mid_block.resnets.0", 512, 512);
  addResidualShapes(shapes, "decoder.mid_block.resnets.1", 512, 512);
  const std::string attention = "decoder.mid_block.attentions.0.";
  addLayerShapes(shapes, attention + "group_norm", {512});
  for (const char* layer : {"to_q", "to_k", "to_v", "to_out.0"}) {
    addLayerShapes(shapes, attention + layer, {512, 512});
  }
  constexpr uint64_t kChannels[] = {512, 512, 256, 128};
  uint64_t before = kChannels[0];
  for (size_t level = 0; level < 4; ++level) {
    const std::string name = "decoder.up_blocks." + std::to_string(level) + ".";
    for (size_t i = 0; i < 3; ++i) {
      addResidualShapes(shapes, name + "resnets." + std::to_string(i), before, kChannels[level]);
      before = kChannels[level];
    }
    if (level < 3) addLayerShapes(shapes, name + "upsamplers.0.conv", {before, before, 3, 3});
  }
  addLayerShapes(shapes, "decoder.conv_norm_out", {before});
  addLayerShapes(shapes, "decoder.conv_out", {3, before, 3, 3});
  return shapes;
}

}  // namespace stipple
