// Based on: the resampling of Pillow, whose bytes images for networks are made of; formulas only.

#include "generate/byte_resize.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "base/parallel.h"

namespace stipple {

namespace {

/// Bits behind the point of a weight: with 8 of a pixel, and 2 for sums beyond 255, 32 in all.
constexpr int kWeightBits = 22;
constexpr double kLobes = 3.0;

double sinc(double t) {
  if (t == 0.0) return 1.0;
  const double angle = std::numbers::pi * t;
  return std::sin(angle) / angle;
}

double lanczos(double t) {
  return t >= -kLobes && t < kLobes ? sinc(t) * sinc(t / kLobes) : 0.0;
}

/// What an output of a pass is the sum of: inputs first, first + 1, … with whole weights.
struct Tap {
  size_t first = 0;
  std::vector<int32_t> weights;
};

std::vector<Tap> taps(uint32_t inputs, uint32_t outputs) {
  const double scale = static_cast<double>(inputs) / outputs;
  const double widening = std::max(scale, 1.0);
  const double support = kLobes * widening;
  const double narrowing = 1.0 / widening;
  std::vector<Tap> all(outputs);
  std::vector<double> weights;
  for (uint32_t i = 0; i < outputs; ++i) {
    const double centre = (i + 0.5) * scale;
    const auto first = std::max(int64_t{0}, static_cast<int64_t>(centre - support + 0.5));
    const auto last =
        std::min(static_cast<int64_t>(inputs), static_cast<int64_t>(centre + support + 0.5));
    weights.clear();
    double sum = 0.0;
    for (int64_t x = first; x < last; ++x) {
      weights.push_back(lanczos((static_cast<double>(x) - centre + 0.5) * narrowing));
      sum += weights.back();
    }
    all[i].first = static_cast<size_t>(first);
    for (double weight : weights) {
      if (sum != 0.0) weight /= sum;
      const double scaled = weight * (1 << kWeightBits);
      all[i].weights.push_back(static_cast<int32_t>(scaled < 0.0 ? scaled - 0.5 : scaled + 0.5));
    }
  }
  return all;
}

uint8_t rounded(int32_t sum) {
  return static_cast<uint8_t>(std::clamp(sum >> kWeightBits, 0, 255));
}

constexpr int32_t kHalf = 1 << (kWeightBits - 1);

ByteImage resizeRows(const ByteImage& image, uint32_t width) {
  ByteImage out = {width, image.height, image.channels, {}};
  out.pixels.resize(out.pixelCount() * out.channels);
  const std::vector<Tap> columns = taps(image.width, width);
  const size_t channels = image.channels;
  parallelFor(image.height, 8, [&](size_t begin, size_t end) {
    for (size_t y = begin; y < end; ++y) {
      const uint8_t* row = image.pixels.data() + y * image.width * channels;
      uint8_t* to = out.pixels.data() + y * width * channels;
      for (const Tap& tap : columns) {
        for (size_t c = 0; c < channels; ++c) {
          const uint8_t* from = row + tap.first * channels + c;
          int32_t sum = kHalf;
          for (size_t k = 0; k < tap.weights.size(); ++k)
            sum += tap.weights[k] * from[k * channels];
          *to++ = rounded(sum);
        }
      }
    }
  });
  return out;
}

ByteImage resizeColumns(const ByteImage& image, uint32_t height) {
  ByteImage out = {image.width, height, image.channels, {}};
  out.pixels.resize(out.pixelCount() * out.channels);
  const std::vector<Tap> rows = taps(image.height, height);
  const size_t stride = static_cast<size_t>(image.width) * image.channels;
  parallelFor(height, 8, [&](size_t begin, size_t end) {
    std::vector<int32_t> sums(stride);
    for (size_t y = begin; y < end; ++y) {
      std::fill(sums.begin(), sums.end(), kHalf);
      for (size_t k = 0; k < rows[y].weights.size(); ++k) {
        const uint8_t* from = image.pixels.data() + (rows[y].first + k) * stride;
        const int32_t weight = rows[y].weights[k];
        for (size_t i = 0; i < stride; ++i) sums[i] += weight * from[i];
      }
      uint8_t* to = out.pixels.data() + y * stride;
      for (size_t i = 0; i < stride; ++i) to[i] = rounded(sums[i]);
    }
  });
  return out;
}

/// value * alpha / 255, rounded.
uint8_t scaledBy(uint8_t value, uint8_t alpha) {
  const uint32_t product = uint32_t{value} * alpha + 128;
  return static_cast<uint8_t>(((product >> 8) + product) >> 8);
}

void premultiply(ByteImage& image) {
  for (size_t i = 0; i < image.pixels.size(); i += 4) {
    for (size_t c = 0; c < 3; ++c) {
      image.pixels[i + c] = scaledBy(image.pixels[i + c], image.pixels[i + 3]);
    }
  }
}

void unpremultiply(ByteImage& image) {
  for (size_t i = 0; i < image.pixels.size(); i += 4) {
    const uint32_t alpha = image.pixels[i + 3];
    if (alpha == 0 || alpha == 255) continue;
    for (size_t c = 0; c < 3; ++c) {
      image.pixels[i + c] =
          static_cast<uint8_t>(std::min(255u, 255u * image.pixels[i + c] / alpha));
    }
  }
}

}  // namespace

ByteImage resizeBytes(const ByteImage& image, uint32_t width, uint32_t height) {
  ByteImage out = image;
  if (image.width == width && image.height == height) return out;
  if (image.channels == 4) premultiply(out);
  if (out.width != width) out = resizeRows(out, width);
  if (out.height != height) out = resizeColumns(out, height);
  if (image.channels == 4) unpremultiply(out);
  return out;
}

}  // namespace stipple
