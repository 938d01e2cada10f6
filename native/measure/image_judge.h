#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "data/accuracy_report.h"
#include "splat/render/ray_render.h"
#include "splat/render/render.h"

namespace stipple {

/// Gives the number of pixels in areas that do not overlap.
uint64_t pixelsOf(std::span<const PixelArea> areas);

/// Says how far images of a view are from its reference, as `compare` of two images would. The
/// reference of a large image takes minutes, so it is drawn in blocks of pixels alone. What differs
/// often lies in a few places, which blocks meet or miss; so whole images are compared with a
/// stand-in that is close to the reference and can be drawn whole, and the blocks correct what it
/// is off by (the stand-in is a control variate of the mean squared error).
class ImageJudge {
 public:
  /// In: pixels of the images; is_display, whether their colours are display values already;
  /// blocks, which setReference() has.
  ImageJudge(uint32_t width, uint32_t height, bool is_display, std::vector<PixelArea> blocks);

  /// In: an image with the blocks drawn.
  void setReference(const RenderResult& image);
  /// In: a whole image, which differs little from the reference. Without it blocks alone judge.
  void setStandIn(const RenderResult& image);
  /// Fills in PSNR and errors of a row. is_whole: more of the image than the blocks was drawn.
  /// One of which the blocks alone were drawn takes what is outside of them from the whole image
  /// that it hardly differs from in the blocks, where there is such an image.
  void judge(const RenderResult& image, bool is_whole, AccuracyRow& row);

  const std::vector<PixelArea>& blocks() const { return blocks_; }
  uint64_t comparedPixels() const;

  /// Bytes that it keeps and needs for a moment at most.
  static uint64_t memoryBound(uint64_t compared_pixels, uint64_t image_pixels, size_t images);

 private:
  /// A whole image that was judged.
  struct Judged {
    std::vector<float> in_blocks;  ///< values
    double error_in_blocks = 0;    ///< mean square against the reference
    double error = 0;              ///< of the whole
    double largest_error = 0;
    double error_99_9 = 0;
  };

  const Judged* closeTo(const std::vector<float>& in_blocks, double error) const;
  std::vector<float> valuesOf(const RenderResult& image, const std::vector<PixelArea>& areas) const;

  uint32_t width_;
  bool is_display_;
  std::vector<PixelArea> blocks_, whole_;
  std::vector<float> reference_;           ///< display values of the blocks, four channels
  std::vector<float> stand_in_;            ///< of the whole image; empty without
  std::vector<float> stand_in_of_blocks_;  ///< of the blocks
  double stand_in_error_ = 0;              ///< mean square, in the blocks
  std::vector<Judged> judged_;
};

}  // namespace stipple
