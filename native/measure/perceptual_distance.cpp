#include "measure/perceptual_distance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "data/images/image_comparison.h"

namespace stipple {

namespace {

constexpr float kLeastNorm = 1e-10f;  ///< added to the norm of a pixel's features
constexpr size_t kPoolStride = 2;
constexpr size_t kRowGrain = 4;

/// A convolution of the published networks: its number in the module, its channels and its grid.
struct Layer {
  int number;
  uint64_t inputs, outputs;
  ConvolutionGrid grid;
};
struct Plan {
  size_t pool;
  std::vector<Layer> layers;
};

constexpr ConvolutionGrid kSame = {3, 1, 1, 1};

/// Source: Krizhevsky, One weird trick for parallelizing convolutional neural networks, 2014.
const std::array<Plan, 5>& alexNet() {
  static const std::array<Plan, 5> plan = {{{0, {{0, 3, 64, {11, 4, 2, 2}}}},
                                            {3, {{3, 64, 192, {5, 1, 2, 2}}}},
                                            {3, {{6, 192, 384, kSame}}},
                                            {0, {{8, 384, 256, kSame}}},
                                            {0, {{10, 256, 256, kSame}}}}};
  return plan;
}

/// Source: Simonyan and Zisserman, Very Deep Convolutional Networks for Large-Scale Image
/// Recognition, ICLR 2015 (16 layers).
const std::array<Plan, 5>& vgg16() {
  static const std::array<Plan, 5> plan = {
      {{0, {{0, 3, 64, kSame}, {2, 64, 64, kSame}}},
       {2, {{5, 64, 128, kSame}, {7, 128, 128, kSame}}},
       {2, {{10, 128, 256, kSame}, {12, 256, 256, kSame}, {14, 256, 256, kSame}}},
       {2, {{17, 256, 512, kSame}, {19, 512, 512, kSame}, {21, 512, 512, kSame}}},
       {2, {{24, 512, 512, kSame}, {26, 512, 512, kSame}, {28, 512, 512, kSame}}}}};
  return plan;
}

size_t pooledSize(size_t size, size_t pool) {
  return size < pool ? 0 : (size - pool) / kPoolStride + 1;
}

/// The largest value of each channel in squares of `pool` pixels, every second one.
FeatureMap pooled(const FeatureMap& in, size_t pool) {
  FeatureMap out =
      FeatureMap::ofSize(pooledSize(in.height, pool), pooledSize(in.width, pool), in.channels);
  parallelFor(out.height, kRowGrain, [&](size_t begin, size_t end) {
    for (size_t y = begin; y < end; ++y) {
      for (size_t x = 0; x < out.width; ++x) {
        float* to = &out.values[(y * out.width + x) * out.channels];
        for (size_t dy = 0; dy < pool; ++dy) {
          for (size_t dx = 0; dx < pool; ++dx) {
            const float* from =
                &in.values[((y * kPoolStride + dy) * in.width + x * kPoolStride + dx) *
                           in.channels];
            for (size_t c = 0; c < in.channels; ++c) {
              to[c] = dy + dx == 0 ? from[c] : std::max(to[c], from[c]);
            }
          }
        }
      }
    }
  });
  return out;
}

void rectify(FeatureMap& map) {
  parallelFor(map.values.size(), size_t{1} << 16, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) map.values[i] = std::max(0.0f, map.values[i]);
  });
}

float normOf(const float* features, size_t count) {
  double sum = 0;
  for (size_t c = 0; c < count; ++c) {
    sum += static_cast<double>(features[c]) * static_cast<double>(features[c]);
  }
  return static_cast<float>(std::sqrt(sum)) + kLeastNorm;
}

std::vector<float> threeOf(const WeightTable& weights, const std::string& name,
                           std::vector<float> published) {
  return weights.has(name) ? weights.floats(name, {1, 3, 1, 1}) : std::move(published);
}

}  // namespace

PerceptualDistance::PerceptualDistance(const WeightTable& weights)
    : shift_(threeOf(weights, "scaling_layer.shift", {-0.030f, -0.088f, -0.188f})),
      scale_(threeOf(weights, "scaling_layer.scale", {0.458f, 0.448f, 0.450f})) {
  for (const float value : scale_) {
    if (value > 0) continue;
    fail(ErrorCode::kFormat, weights.source() + ": scaling_layer.scale holds " +
                                 std::to_string(value) + "; numbers above 0 are allowed");
  }
  // VGG16 has a second convolution in its first stage.
  const auto& plans = weights.has("net.slice1.2.weight") ? vgg16() : alexNet();
  for (size_t s = 0; s < plans.size(); ++s) {
    Stage stage;
    stage.pool = plans[s].pool;
    uint64_t channels = 0;
    for (const Layer& layer : plans[s].layers) {
      const std::string name =
          "net.slice" + std::to_string(s + 1) + "." + std::to_string(layer.number);
      stage.convolutions.emplace_back(weights, name, layer.inputs, layer.outputs, layer.grid);
      channels = layer.outputs;
    }
    stage.channel_weights =
        weights.floats("lin" + std::to_string(s) + ".model.1.weight", {1, channels, 1, 1});
    stages_.push_back(std::move(stage));
  }
}

