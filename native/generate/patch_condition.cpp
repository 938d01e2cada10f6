#include "generate/patch_condition.h"

#include <cmath>
#include <numbers>
#include <string>

#include "base/error.h"

namespace stipple {

namespace {

/// [kPatchPlaceWidth] of a place, 0..1 along both axes.
void placeCode(double x, double y, float* out) {
  constexpr uint32_t kFrequencies = kPatchPlaceWidth / 4;
  for (uint32_t i = 0; i < kFrequencies; ++i) {
    const double turn = std::numbers::pi * static_cast<double>(i + 1);
    out[4 * i] = static_cast<float>(std::sin(turn * x));
    out[4 * i + 1] = static_cast<float>(std::cos(turn * x));
    out[4 * i + 2] = static_cast<float>(std::sin(turn * y));
    out[4 * i + 3] = static_cast<float>(std::cos(turn * y));
  }
}

}  // namespace

void validate(const PatchSizes& sizes) {
  PreparationOptions preparation;
  preparation.canvas_size = sizes.canvas;
  validate(preparation);
  if (sizes.patch < 4 || sizes.patch > 64 || sizes.canvas % sizes.patch != 0) {
    fail(ErrorCode::kInvalidArgument, "the side of a patch is " + std::to_string(sizes.patch) +
                                          " pixels; 4 to 64, a divisor of the canvas of " +
                                          std::to_string(sizes.canvas) + ", is allowed");
  }
}

ImageCondition patchCondition(const PreparedImage& image, const PatchSizes& sizes) {
  validate(sizes);
  if (image.size != sizes.canvas) {
    fail(ErrorCode::kInvalidArgument, "the prepared image has " + std::to_string(image.size) +
                                          " pixels along each side; " +
                                          std::to_string(sizes.canvas) + " are needed");
  }
  const uint32_t side = sizes.canvas / sizes.patch;
  ImageCondition condition;
  condition.rows = sizes.rows();
  condition.structure_width = sizes.structureWidth();
  condition.colour_width = kPatchPlaceWidth;
  condition.structure.reserve(condition.rows * condition.structure_width);
  condition.colour.resize(condition.rows * kPatchPlaceWidth);
  for (uint32_t row = 0; row < side; ++row) {
    for (uint32_t column = 0; column < side; ++column) {
      for (uint32_t y = 0; y < sizes.patch; ++y) {
        const size_t first =
            (size_t{row * sizes.patch + y} * sizes.canvas + column * sizes.patch) * 3;
        for (size_t i = 0; i < size_t{sizes.patch} * 3; ++i) {
          const auto byte = static_cast<float>(image.rgb[first + i]);
          condition.structure.push_back(byte / 127.5f - 1);
        }
      }
      placeCode((column + 0.5) / side, (row + 0.5) / side,
                &condition.colour[(size_t{row} * side + column) * kPatchPlaceWidth]);
    }
  }
  return condition;
}

}  // namespace stipple
