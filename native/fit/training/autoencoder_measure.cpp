#include "fit/training/autoencoder_measure.h"

#include <numeric>

namespace stipple {

TrainingMeasure AutoencoderMeasure::measure(const DensityAutoencoder& networks,
                                            std::span<const float> values,
                                            const std::vector<size_t>& objects,
                                            const MeasuredAt& at, Progress* progress) {
  constexpr double kBlack[3] = {0, 0, 0};
  TrainingMeasure mean;
  mean.anchors = at.anchors;
  mean.objects = objects.size();
  for (const size_t object : objects) {
    if (progress != nullptr) progress->throwIfCancelled();
    const std::vector<float> latent =
        networks.encode(values, *collection_.object(object), at.tokens);
    const SplatCloud cloud = networks.decode(values, latent, at.anchors, at.seed);
    PictureStore pictures(collection_.views(object), 0);
    std::vector<size_t> all(pictures.views().count());
    std::iota(all.begin(), all.end(), size_t{0});
    const FitMeasure seen = views_.measure(cloud, pictures, all, kBlack);
    mean.psnr += seen.psnr / static_cast<double>(objects.size());
    mean.ssim += seen.ssim / static_cast<double>(objects.size());
  }
  return mean;
}

}  // namespace stipple
