#pragma once

#include <vector>

#include "data/images/image.h"
#include "math/camera.h"
#include "math/lens.h"

namespace stipple {

/// The pinhole camera whose picture shows what a lens saw: the same place and direction, about the
/// same number of pixels, square ones where the lens's are. It reaches as far as the lens's picture
/// does to the left, right, top and bottom of the principal point, but at most 60 degrees.
/// In: seen_by, the lens's own focal lengths, principal point and size.
/// Errors: kUnsupported for a lens that maps nothing around its principal point one to one.
Camera undistortedCamera(const Camera& seen_by, const Lens& lens);

enum class PixelLookup { kBilinear, kNearest };

/// The picture of undistortedCamera(). In: image, of the size of seen_by; colours are interpolated
/// as they stand. Out: covered [H,W], 1 where the lens saw something, 0 elsewhere (the picture is 0
/// there); may be null.
/// Cost: one evaluation of the lens's model per pixel; all threads.
Image undistort(const Image& image, const Camera& seen_by, const Lens& lens, const Camera& target,
                PixelLookup lookup, std::vector<float>* covered);

/// A camera for the same picture at another size. One of size 0 x 0 is in units of the picture
/// (io/views/camera_file.h): its focal lengths are in widths, its axis is in the middle.
Camera resized(const Camera& camera, uint32_t width, uint32_t height);

/// The picture at a smaller or equal size: every pixel is the mean over the exact area that it
/// covers, edges of pixels in part. Values are averaged as they stand.
Image areaAverage(const Image& image, uint32_t width, uint32_t height);

/// The picture at a smaller size from the pixels nearest to the new centres: for depths, whose mean
/// over an edge lies on no surface.
Image nearestPixels(const Image& image, uint32_t width, uint32_t height);

}  // namespace stipple
