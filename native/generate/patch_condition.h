#pragma once

#include "generate/image_condition.h"
#include "generate/image_preparation.h"

namespace stipple {

/// What a small flow network is told of an image, which was trained here without encoders of
/// images: the pixels of each patch as they are, and where it is.
struct PatchSizes {
  uint32_t canvas = 128;  ///< side of the prepared image: a multiple of 16 and of `patch`
  uint32_t patch = 16;    ///< side of a patch, pixels

  uint32_t rows() const { return (canvas / patch) * (canvas / patch); }
  uint32_t structureWidth() const { return patch * patch * 3; }
};

/// Numbers that tell a place: sines and cosines of multiples of both coordinates.
constexpr uint32_t kPatchPlaceWidth = 32;

/// Errors: kInvalidArgument for sizes out of range, or that do not divide each other.
void validate(const PatchSizes& sizes);

/// In: image, of sizes.canvas. Out: structure: display values from -1 to 1, row-major; colour: the
/// place. Errors: kInvalidArgument for an image of another size.
ImageCondition patchCondition(const PreparedImage& image, const PatchSizes& sizes);

}  // namespace stipple
