#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "data/images/byte_image.h"

namespace stipple {

struct PreparationOptions {
  /// Side of the prepared image in pixels: a multiple of 16, 32 to 2048. Networks of images are
  /// trained with 1024; 512 is four times as fast and less faithful.
  uint32_t canvas_size = 1024;
  /// By how many pixels the mask shrinks before the object is cut out, 0 to 64: more takes away
  /// wider fringes of background.
  uint32_t erode_radius = 1;
};

/// Errors: kInvalidArgument for a value outside its range.
void validate(const PreparationOptions& options);

/// The side of the square around an object, times the longer side of its box.
constexpr double kObjectMargin = 1.2;

/// An object on black, square, in the middle.
struct PreparedImage {
  uint32_t size = 0;           ///< side in pixels
  std::vector<uint8_t> rgb;    ///< [size, size, 3] display sRGB
  std::vector<uint8_t> alpha;  ///< [size, size], what it was before black
  /// Pixels of the resized image that are not transparent: x0, y0, x1, y1, the last ones included.
  std::array<int32_t, 4> box = {};
  /// What of the resized image fills the square: left, top, right, bottom, the last ones excluded;
  /// beyond the image where the object lies near its border.
  std::array<int32_t, 4> crop = {};
};

/// Pictures on the way, for whoever wants to look at them.
struct PreparationSteps {
  ByteImage resized;           ///< RGBA
  ByteImage eroded_alpha;      ///< of the same size
  ByteImage cropped, squared;  ///< RGBA
};

/// Makes of a picture what encoders of images were trained with. The shorter side is resized to the
/// canvas, the mask eroded, the box of what is left made a square with a margin of 20 %, cut out,
/// resized and put on black.
/// In: image: RGB or RGBA, or grey; mask: null, or a picture of one channel of any size that is
/// white on the object and is used in place of the image's alpha.
/// Out: steps, filled where given.
/// Errors: kInvalidArgument for an image that is opaque everywhere without a mask, for one of which
/// nothing is left, for one that is more than 8 times as long as wide, and for hostile input.
/// Threads and determinism: whole numbers throughout; same bytes for any number of threads.
/// Source: TripoSplat's released pipeline (arXiv 2605.16355), whose bytes these are.
PreparedImage prepareImage(const ByteImage& image, const ByteImage* mask,
                           const PreparationOptions& options = {},
                           PreparationSteps* steps = nullptr);

}  // namespace stipple
