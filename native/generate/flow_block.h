#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/default_init_vector.h"
#include "data/weight_table.h"
#include "generate/progress_share.h"
#include "nn/linear.h"
#include "nn/network_run.h"
#include "nn/positions.h"

namespace stipple {

/// What the norms of blocks, and those before places of tokens, add to variances.
constexpr float kFlowBlockEpsilon = 1e-6f, kFlowRotaryEpsilon = 1e-5f;
/// Coordinates of a place.
constexpr size_t kFlowAxes = 3;

/// Sizes that all blocks of a flow network share.
struct FlowBlockSizes {
  size_t channels = 0;
  size_t heads = 0;
  size_t head_width = 0;  ///< heads * head_width = channels
  size_t mlp_width = 0;
  size_t rotary_width = 0;  ///< channels of the small networks that place tokens
};

/// What blocks compute in, used again from block to block. The largest is `qkv`, three times as
/// wide as the tokens; everything else holds kFlowRowsAtATime tokens at most.
struct FlowBlockMemory {
  DefaultInitVector<float> qkv;     ///< [rows, 3 channels]
  DefaultInitVector<float> normed;  ///< [piece, channels]
  DefaultInitVector<float> wide;    ///< [piece, the widest of MLP and rotary network]
  RotaryTable rotary;               ///< [piece, channels / 2], twice
};

/// Tokens that go through a block's layers together. Weights, keys and values are packed once for
/// each such piece, which is a hundredth of the work of multiplying by them.
constexpr size_t kFlowRowsAtATime = 4096;

/// Bytes of FlowBlockMemory for so many tokens.
uint64_t flowBlockMemoryBytes(const FlowBlockSizes& sizes, uint64_t rows);

/// Turns the content of a token into a place in three dimensions for each head, and that into
/// angles by which pairs of channels of queries and keys are rotated (RePo).
class ContentRotary {
 public:
  ContentRotary() = default;
  /// Errors: kFormat (WeightTable::require).
  ContentRotary(const WeightTable& weights, const std::string& name, const FlowBlockSizes& sizes);

  /// In: h [rows, channels]; scratch: memory. Out: table [rows, heads * head_width / 2].
  void angles(const NetworkRun& run, size_t rows, const float* h, FlowBlockMemory& scratch,
              RotaryTable& table) const;

 private:
  FlowBlockSizes sizes_;
  std::vector<float> norm_weight_, norm_bias_;
  Linear gate_, content_, final_;
  std::vector<float> frequencies_;  ///< [head_width / 2], times pi
  std::vector<uint8_t> axes_;       ///< [head_width / 2], whose coordinate each takes
};

/// How a block is told the time.
enum class FlowModulation {
  kTime,  ///< shifts, scales and gates of the time and a table of its own
  kNone,  ///< norms with weights: the blocks that refine a condition
};

/// Self-attention with rotated queries and keys, then an MLP; each added to the tokens.
class FlowBlock {
 public:
  /// In: block, rotary: names in the file ("blocks.0", "repo_layers.0"). Errors: kFormat.
  FlowBlock(const WeightTable& weights, const std::string& block, const std::string& rotary,
            const FlowBlockSizes& sizes, FlowModulation modulation);

  /// In and out: h [rows, channels]. In: time [6 channels]: shift, scale and gate of the attention,
  /// then of the MLP, empty for kNone; key_bias [rows], or empty; share, stage: for
  /// run.progress.
  /// Errors: kCancelled. Threads and determinism: parallel; same bits for any number of threads.
  void apply(const NetworkRun& run, size_t rows, float* h, std::span<const float> time,
             std::span<const float> key_bias, FlowBlockMemory& memory, ProgressShare share,
             const char* stage) const;

 private:
  struct Modulated;
  void makeQueries(const NetworkRun& run, size_t rows, const float* h, const Modulated& time,
                   FlowBlockMemory& memory, float* qkv) const;
  void attendAndThink(const NetworkRun& run, size_t first, size_t rows, size_t all_rows, float* h,
                      const Modulated& time, std::span<const float> key_bias,
                      FlowBlockMemory& memory) const;

  FlowBlockSizes sizes_;
  ContentRotary rotary_;
  Linear qkv_, out_, mlp_in_, mlp_out_;
  std::vector<float> q_gamma_, k_gamma_;  ///< [heads, head_width]
  std::vector<float> shift_table_;        ///< [6 channels] of kTime
  std::vector<float> norm1_weight_, norm1_bias_, norm2_weight_, norm2_bias_;  ///< of kNone
};

}  // namespace stipple
