#pragma once

#include <memory>
#include <span>
#include <vector>

#include "splat/cpu/tiles/tile.h"
#include "splat/cpu/tiles/tile_kernel_backward.h"
#include "splat/cpu/tiles/tiled_render.h"
#include "splat/render/render_backward.h"

namespace stipple {

/// Largest derivative or weight that is accepted: with colours up to 6e28 (the largest that the
/// renderer makes) every float32 product and sum of a tile stays below 3e38.
constexpr float kLargestInput = 1e4f;

/// The loss of a whole picture.
struct PictureLoss {
  const BackwardInput* input;
  const KeptPicture* picture;
  BackwardWants wants;
};

/// Takes the splats off tiles, one tile after another; its memory does not grow with the tile.
class TileBackward {
 public:
  TileBackward();

  /// Of which picture the next tiles are; all three must outlive them.
  void begin(const BackwardKernel& kernel, const SplatSlots& slots, const PictureLoss& loss);

  /// Tile `index` of the picture. Out: sums [tile.splats.size()][backwardFieldCount(wants)], one
  /// entry per splat of the tile. Adds dL/dbackground of the tile to `background` [3]. Returns how
  /// many entries were written: splats from there on show nowhere in the tile. In: next, tile
  /// index + 1 of the picture, whose pixels and splats are fetched ahead, or nullptr.
  uint32_t run(const Tile& tile, size_t index, const Tile* next, float* sums, double* background);

  /// False once a value of the loss was not within its range: what came out then has no meaning.
  bool inputIsGood() const { return input_is_good_; }

  static uint64_t memoryBound();

 private:
  struct Blended {
    uint32_t place;
    SplatAtPixel<double> here;
  };
  struct Judged {
    const TileBackward* self;
    const Tile* tile;
    size_t begin;
  };
  static void judge(const void* context, size_t splat, uint32_t pixel, BackwardPixels& pixels,
                    float* sums);
  uint32_t takeState(const Tile& tile, size_t index);
  bool lossIsGood(const Tile& tile) const;
  void takeLoss(const Tile& tile, size_t index, double* background);
  void takeStatistics(const Tile& tile);
  void askForPixels(const Tile& tile) const;
  WantedNext lastBatch(const Tile& tile, size_t index) const;
  void takeOff(const Tile& tile, size_t used, WantedNext next, float* sums);
  void takeOffInDouble(const Tile& tile, uint32_t x, uint32_t y, float* sums);

  const BackwardKernel* kernel_ = nullptr;
  SplatSlots slots_;
  const PictureLoss* loss_ = nullptr;
  std::unique_ptr<BackwardPixels> pixels_;
  std::vector<TileSplat> splats_;  ///< one batch
  std::vector<Blended> blended_;   ///< one pixel in double
  bool has_doubt_ = false;
  bool input_is_good_ = true;
};

}  // namespace stipple
