#include "generate/image_preparation.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/number_text.h"
#include "generate/byte_resize.h"

namespace stipple {

namespace {

constexpr uint32_t kLongest = 8;  ///< times as long as wide
constexpr uint32_t kMostErosion = 64;

void validate(const ByteImage& image, const ByteImage* mask, const PreparationOptions& options) {
  requireByteImage(image, "The image");
  if (mask != nullptr) {
    requireByteImage(*mask, "The mask");
    if (mask->channels != 1) {
      fail(ErrorCode::kInvalidArgument, "The mask has " + std::to_string(mask->channels) +
                                            " channels; it must have 1, white on the object.");
    }
  }
  validate(options);
  const uint64_t longer = std::max(image.width, image.height);
  const uint64_t shorter = std::min(image.width, image.height);
  if (longer > kLongest * shorter) {
    fail(ErrorCode::kInvalidArgument, "The image is " + sizeText(image.width, image.height) +
                                          " pixels; it may be at most 8 times as long as wide. "
                                          "Crop it to the object.");
  }
}

/// `size` in proportion, halves to even.
uint32_t scaled(uint32_t size, double scale) {
  return static_cast<uint32_t>(std::max(1.0, std::nearbyint(size * scale)));
}

/// As RGBA, opaque where the image has no alpha or shall not have it.
ByteImage withAlpha(const ByteImage& image, bool keep_alpha) {
  ByteImage out = {image.width, image.height, 4, {}};
  out.pixels.resize(out.pixelCount() * 4);
  for (size_t i = 0; i < out.pixelCount(); ++i) {
    const uint8_t* from = image.pixels.data() + i * image.channels;
    for (size_t c = 0; c < 3; ++c) out.pixels[4 * i + c] = from[image.channels == 1 ? 0 : c];
    out.pixels[4 * i + 3] = image.channels == 4 && keep_alpha ? from[3] : 255;
  }
  return out;
}

ByteImage alphaOf(const ByteImage& rgba) {
  ByteImage alpha = {rgba.width, rgba.height, 1, {}};
  alpha.pixels.resize(rgba.pixelCount());
  for (size_t i = 0; i < alpha.pixels.size(); ++i) alpha.pixels[i] = rgba.pixels[4 * i + 3];
  return alpha;
}

void setAlpha(ByteImage& rgba, const ByteImage& alpha) {
  for (size_t i = 0; i < alpha.pixels.size(); ++i) rgba.pixels[4 * i + 3] = alpha.pixels[i];
}

/// Smallest values of windows of 2 radius + 1 along lines of `count` values that are `step` apart.
void erodeLines(const std::vector<uint8_t>& in, std::vector<uint8_t>& out, size_t lines,
                size_t line_step, size_t count, size_t step, size_t radius) {
  for (size_t line = 0; line < lines; ++line) {
    const uint8_t* from = in.data() + line * line_step;
    uint8_t* to = out.data() + line * line_step;
    for (size_t i = 0; i < count; ++i) {
      const size_t begin = i < radius ? 0 : i - radius;
      const size_t end = std::min(count, i + radius + 1);
      uint8_t least = 255;
      for (size_t k = begin; k < end; ++k) least = std::min(least, from[k * step]);
      to[i * step] = least;
    }
  }
}

/// A window that reaches beyond the border is cut there.
void erode(ByteImage& alpha, uint32_t radius) {
  if (radius == 0) return;
  std::vector<uint8_t> rows(alpha.pixels.size());
  erodeLines(alpha.pixels, rows, alpha.height, alpha.width, alpha.width, 1, radius);
  erodeLines(rows, alpha.pixels, alpha.width, 1, alpha.height, alpha.width, radius);
}

/// The image with the alpha that says what the object is.
ByteImage resizedWithAlpha(const ByteImage& image, const ByteImage* mask, uint32_t canvas_size) {
  const double scale = static_cast<double>(canvas_size) / std::min(image.width, image.height);
  const uint32_t width = scaled(image.width, scale), height = scaled(image.height, scale);
  ByteImage resized = resizeBytes(withAlpha(image, mask == nullptr), width, height);
  if (mask != nullptr) {
    setAlpha(resized, resizeBytes(*mask, width, height));
    return resized;
  }
  for (size_t i = 3; i < resized.pixels.size(); i += 4) {
    if (resized.pixels[i] < 255) return resized;
  }
  fail(ErrorCode::kInvalidArgument,
       "The image is opaque everywhere, so nothing says what of it is the object. Give a picture "
       "with a transparent background, or a mask beside it: a grey picture that is white on the "
       "object. No network that removes backgrounds is included.");
}

/// Fills box and crop.
void findObject(const ByteImage& alpha, uint32_t erode_radius, PreparedImage& prepared) {
  const auto width = static_cast<int32_t>(alpha.width);
  const auto height = static_cast<int32_t>(alpha.height);
  int32_t x0 = width, y0 = height, x1 = -1, y1 = -1;
  for (int32_t y = 0; y < height; ++y) {
    for (int32_t x = 0; x < width; ++x) {
      if (alpha.pixels[static_cast<size_t>(y) * alpha.width + static_cast<size_t>(x)] == 0)
        continue;
      x0 = std::min(x0, x);
      y0 = std::min(y0, y);
      x1 = std::max(x1, x);
      y1 = std::max(y1, y);
    }
  }
  // A single pixel has a square of size 0.
  if (x1 <= x0 && y1 <= y0) {
    fail(ErrorCode::kInvalidArgument,
         "Nothing is left of the object: of " + sizeText(alpha.width, alpha.height) +
             " pixels fewer than 2 are not transparent after the mask has shrunk by " +
             std::to_string(erode_radius) + " pixels. Give a mask that is white on the object.");
  }
  prepared.box = {x0, y0, x1, y1};
  const double centre_x = (x0 + x1) / 2.0, centre_y = (y0 + y1) / 2.0;
  const double half = std::max(x1 - x0, y1 - y0) / 2.0 * kObjectMargin;
  // Toward zero, so that what lies outside on the left is rounded to the right.
  prepared.crop = {static_cast<int32_t>(centre_x - half), static_cast<int32_t>(centre_y - half),
                   static_cast<int32_t>(centre_x + half), static_cast<int32_t>(centre_y + half)};
}

/// Transparent black outside the image.
ByteImage cropped(const ByteImage& rgba, const std::array<int32_t, 4>& crop) {
  ByteImage out = {
      static_cast<uint32_t>(crop[2] - crop[0]), static_cast<uint32_t>(crop[3] - crop[1]), 4, {}};
  out.pixels.assign(out.pixelCount() * 4, 0);
  const int32_t left = std::max(crop[0], 0);
  const int32_t right = std::min(crop[2], static_cast<int32_t>(rgba.width));
  const int32_t bottom = std::min(crop[3], static_cast<int32_t>(rgba.height));
  for (int32_t y = std::max(crop[1], 0); y < bottom && left < right; ++y) {
    const uint8_t* from =
        rgba.pixels.data() + 4 * (static_cast<size_t>(y) * rgba.width + static_cast<size_t>(left));
    uint8_t* to = out.pixels.data() + 4 * (static_cast<size_t>(y - crop[1]) * out.width +
                                           static_cast<size_t>(left - crop[0]));
    std::copy_n(from, 4 * static_cast<size_t>(right - left), to);
  }
  return out;
}

std::vector<uint8_t> onBlack(const ByteImage& rgba) {
  std::vector<uint8_t> rgb(rgba.pixelCount() * 3);
  for (size_t i = 0; i < rgba.pixelCount(); ++i) {
    for (size_t c = 0; c < 3; ++c) {
      const uint32_t product = uint32_t{rgba.pixels[4 * i + c]} * rgba.pixels[4 * i + 3] + 128;
      rgb[3 * i + c] = static_cast<uint8_t>(((product >> 8) + product) >> 8);
    }
  }
  return rgb;
}

}  // namespace

void validate(const PreparationOptions& options) {
  const uint32_t size = options.canvas_size;
  if (size < 32 || size > 2048 || size % 16 != 0) {
    fail(ErrorCode::kInvalidArgument, "The canvas is " + std::to_string(size) +
                                          " pixels wide; multiples of 16 from 32 to 2048 are "
                                          "allowed.");
  }
  if (options.erode_radius > kMostErosion) {
    fail(ErrorCode::kInvalidArgument, "The mask shall shrink by " +
                                          std::to_string(options.erode_radius) +
                                          " pixels; 0 to 64 are allowed.");
  }
}

PreparedImage prepareImage(const ByteImage& image, const ByteImage* mask,
                           const PreparationOptions& options, PreparationSteps* steps) {
  validate(image, mask, options);
  ByteImage rgba = resizedWithAlpha(image, mask, options.canvas_size);
  if (steps != nullptr) steps->resized = rgba;
  ByteImage alpha = alphaOf(rgba);
  erode(alpha, options.erode_radius);
  setAlpha(rgba, alpha);
  PreparedImage prepared;
  prepared.size = options.canvas_size;
  findObject(alpha, options.erode_radius, prepared);
  ByteImage object = cropped(rgba, prepared.crop);
  ByteImage squared = resizeBytes(object, prepared.size, prepared.size);
  prepared.rgb = onBlack(squared);
  prepared.alpha = alphaOf(squared).pixels;
  if (steps != nullptr) {
    steps->eroded_alpha = std::move(alpha);
    steps->cropped = std::move(object);
    steps->squared = std::move(squared);
  }
  return prepared;
}

}  // namespace stipple
