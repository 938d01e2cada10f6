#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "decode/latent/token_layers.h"

namespace stipple {

/// The network that says which of the eight children of a cell the surface of a latent's object is
/// in. Every cell is asked about by itself: it looks at the latent and at no other cell.
class OctreeNetwork {
 public:
  /// Leaf cells that the published network learned with: 256 along each side.
  static constexpr int kLeafLevel = 8;
  /// Cells that are worked on at once; memory and the time between two looks at Progress go by it.
  static constexpr size_t kRows = 1024;
  static constexpr size_t kLevelWidth = 256;  ///< of the encoding of a level

  /// In: network, under "octree.". Errors: kFormat.
  explicit OctreeNetwork(const WeightTable& network);

  size_t latentWidth() const { return blocks_.front().attention.latentWidth(); }
  LatentKeys keysOf(const NetworkRun& run, const Latent& latent) const;
  uint64_t keyBytes(uint64_t token_count) const;
  /// Bytes that logits() holds at most beside its result.
  uint64_t workBytes() const;

  /// In: level of the parents, 0..kLeafLevel - 1 and beyond; cells: Morton codes at that level.
  /// Out: out [cells, 8]: logits of the children, k = dx + 2 dy + 4 dz.
  /// Errors: kFormat where a result is not finite; kCancelled.
  /// Threads and determinism: parallel; same bits for any number of threads, and whatever cells are
  /// asked about together.
  void logits(const NetworkRun& run, const LatentKeys& keys, int level,
              std::span<const uint64_t> cells, std::span<float> out) const;

  /// Middles of cells in the unit cube, [cells, 3].
  static std::vector<float> centresOf(int level, std::span<const uint64_t> cells);
  /// What tells the network of the parents' level, [kLevelWidth].
  static std::vector<float> levelEncoding(int level);

 private:
  struct Block {
    CrossAttention attention;
    TokenMlp mlp;
  };
  /// Shift, scale and gate of attention and MLP, [6, width]; the same for all blocks.
  std::vector<float> modulationOf(const NetworkRun& run, int level) const;

  std::string source_;
  TokenHeads heads_;
  PointEmbedding embedding_;
  Linear level_in_, level_out_, modulation_;
  std::vector<Block> blocks_;
  Linear out_;
};

}  // namespace stipple
