#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "data/views/view_source.h"

namespace stipple {

/// Frames that tell what moves, and how far their colours differ there.
constexpr size_t kMovingFrames = 5;
/// Of display values: 13 of 255. The noise of a camera and of JPEG, averaged over nine pixels,
/// stays below it; a thing of little contrast to what is behind it does, too.
constexpr float kMovingDifference = 0.05f;

/// The pixels of a camera that stands still in which something moves: there the values of one of
/// the colours, each averaged over the pixel and its eight neighbours, spread by more than
/// kMovingDifference over its pictures. Memory: 6 floats a pixel, however many pictures there are.
class MovingPixels {
 public:
  MovingPixels(uint32_t width, uint32_t height);

  /// In: picture [H,W,3], display values.
  void add(const std::vector<float>& picture);

  /// [H,W], true where something moves; all false of fewer than two pictures.
  std::vector<bool> found() const;

 private:
  uint32_t width_, height_;
  size_t count_ = 0;
  std::vector<float> least_, most_;  ///< [H,W,3] of the means around each pixel
};

/// Which views were taken by the same camera from the same place.
class StillCameras {
 public:
  explicit StillCameras(const ViewSource& views);

  /// The kMovingFrames views of a view's camera that are nearest to it in order of time, itself
  /// among them: two before and two after it, and at the ends of the clip the first or the last
  /// ones. All, where there are fewer; empty where the camera has no other view or moves.
  /// Ascending times.
  std::vector<size_t> around(size_t view) const;

 private:
  std::vector<std::vector<size_t>> cameras_;  ///< views by time; of one that moves, none
  std::vector<size_t> camera_of_;             ///< by view
};

}  // namespace stipple
