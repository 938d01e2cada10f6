#include "fit/image_matching.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "train/optimiser/weight_optimiser.h"

namespace stipple {

namespace {

constexpr uint64_t kSteps = 60;
constexpr double kRate = 0.02;  ///< of numbers whose deviation is about 1
constexpr double kSsim = 0.2;   ///< of 1 - SSIM, beside L1, as networks learn
/// Of half the mean square of what the latent moves by: it stays near what the flow made, for which
/// splats are known to look well from all sides.
constexpr double kStay = 0.1;

WeightOptimiserOptions optimiserOptions() {
  WeightOptimiserOptions options;
  options.learning_rate = kRate;
  options.warm_up = 0;
  options.total_steps = kSteps;
  options.least_share = 0.1;
  return options;
}

ObjectView viewOf(const PreparedImage& image, const Camera& camera) {
  ObjectView view;
  view.camera = camera;
  const double zoom = static_cast<double>(image.size) / camera.width;
  view.camera.fx *= zoom;
  view.camera.fy *= zoom;
  view.camera.cx *= zoom;
  view.camera.cy *= zoom;
  view.camera.width = view.camera.height = image.size;
  constexpr float kWhole = 255;
  for (const uint8_t value : image.rgb) view.image.push_back(static_cast<float>(value) / kWhole);
  for (const uint8_t value : image.alpha) view.alpha.push_back(static_cast<float>(value) / kWhole);
  return view;
}

}  // namespace

double matchingOperations(const DensityAutoencoder& networks, uint64_t anchors) {
  double of_splats = 0, of_density = 0;
  for (const Parameter& parameter : networks.layout().parameters()) {
    const auto weights = static_cast<double>(parameter.count);
    if (parameter.name.starts_with("gs.")) of_splats += weights;
    if (parameter.name.starts_with("octree.")) of_density += weights;
  }
  // A multiplication and an addition for each weight and row. Anchors are drawn once; blocks of
  // splats are run again on the way back, which takes twice as many.
  constexpr double kRuns = 4;
  double cells = 0;
  for (int level = 0; level < networks.sizes().leaf_level; ++level) {
    cells += std::min(std::exp2(3 * level), static_cast<double>(anchors));
  }
  return static_cast<double>(kSteps) * 2 *
         (kRuns * static_cast<double>(anchors) * of_splats + cells * of_density);
}

uint64_t matchingBytes(const DensityAutoencoder& networks, uint64_t anchors, uint32_t side) {
  const AutoencoderSizes& sizes = networks.sizes();
  const uint64_t width = sizes.heads * sizes.head_width;
  // Weights as they are read, as they are used, and derivatives; what an anchor leaves in each
  // block, and inside of one; pixels of the image, drawn and on the way back.
  const uint64_t rows = sizes.splat_blocks + 4 * (sizes.mlp_ratio + 4);
  constexpr uint64_t kPixelNumbers = 64;
  return sizeof(float) * (3 * networks.layout().size() + anchors * width * rows +
                          uint64_t{side} * side * kPixelNumbers);
}

void matchColours(const DensityAutoencoder& networks, std::span<const float> values,
                  uint64_t anchors, const BackendFactory& backends, const PreparedImage& image,
                  const Camera& camera, Latent& latent, Progress* progress, ProgressShare share) {
  const ObjectView view = viewOf(image, camera);
  const std::vector<float> start = latent.tokens;
  const auto count = static_cast<double>(start.size());
  WeightOptimiser optimiser(optimiserOptions(), start);
  std::vector<float> gradient(start.size());
  for (uint64_t step = 0; step < kSteps; ++step) {
    share.tell(progress, static_cast<double>(step) / static_cast<double>(kSteps),
               "Matching the colours");
    for (size_t i = 0; i < gradient.size(); ++i) {
      gradient[i] =
          static_cast<float>(kStay / count * static_cast<double>(latent.tokens[i] - start[i]));
    }
    networks.addColours(values, latent.tokens, view, {.anchors = anchors, .seed = step}, kSsim,
                        backends, gradient);
    optimiser.step(gradient, latent.tokens);
  }
}

}  // namespace stipple
