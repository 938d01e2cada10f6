#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <random>
#include <vector>

namespace stipple::testing {

/// A planar double picture, [3,H,W].
struct Planes {
  size_t width, height;
  std::vector<double> values;

  Planes(size_t w, size_t h, double fill = 0) : width(w), height(h), values(3 * w * h, fill) {}
  double& at(size_t c, size_t row, size_t column) {
    return values[(c * height + row) * width + column];
  }
  double at(size_t c, size_t row, size_t column) const {
    return values[(c * height + row) * width + column];
  }
  std::vector<float> planar() const { return {values.begin(), values.end()}; }
  /// [H,W,channels]; alpha, where there is one, holds `alpha`.
  std::vector<float> interleaved(size_t channels, float alpha = 0.5f) const {
    std::vector<float> out(width * height * channels, alpha);
    for (size_t p = 0; p < width * height; ++p) {
      for (size_t c = 0; c < 3; ++c) {
        out[p * channels + c] = static_cast<float>(values[c * width * height + p]);
      }
    }
    return out;
  }
};

/// 1 - SSIM of one pixel and channel, from the textbook's formula over the 11 x 11 window, zeros
/// outside the picture.
inline double ssimErrorAt(const Planes& x, const Planes& y, size_t c, size_t row, size_t column) {
  double total = 0;
  double window[11];
  for (int k = 0; k < 11; ++k) total += window[k] = std::exp(-(k - 5) * (k - 5) / (2 * 1.5 * 1.5));
  double mx = 0, my = 0, xx = 0, yy = 0, xy = 0;
  for (int j = 0; j < 11; ++j) {
    for (int i = 0; i < 11; ++i) {
      const long r = static_cast<long>(row) + j - 5;
      const long q = static_cast<long>(column) + i - 5;
      if (r < 0 || q < 0 || r >= static_cast<long>(x.height) || q >= static_cast<long>(x.width)) {
        continue;
      }
      const double w = window[j] * window[i] / (total * total);
      const double a = x.at(c, static_cast<size_t>(r), static_cast<size_t>(q));
      const double b = y.at(c, static_cast<size_t>(r), static_cast<size_t>(q));
      mx += w * a;
      my += w * b;
      xx += w * a * a;
      yy += w * b * b;
      xy += w * a * b;
    }
  }
  const double c1 = 0.01 * 0.01, c2 = 0.03 * 0.03;
  return 1 - (2 * mx * my + c1) * (2 * (xy - mx * my) + c2) /
                 ((mx * mx + my * my + c1) * (xx - mx * mx + yy - my * my + c2));
}

struct ReferenceLoss {
  double loss, l1, ssim;
};

/// weights [H,W], or empty for 1.
inline double weightAt(const std::vector<float>& weights, size_t pixel) {
  return weights.empty() ? 1.0 : static_cast<double>(weights[pixel]);
}

inline double weightSum(const Planes& x, const std::vector<float>& weights) {
  double sum = 0;
  for (size_t p = 0; p < x.width * x.height; ++p) sum += weightAt(weights, p);
  return sum;
}

inline ReferenceLoss referenceLoss(const Planes& x, const Planes& y, double share,
                                   const std::vector<float>& weights = {}) {
  double error = 0, magnitude = 0;
  for (size_t c = 0; c < 3; ++c) {
    for (size_t row = 0; row < x.height; ++row) {
      for (size_t column = 0; column < x.width; ++column) {
        const double w = weightAt(weights, row * x.width + column);
        error += w * ssimErrorAt(x, y, c, row, column);
        magnitude += w * std::abs(x.at(c, row, column) - y.at(c, row, column));
      }
    }
  }
  const double unit = 1 / (3 * weightSum(x, weights));
  return {(1 - share) * magnitude * unit + share * error * unit, magnitude * unit,
          1 - error * unit};
}

/// Central difference of the double loss by one colour. The step of 1e-5 leaves an error of
/// (1e-5 / 0.03)^2 / 6 = 2e-8 (0.03 = sqrt(C2) is the scale on which SSIM bends) and a rounding of
/// 1e-16 / 1e-5. Only the 11 x 11 windows that see the pixel are evaluated.
inline double centralDifference(Planes x, const Planes& y, double share, size_t c, size_t row,
                                size_t column, const std::vector<float>& weights = {}) {
  const double step = 1e-5;
  const double centre = x.at(c, row, column);
  const auto value = [&](double colour) {
    x.at(c, row, column) = colour;
    double sum = (1 - share) * weightAt(weights, row * x.width + column) *
                 std::abs(colour - y.at(c, row, column));
    for (size_t r = row - std::min<size_t>(row, 5); r < std::min(x.height, row + 6); ++r) {
      for (size_t q = column - std::min<size_t>(column, 5); q < std::min(x.width, column + 6);
           ++q) {
        sum += share * weightAt(weights, r * x.width + q) * ssimErrorAt(x, y, c, r, q);
      }
    }
    return sum;
  };
  return (value(centre + step) - value(centre - step)) / (2 * step * 3 * weightSum(x, weights));
}

struct Pictures {
  Planes rendered, target;
};

/// Smooth waves with noise, 0..1 about; |rendered - target| is at least 1e-3, so that the kink of
/// L1 lies outside a central difference. All values are exact in float32.
inline Pictures randomPictures(size_t width, size_t height, double noise, unsigned seed) {
  std::mt19937 random(seed);
  const auto uniform = [&] { return static_cast<double>(random() >> 8) * 0x1p-24; };
  Pictures pictures = {Planes(width, height), Planes(width, height)};
  for (size_t c = 0; c < 3; ++c) {
    for (size_t row = 0; row < height; ++row) {
      for (size_t column = 0; column < width; ++column) {
        const double wave = 0.5 + 0.4 * std::sin(0.21 * static_cast<double>(column) +
                                                 0.13 * static_cast<double>(row * (c + 1)));
        const double y = wave + noise * (uniform() - 0.5);
        double d = noise * (uniform() - 0.5);
        d += d < 0 ? -1e-3 : 1e-3;
        pictures.target.at(c, row, column) = static_cast<double>(static_cast<float>(y));
        pictures.rendered.at(c, row, column) = static_cast<double>(static_cast<float>(y + d));
      }
    }
  }
  return pictures;
}

}  // namespace stipple::testing
