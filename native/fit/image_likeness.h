#pragma once

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "generate/image_preparation.h"
#include "splat/render/image_renderer.h"

namespace stipple {

/// How much a cloud looks like the object in an image, from wherever it looks most like it: both
/// are cut out by the box of what shows, with the image's margin, and compared over black.
/// In: cloud, z up; image, as prepareImage() leaves it. Returns: PSNR in dB over 64 x 64 pixels of
/// display values, at most 100; 0 for a cloud of which nothing shows. Errors: kCancelled. Same
/// value for any number of threads. Cost: two small images from each of about 550 directions, and
/// 270 more.
double imageLikeness(const ImageRendererFactory& images, const SplatCloud& cloud,
                     const PreparedImage& image, Progress* progress = nullptr);

}  // namespace stipple