bool PerceptualDistance::fits(size_t side) const {
  for (const Stage& stage : stages_) {
    if (stage.pool > 0) side = pooledSize(side, stage.pool);
    for (const Convolution& convolution : stage.convolutions) side = convolution.outputSide(side);
    if (side == 0) return false;
  }
  return true;
}

double PerceptualDistance::flops(size_t height, size_t width) const {
  double sum = 0;
  for (const Stage& stage : stages_) {
    if (stage.pool > 0) {
      height = pooledSize(height, stage.pool);
      width = pooledSize(width, stage.pool);
    }
    for (const Convolution& convolution : stage.convolutions) {
      sum += convolution.flops(height, width);
      height = convolution.outputSide(height);
      width = convolution.outputSide(width);
    }
  }
  return sum;
}

uint32_t PerceptualDistance::leastSide() const {
  uint32_t side = 1;
  while (!fits(side)) ++side;
  return side;
}

uint64_t PerceptualDistance::memoryBound(uint64_t pixel_count) const {
  // Features of one image and, while those of the other are made, what goes in and what comes out:
  // the first stage has the largest maps. Convolutions take packed weights and tiles.
  const uint64_t channels = stages_.front().channel_weights.size();
  const uint64_t stride = stages_.front().convolutions.front().stride();
  return 3 * channels * sizeof(float) * pixel_count / (stride * stride) +
         2 * 3 * sizeof(float) * pixel_count + (uint64_t{64} << 20);
}

/// Display values over black in the range that the network has learned with.
FeatureMap PerceptualDistance::prepared(const Image& image) const {
  FeatureMap map = FeatureMap::ofSize(image.height, image.width, 3);
  const size_t channels = image.channels;
  parallelFor(map.pixelCount(), size_t{1} << 14, [&](size_t begin, size_t end) {
    std::array<double, 4> pixel = {};
    for (size_t i = begin; i < end; ++i) {
      for (size_t c = 0; c < channels; ++c) {
        pixel[c] = static_cast<double>(image.pixels[i * channels + c]);
      }
      if (image.transfer == Transfer::kLinear) toDisplay(pixel.data(), channels);
      for (size_t c = 0; c < 3; ++c) {
        const double value = 2 * std::clamp(pixel[channels < 3 ? 0 : c], 0.0, 1.0) - 1;
        map.values[i * 3 + c] = static_cast<float>((value - static_cast<double>(shift_[c])) /
                                                   static_cast<double>(scale_[c]));
      }
    }
  });
  return map;
}

double PerceptualDistance::stageDistance(const Stage& stage, const FeatureMap& a,
                                         const FeatureMap& b) const {
  std::vector<double> rows(a.height, 0.0);
  parallelFor(a.height, kRowGrain, [&](size_t begin, size_t end) {
    for (size_t y = begin; y < end; ++y) {
      for (size_t x = 0; x < a.width; ++x) {
        const float* f = &a.values[(y * a.width + x) * a.channels];
        const float* g = &b.values[(y * a.width + x) * a.channels];
        const float of_f = normOf(f, a.channels), of_g = normOf(g, a.channels);
        for (size_t c = 0; c < a.channels; ++c) {
          const auto apart = static_cast<double>(f[c] / of_f - g[c] / of_g);
          rows[y] += static_cast<double>(stage.channel_weights[c]) * apart * apart;
        }
      }
    }
  });
  double sum = 0;
  for (const double row : rows) sum += row;
  return sum / static_cast<double>(a.pixelCount());
}

double PerceptualDistance::between(const NetworkRun& run, const Image& a, const Image& b) const {
  if (a.width != b.width || a.height != b.height) {
    fail(ErrorCode::kInvalidArgument,
         "the images have " + std::to_string(a.width) + " x " + std::to_string(a.height) + " and " +
             std::to_string(b.width) + " x " + std::to_string(b.height) +
             " pixels; equal sizes are needed");
  }
  if (!fits(std::min(a.width, a.height))) {
    fail(ErrorCode::kInvalidArgument, "the images have " + std::to_string(a.width) + " x " +
                                          std::to_string(a.height) + " pixels; LPIPS needs " +
                                          std::to_string(leastSide()) + " along each side");
  }
  requireFinite(a.pixels.data(), a.pixels.size(), a.channels, "first image: pixel");
  requireFinite(b.pixels.data(), b.pixels.size(), b.channels, "second image: pixel");
  std::array<FeatureMap, 2> maps = {prepared(a), prepared(b)};
  double sum = 0;
  for (size_t s = 0; s < stages_.size(); ++s) {
    const Stage& stage = stages_[s];
    for (FeatureMap& map : maps) {
      if (stage.pool > 0) map = pooled(map, stage.pool);
      for (const Convolution& convolution : stage.convolutions) {
        map = convolution.apply(run, map);
        rectify(map);
      }
    }
    sum += stageDistance(stage, maps[0], maps[1]);
    advance(run.progress, static_cast<double>(s + 1) / static_cast<double>(stages_.size()),
            "Comparing images");
  }
  return sum;
}

}  // namespace stipple
