#pragma once

#include <cstdint>
#include <vector>

#include "generate/flow_network.h"
#include "generate/flow_sampler.h"

namespace stipple {

/// What a stage computes and reads. A multiplication with its addition counts as 2 operations;
/// norms and activations, some thousandths of the rest, are left out.
struct StageCost {
  double flops = 0;            ///< of everything
  double attention_flops = 0;  ///< of the two products of attentions, which are part of `flops`
  uint64_t weight_bytes = 0;   ///< of the file, read once
};

/// Sizes of the published flow network of arXiv 2605.16355.
FlowSizes publishedFlowSizes();

/// One call of the network. In: context_rows: 1 for the call without an image.
StageCost flowCallCost(const FlowSizes& sizes, uint64_t token_count, uint64_t context_rows);
/// FlowNetwork::context(): once for an image.
StageCost flowContextCost(const FlowSizes& sizes, uint64_t context_rows);
/// sampleLatent() and the context before it.
StageCost flowSamplingCost(const FlowSizes& sizes, uint64_t token_count, uint64_t context_rows,
                           const FlowSettings& settings);

/// Rows of the condition of an image: a class, four registers and a patch for every 16 x 16 pixels.
uint64_t conditionRows(uint32_t canvas_size);

/// The published encoders and decoders, by the number of what they work on.
/// In: canvas_size: side of the prepared image, a multiple of 16.
StageCost structureEncoderCost(uint32_t canvas_size);  ///< DINOv3 ViT-H/16+
StageCost colourEncoderCost(uint32_t canvas_size);     ///< the encoder of the FLUX.2 VAE
/// In: cells: parents whose children are asked for, in one level.
StageCost octreeLevelCost(uint64_t cells, uint64_t token_count);
/// All levels for so many anchors, where every level has as many cells as there can be.
StageCost octreeCost(uint64_t anchor_count, uint64_t token_count);
StageCost splatDecoderCost(uint64_t anchor_count, uint64_t token_count);

/// What an artist asks for.
struct GenerationPlan {
  uint32_t canvas_size = 1024;
  uint64_t token_count = 8192;
  FlowSettings flow;
  uint64_t splat_count = 262144;
};

struct NamedCost {
  const char* stage;  ///< for a user
  StageCost cost;
};

/// All stages from a prepared image to splats, in order, of the published networks. Seconds are
/// flops over the operations per second that matrix products reach on a machine.
std::vector<NamedCost> generationCosts(const GenerationPlan& plan);

}  // namespace stipple
