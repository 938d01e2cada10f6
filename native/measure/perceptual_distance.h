#pragma once

#include <cstdint>
#include <vector>

#include "data/images/image.h"
#include "data/weight_table.h"
#include "nn/convolution.h"
#include "nn/network_run.h"

namespace stipple {

/// LPIPS: how far two images are apart in the features of a network that has learned to see, which
/// is nearer to what people say than PSNR. AlexNet or VGG16, whichever the weights are of.
/// Source: Zhang, Isola, Efros, Shechtman, Wang, The Unreasonable Effectiveness of Deep Features as
/// a Perceptual Metric, CVPR 2018, version 0.1 of the weights.
class PerceptualDistance {
 public:
  /// In: weights, named as in the state of the authors' module ("net.slice1.0.weight",
  /// "lin0.model.1.weight"). Errors: kFormat for weights of another network.
  explicit PerceptualDistance(const WeightTable& weights);

  /// 0 where equal, about 0.7 at most; the mean over the image. Images are taken in display space,
  /// over black. Errors: kInvalidArgument for different sizes, or less than leastSide() along one;
  /// kFormat for weights that are no numbers; kCancelled. Same bits for any number of threads.
  double between(const NetworkRun& run, const Image& a, const Image& b) const;
  /// Pixels that an image needs along each side.
  uint32_t leastSide() const;
  /// Multiplications and additions of the convolutions for one image.
  double flops(size_t height, size_t width) const;
  /// Bytes that between() allocates at most.
  uint64_t memoryBound(uint64_t pixel_count) const;

 private:
  /// Convolutions, each followed by a ReLU, up to features that are compared.
  struct Stage {
    size_t pool = 0;  ///< side of the squares of which the largest value goes on first, 0: none
    std::vector<Convolution> convolutions;
    std::vector<float> channel_weights;
  };

  bool fits(size_t side) const;
  FeatureMap prepared(const Image& image) const;
  double stageDistance(const Stage& stage, const FeatureMap& a, const FeatureMap& b) const;

  std::vector<Stage> stages_;
  std::vector<float> shift_, scale_;  ///< [3] of channels in -1..1
};

}  // namespace stipple
