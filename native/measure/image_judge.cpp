#include "measure/image_judge.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "data/images/image_comparison.h"
#include "measure/accuracy_row.h"

namespace stipple {

namespace {

/// An image that is less than this many times as far from the stand-in as that from the reference
/// is judged in the blocks alone: elsewhere one would see what the stand-in is off by.
constexpr double kFarEnough = 100;
/// An image is like another in the blocks whose difference from it is less than this share of that
/// from the reference, in mean squares.
constexpr double kAlike = 0.01;

/// Absolute differences of the channels that show: alpha is left out where both are opaque.
std::vector<float> differences(const std::vector<float>& a, const std::vector<float>& b) {
  bool is_opaque = true;
  for (size_t i = 3; i < a.size() && is_opaque; i += 4) is_opaque = a[i] == 1.0f && b[i] == 1.0f;
  std::vector<float> made;
  made.reserve(a.size());
  for (size_t i = 0; i < a.size(); ++i) {
    if (!is_opaque || i % 4 != 3) made.push_back(std::abs(a[i] - b[i]));
  }
  return made;
}

double meanSquare(const std::vector<float>& values) {
  double sum = 0;
  for (const float value : values) sum += static_cast<double>(value) * static_cast<double>(value);
  return values.empty() ? 0 : sum / static_cast<double>(values.size());
}

}  // namespace

uint64_t pixelsOf(std::span<const PixelArea> areas) {
  uint64_t count = 0;
  for (const PixelArea& area : areas) count += uint64_t{area.width} * area.height;
  return count;
}

ImageJudge::ImageJudge(uint32_t width, uint32_t height, bool is_display,
                       std::vector<PixelArea> blocks)
    : width_(width),
      is_display_(is_display),
      blocks_(std::move(blocks)),
      whole_{{0, 0, width, height}} {}

void ImageJudge::setReference(const RenderResult& image) {
  reference_ = valuesOf(image, blocks_);
}

void ImageJudge::setStandIn(const RenderResult& image) {
  stand_in_ = valuesOf(image, whole_);
  stand_in_of_blocks_ = valuesOf(image, blocks_);
  stand_in_error_ = meanSquare(differences(stand_in_of_blocks_, reference_));
}

void ImageJudge::judge(const RenderResult& image, bool is_whole, AccuracyRow& row) {
  std::vector<float> drawn = valuesOf(image, blocks_);
  std::vector<float> in_blocks = differences(drawn, reference_);
  const double by_reference = meanSquare(in_blocks);
  if (is_whole && !stand_in_.empty()) {
    std::vector<float> everywhere = differences(valuesOf(image, whole_), stand_in_);
    const double by_stand_in = meanSquare(everywhere);
    if (by_stand_in > kFarEnough * stand_in_error_) {
      const double correction = by_reference - meanSquare(differences(drawn, stand_in_of_blocks_));
      const double error = by_stand_in + std::max(correction, -0.5 * by_stand_in);
      setErrors(everywhere, row);
      row.psnr = -10 * std::log10(error);
      judged_.push_back({std::move(drawn), by_reference, error, row.largest_error, row.error_99_9});
      return;
    }
  }
  setErrors(in_blocks, row);
  if (is_whole) return;
  if (const Judged* other = closeTo(drawn, by_reference)) {
    const double more = by_reference - other->error_in_blocks;
    row.psnr = -10 * std::log10(other->error + std::max(more, -0.5 * other->error));
    row.largest_error = std::max(row.largest_error, other->largest_error);
    row.error_99_9 = other->error_99_9;
  }
}

const ImageJudge::Judged* ImageJudge::closeTo(const std::vector<float>& in_blocks,
                                              double error) const {
  for (const Judged& other : judged_) {
    if (meanSquare(differences(in_blocks, other.in_blocks)) < kAlike * error) return &other;
  }
  return nullptr;
}

uint64_t ImageJudge::comparedPixels() const {
  return pixelsOf(blocks_);
}

uint64_t ImageJudge::memoryBound(uint64_t compared_pixels, uint64_t image_pixels, size_t images) {
  // Kept: the reference, the stand-in twice, every image. For a moment: values and differences.
  return 4 * sizeof(float) * ((4 + images) * compared_pixels + 3 * image_pixels);
}

std::vector<float> ImageJudge::valuesOf(const RenderResult& image,
                                        const std::vector<PixelArea>& areas) const {
  std::vector<float> values;
  values.reserve(pixelsOf(areas) * 4);
  for (const PixelArea& area : areas) {
    for (uint32_t y = area.y0; y < area.y0 + area.height; ++y) {
      const float* row = &image.colour[(size_t{y} * width_ + area.x0) * 4];
      for (size_t x = 0; x < area.width; ++x) {
        double pixel[4] = {row[4 * x], row[4 * x + 1], row[4 * x + 2], row[4 * x + 3]};
        if (!is_display_) toDisplay(pixel, 4);
        for (const double value : pixel) values.push_back(static_cast<float>(value));
      }
    }
  }
  return values;
}

}  // namespace stipple
