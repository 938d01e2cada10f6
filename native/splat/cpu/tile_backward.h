#pragma once

#include <memory>
#include <span>
#include <vector>

#include "splat/cpu/tile.h"
#include "splat/cpu/tile_kernel_backward.h"
#include "splat/render_backward.h"

namespace stipple {

/// The loss of a whole picture.
struct PictureLoss {
  const BackwardInput* input;
  uint32_t width;  ///< pixels
  bool with_background;
  double background[3];
  BackwardMode mode;
};

/// Takes the splats off tiles, one tile after another; its memory does not grow with the tile.
class TileBackward {
 public:
  TileBackward();

  /// Of which picture the next tiles are; all three must outlive them.
  void begin(const BackwardKernel& kernel, const VisibleSplat* visible, const PictureLoss& loss);

  /// Out: sums [tile.splats.size()][backwardFieldCount(mode)], one entry per splat of the tile,
  /// written whole. Adds dL/dbackground of the tile to `background` [3].
  void run(const Tile& tile, float* sums, double* background);

  static uint64_t memoryBound();

 private:
  struct Blended {
    uint32_t place;
    bool held;
    double alpha;
    double g0, g1;
  };
  void clearPixels(const Tile& tile);
  size_t mark(const Tile& tile);
  void prepareTakeOff(const Tile& tile, double* background);
  void takeOff(const Tile& tile, size_t used, float* sums);
  void takeOffInDouble(const Tile& tile, uint32_t x, uint32_t y, float* sums, double* background);
  void makeBatch(const Tile& tile, size_t batch);

  const BackwardKernel* kernel_ = nullptr;
  const VisibleSplat* visible_ = nullptr;
  const PictureLoss* loss_ = nullptr;
  std::unique_ptr<BackwardPixels> pixels_;
  std::vector<BackwardSplat> splats_;  ///< a ring of the last batches
  std::vector<Blended> blended_;       ///< one pixel in double
};

}  // namespace stipple
