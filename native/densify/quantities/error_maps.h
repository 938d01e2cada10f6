#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace stipple {

/// How wrong a picture is, pixel by pixel; means over the colour channels.
struct ErrorMaps {
  std::vector<float> dissimilarity;  ///< [H,W] 1 - SSIM, 0..2
  std::vector<float> difference;     ///< [H,W] absolute
};

/// In: picture, target [H,W,3]. SSIM as in the loss of a fit: 11x11 Gaussian window of sigma 1.5,
/// K1 = 0.01, K2 = 0.03, range 1, zeros outside the picture.
/// Source: Wang, Bovik, Sheikh, Simoncelli, Image Quality Assessment: From Error Visibility to
/// Structural Similarity, IEEE TIP 2004.
ErrorMaps errorMaps(uint32_t width, uint32_t height, std::span<const float> picture,
                    std::span<const float> target);

}  // namespace stipple
