#pragma once

#include <optional>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "generate/image_preparation.h"
#include "math/camera.h"
#include "splat/render/image_renderer.h"

namespace stipple {

/// How much a cloud looks like the object in an image.
struct ImageLikeness {
  double psnr = 0;               ///< dB over 64 x 64 pixels of display values, at most 100
  std::optional<Camera> camera;  ///< that looks at it so, 64 x 64; empty where nothing shows
};

/// From wherever a cloud looks most like the object in an image: both are cut out by the box of
/// what shows, with the image's margin, and compared over black.
/// In: cloud, z up; image, as prepareImage() leaves it. Errors: kCancelled. Same values for any
/// number of threads. Cost: two small images from each of about 550 directions, and 270 more.
ImageLikeness imageLikeness(const ImageRendererFactory& images, const SplatCloud& cloud,
                            const PreparedImage& image, Progress* progress = nullptr);

}  // namespace stipple
