#include "data/images/image_comparison.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "math/colour.h"

namespace stipple {

namespace {

constexpr int kRadius = 5;
constexpr double kSigma = 1.5;
constexpr double kC1 = 0.01 * 0.01;
constexpr double kC2 = 0.03 * 0.03;

std::string sizeOf(const Image& image) {
  return std::to_string(image.width) + " x " + std::to_string(image.height) + " x " +
         std::to_string(image.channels);
}

std::array<double, 2 * kRadius + 1> gaussianWindow() {
  std::array<double, 2 * kRadius + 1> window;
  for (int i = -kRadius; i <= kRadius; ++i) {
    window[static_cast<size_t>(i + kRadius)] = std::exp(-0.5 * i * i / (kSigma * kSigma));
  }
  return window;
}

/// Display-space values; alpha (channel 3) has no transfer function.
std::vector<double> displayValues(const Image& image) {
  std::vector<double> values(image.pixels.begin(), image.pixels.end());
  if (image.transfer == Transfer::kSrgb) return values;
  const size_t channels = image.channels;
  parallelFor(image.pixelCount(), 1 << 14, [&](size_t begin, size_t end) {
    for (size_t p = begin; p < end; ++p) {
      double* pixel = &values[p * channels];
      const double alpha = channels == 4 ? pixel[3] : 1.0;
      for (size_t c = 0; c < std::min<size_t>(channels, 3); ++c) {
        // Premultiplied colour is un-premultiplied for the transfer and premultiplied again.
        pixel[c] = alpha > 0 ? linearToSrgb(pixel[c] / alpha) * alpha : linearToSrgb(pixel[c]);
      }
    }
  });
  return values;
}

/// The plane blurred with the window along one axis, renormalised where it leaves the picture.
std::vector<double> blurred(const std::vector<double>& plane, size_t width, size_t height,
                            bool along_x) {
  static const auto window = gaussianWindow();
  std::vector<double> out(plane.size());
  const int limit = static_cast<int>(along_x ? width : height);
  const size_t stride = along_x ? 1 : width;
  parallelFor(height, 16, [&](size_t begin, size_t end) {
    for (size_t y = begin; y < end; ++y) {
      for (size_t x = 0; x < width; ++x) {
        const int centre = static_cast<int>(along_x ? x : y);
        const int first = std::max(-kRadius, -centre);
        const int last = std::min(kRadius, limit - 1 - centre);
        double sum = 0, weight = 0;
        for (int k = first; k <= last; ++k) {
          const double w = window[static_cast<size_t>(k + kRadius)];
          const size_t index = y * width + x + static_cast<size_t>(k) * stride;
          sum += w * plane[index];
          weight += w;
        }
        out[y * width + x] = sum / weight;
      }
    }
  });
  return out;
}

double ssimOfChannel(const std::vector<double>& a, const std::vector<double>& b, size_t width,
                     size_t height, size_t channels, size_t channel) {
  const size_t count = width * height;
  std::vector<double> x(count), y(count), xx(count), yy(count), xy(count);
  for (size_t i = 0; i < count; ++i) {
    x[i] = a[i * channels + channel];
    y[i] = b[i * channels + channel];
    xx[i] = x[i] * x[i];
    yy[i] = y[i] * y[i];
    xy[i] = x[i] * y[i];
  }
  for (auto* plane : {&x, &y, &xx, &yy, &xy}) {
    *plane = blurred(blurred(*plane, width, height, true), width, height, false);
  }
  double sum = 0;
  for (size_t i = 0; i < count; ++i) {
    const double variance_x = xx[i] - x[i] * x[i];
    const double variance_y = yy[i] - y[i] * y[i];
    const double covariance = xy[i] - x[i] * y[i];
    sum += (2 * x[i] * y[i] + kC1) * (2 * covariance + kC2) /
           ((x[i] * x[i] + y[i] * y[i] + kC1) * (variance_x + variance_y + kC2));
  }
  return sum / static_cast<double>(count);
}

}  // namespace

ImageComparison compare(const Image& a, const Image& b) {
  if (a.width != b.width || a.height != b.height || a.channels != b.channels) {
    fail(ErrorCode::kInvalidArgument, "the images differ in size: " + sizeOf(a) + " and " +
                                          sizeOf(b) +
                                          "; they must have the same width, height "
                                          "and channels");
  }
  if (a.pixels.empty()) fail(ErrorCode::kInvalidArgument, "the images have no pixels");
  requireFinite(a.pixels.data(), a.pixels.size(), a.channels, "first image: pixel");
  requireFinite(b.pixels.data(), b.pixels.size(), b.channels, "second image: pixel");
  const std::vector<double> x = displayValues(a);
  const std::vector<double> y = displayValues(b);
  ImageComparison result;
  double squares = 0, sum = 0;
  for (size_t i = 0; i < x.size(); ++i) {
    const double error = std::abs(x[i] - y[i]);
    result.max_error = std::max(result.max_error, error);
    sum += error;
    squares += error * error;
  }
  const double count = static_cast<double>(x.size());
  result.mean_error = sum / count;
  result.psnr =
      squares > 0 ? -10.0 * std::log10(squares / count) : std::numeric_limits<double>::infinity();
  const size_t colours = std::min<size_t>(a.channels, 3);
  for (size_t c = 0; c < colours; ++c) {
    result.ssim +=
        ssimOfChannel(x, y, a.width, a.height, a.channels, c) / static_cast<double>(colours);
  }
  return result;
}

}  // namespace stipple
