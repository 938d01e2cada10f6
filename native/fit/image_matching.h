#pragma once

#include <span>

#include "base/progress.h"
#include "data/latent.h"
#include "generate/image_preparation.h"
#include "generate/progress_share.h"
#include "math/camera.h"
#include "train/backend/backend_factory.h"
#include "train/networks/density_autoencoder.h"

namespace stipple {

/// Changes a latent so that the colours of its splats are more like an image. Their shape has no
/// say in it: where it is not that of the image, it would be bent to what one side shows.
/// In: networks, values: what decodes the latent; anchors: that it is decoded with, at least 1;
/// image, as prepareImage() leaves it; camera: that looks at the splats, in the cube around the
/// origin, as the image does, square. Errors: kCancelled. Threads and determinism: parallel; same
/// bits for any number of threads. Cost: 60 times the splats are decoded and drawn in the image's
/// pixels, and the way back.
void matchColours(const DensityAutoencoder& networks, std::span<const float> values,
                  uint64_t anchors, const BackendFactory& backends, const PreparedImage& image,
                  const Camera& camera, Latent& latent, Progress* progress = nullptr,
                  ProgressShare share = {});

/// Multiplications and additions of networks in it, about.
double matchingOperations(const DensityAutoencoder& networks, uint64_t anchors);
/// What it allocates, about, bytes. In: side of the image, pixels.
uint64_t matchingBytes(const DensityAutoencoder& networks, uint64_t anchors, uint32_t side);

}  // namespace stipple
