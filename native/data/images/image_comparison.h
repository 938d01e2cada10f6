#pragma once

#include <cstddef>

#include "data/images/image.h"

namespace stipple {

struct ImageComparison {
  double psnr = 0;  ///< dB over the channels that show, peak 1; +infinity where equal
  double ssim = 0;  ///< mean over pixels and colour channels
  double max_error = 0;
  double mean_error = 0;
};

/// Changes a pixel of scene linear light, premultiplied, to display values: its colour is divided by
/// alpha for the transfer function and multiplied by it again. channels: 4 with alpha, else colours.
void toDisplay(double* pixel, size_t channels);

/// Compares in display space, premultiplied. Alpha counts where either image is transparent
/// somewhere: that two opaque images are opaque makes them no more alike. SSIM: 11x11 Gaussian
/// window of sigma 1.5, K1 = 0.01, K2 = 0.03, the window renormalised at the borders; alpha is left
/// out of SSIM.
/// Errors: kInvalidArgument for different sizes or channel counts, non-finite values.
/// Source: Wang, Bovik, Sheikh, Simoncelli, Image Quality Assessment: From Error Visibility to
/// Structural Similarity, IEEE TIP 2004.
ImageComparison compare(const Image& a, const Image& b);

}  // namespace stipple
