#include "splat/render/accurate_render.h"

#include <algorithm>
#include <array>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "math/empty_depth.h"
#include "splat/cpu/rays/ray_tiles.h"
#include "splat/render/surface.h"

namespace stipple {

namespace {

constexpr size_t kRowGrain = 4;
/// Fainter ones, ten thousand at a pixel, change nothing in single precision.
constexpr double kLeastTiledAlpha = 1e-12;

void requireSamples(const RenderAccuracy& accuracy, const Camera& camera) {
  const uint64_t n = accuracy.samples_per_side;
  if (n < 1 || n > kMaxSamplesPerSide) {
    fail(ErrorCode::kInvalidArgument,
         "samples_per_side is " + std::to_string(n) + "; 1 to 16 is allowed");
  }
  const uint64_t side = std::max(camera.width, camera.height);
  if (side * n > 65536) {
    fail(ErrorCode::kInvalidArgument, "samples_per_side is " + std::to_string(n) +
                                          ", which makes an image of " + std::to_string(side) +
                                          " pixels " + std::to_string(side * n) +
                                          " samples wide; at most 65536 is allowed");
  }
}

/// A surface layer with every pixel as n x n.
struct EnlargedSurface {
  std::vector<float> depth, colour, matte_opacity;

  SurfaceLayer of(const SurfaceLayer& layer, uint32_t n) {
    SurfaceLayer out = layer;
    out.width = layer.width * n;
    out.height = layer.height * n;
    out.depth = spread(layer.depth, 1, layer, n, depth);
    out.colour = spread(layer.colour, 4, layer, n, colour);
    out.matte_opacity = spread(layer.matte_opacity, 1, layer, n, matte_opacity);
    return out;
  }

 private:
  static const float* spread(const float* from, size_t channels, const SurfaceLayer& layer,
                             uint32_t n, std::vector<float>& to) {
    if (!from) return nullptr;
    const size_t width = layer.width, row = width * n * channels;
    to.resize(row * layer.height * n);
    parallelFor(layer.height, kRowGrain, [&](size_t begin, size_t end) {
      for (size_t y = begin; y < end; ++y) {
        float* first = &to[y * n * row];
        for (size_t x = 0; x < width * n; ++x) {
          std::copy_n(from + (y * width + x / n) * channels, channels, first + x * channels);
        }
        for (size_t k = 1; k < n; ++k) std::copy_n(first, row, first + k * row);
      }
    });
    return to.data();
  }
};

/// The n x n values of a square, gathered from a large picture of one channel.
template <typename T>
void gather(const std::vector<T>& large, size_t large_width, size_t n, size_t x, size_t y,
            std::vector<T>& square) {
  for (size_t row = 0; row < n; ++row) {
    std::copy_n(&large[(y * n + row) * large_width + x * n], n, &square[row * n]);
  }
}

/// Squares of a large picture to the pixels of a small one.
class Averaging {
 public:
  Averaging(const RenderResult& large, uint32_t n, const Camera& camera, RenderResult& out)
      : large_(large), n_(n), width_(camera.width), out_(out) {
    out.width = camera.width;
    out.height = camera.height;
    out.visible_count = large.visible_count;
    const size_t count = static_cast<size_t>(camera.width) * camera.height;
    out.colour.resize(count * 4);
    out.depth.resize(large.depth.empty() ? 0 : count);
    out.median_depth.resize(large.median_depth.empty() ? 0 : count);
    out.counts.resize(large.counts.empty() ? 0 : count);
    out.surface_weight.resize(large.surface_weight.empty() ? 0 : count);
    out.transmittance.resize(large.transmittance.empty() ? 0 : count);
    out.normal.resize(large.normal.empty() ? 0 : count * 3);
    out.objects.resize(large.objects.empty() ? 0 : count);
  }

  void run() {
    parallelFor(out_.height, kRowGrain, [&](size_t begin, size_t end) {
      Squares squares(n_ * n_);
      for (size_t y = begin; y < end; ++y) {
        for (size_t x = 0; x < width_; ++x) pixel(x, y, squares);
      }
    });
  }

 private:
  struct Squares {
    explicit Squares(size_t count) : numbers(count), counts(count) {}
    std::vector<float> numbers;
    std::vector<uint32_t> counts;
  };

  void pixel(size_t x, size_t y, Squares& squares) {
    const size_t out = y * width_ + x;
    double sums[4] = {0, 0, 0, 0}, depth = 0, covered = 0;
    for (size_t row = 0; row < n_; ++row) {
      for (size_t column = 0; column < n_; ++column) {
        const size_t i = (y * n_ + row) * width_ * n_ + x * n_ + column;
        for (size_t c = 0; c < 4; ++c) sums[c] += static_cast<double>(large_.colour[i * 4 + c]);
        if (large_.depth.empty() || !(large_.depth[i] < kEmptyDepth)) continue;
        // A surface without alpha of its own still has a depth.
        const double weight = std::max(static_cast<double>(large_.colour[i * 4 + 3]), 1e-12);
        depth += weight * static_cast<double>(large_.depth[i]);
        covered += weight;
      }
    }
    const double share = 1.0 / static_cast<double>(n_ * n_);
    for (size_t c = 0; c < 4; ++c) out_.colour[out * 4 + c] = static_cast<float>(sums[c] * share);
    if (!out_.depth.empty()) {
      out_.depth[out] = covered > 0 ? static_cast<float>(depth / covered) : kEmptyDepth;
    }
    if (!out_.median_depth.empty()) {
      gather(large_.median_depth, width_ * n_, n_, x, y, squares.numbers);
      const auto middle = squares.numbers.begin() + static_cast<ptrdiff_t>((n_ * n_ - 1) / 2);
      std::nth_element(squares.numbers.begin(), middle, squares.numbers.end());
      out_.median_depth[out] = *middle;
    }
    if (!out_.counts.empty()) {
      gather(large_.counts, width_ * n_, n_, x, y, squares.counts);
      out_.counts[out] = *std::max_element(squares.counts.begin(), squares.counts.end());
    }
    passes(x, y);
    average(large_.surface_weight, out_.surface_weight, x, y, squares);
    average(large_.transmittance, out_.transmittance, x, y, squares);
  }

  void passes(size_t x, size_t y) {
    const size_t out = y * width_ + x, row = width_ * n_;
    if (!out_.objects.empty()) {
      out_.objects[out] = large_.objects[(y * n_ + n_ / 2) * row + x * n_ + n_ / 2];
    }
    if (out_.normal.empty()) return;
    Vec3d sum = Vec3d::Zero();
    for (size_t i = 0; i < n_ * n_; ++i) {
      const float* normal = &large_.normal[((y * n_ + i / n_) * row + x * n_ + i % n_) * 3];
      sum += Vec3f(normal[0], normal[1], normal[2]).cast<double>();
    }
    const double length = sum.norm();
    for (size_t k = 0; k < 3; ++k) {
      out_.normal[out * 3 + k] =
          length > 0 ? static_cast<float>(sum[static_cast<Eigen::Index>(k)] / length) : 0.0f;
    }
  }

  void average(const std::vector<float>& from, std::vector<float>& to, size_t x, size_t y,
               Squares& squares) const {
    if (to.empty()) return;
    gather(from, width_ * n_, n_, x, y, squares.numbers);
    double sum = 0;
    for (const float value : squares.numbers) sum += static_cast<double>(value);
    to[y * width_ + x] = static_cast<float>(sum / static_cast<double>(n_ * n_));
  }

  const RenderResult& large_;
  size_t n_, width_;
  RenderResult& out_;
};

}  // namespace

bool isTiled(const RenderAccuracy& accuracy) {
  const BlendLimits usual;
  return accuracy.order == RayOrder::kCentre && accuracy.projection == RayProjection::kAffine &&
         accuracy.precision == Precision::kFloat &&
         accuracy.limits.most_alpha == usual.most_alpha && accuracy.limits.ends_early;
}

bool isSlow(const RenderAccuracy& accuracy, const Camera& camera) {
  return accuracy.samples_per_side == 1 &&
         (accuracy.precision == Precision::kDouble || !hasImagePlane(camera));
}

RayOptions rayOptions(const RenderAccuracy& accuracy) {
  RayOptions rays;
  rays.order = accuracy.order;
  rays.projection = accuracy.projection;
  rays.limits = accuracy.limits;
  return rays;
}

void renderAccurate(std::span<const SplatInstance> instances, const Camera& camera,
                    const RenderOptions& options, const RenderAccuracy& accuracy,
                    RenderWorkspace& workspace, RenderResult& result, Progress* progress) {
  validate(camera);
  requireSamples(accuracy, camera);
  const uint32_t n = accuracy.samples_per_side;
  if (n > 1) {
    RenderAccuracy single = accuracy;
    single.samples_per_side = 1;
    RenderOptions large_options = options;
    EnlargedSurface surface;
    if (hasSurface(options)) {
      validateSurface(options.surface, camera);
      large_options.surface = surface.of(options.surface, n);
    }
    RenderResult large;
    renderAccurate(instances, enlarged(camera, n), large_options, single, workspace, large,
                   progress);
    Averaging(large, n, camera, result).run();
  } else if (isTiled(accuracy)) {
    RenderOptions tiled_options = options;
    tiled_options.least_alpha = std::max(accuracy.limits.least_alpha, kLeastTiledAlpha);
    renderTiled(instances, camera, tiled_options, workspace, result, progress);
  } else if (accuracy.precision == Precision::kFloat && hasImagePlane(camera)) {
    result = renderRayTiles(instances, camera, options, rayOptions(accuracy), progress);
  } else {
    result = renderRays(instances, camera, options, rayOptions(accuracy), progress);
  }
}

RenderMemory accurateMemory(std::span<const SplatInstance> instances, const Camera& camera,
                            const RenderOptions& options, const RenderAccuracy& accuracy) {
  validate(camera);
  requireSamples(accuracy, camera);
  const uint32_t n = accuracy.samples_per_side;
  const Camera large = n > 1 ? enlarged(camera, n) : camera;
  RenderMemory memory = isTiled(accuracy) ? renderMemory(instances, large, options)
                        : accuracy.precision == Precision::kFloat && hasImagePlane(camera)
                            ? rayTileMemory(instances, large, options, rayOptions(accuracy))
                            : rayMemory(instances, large, options);
  if (n > 1) {
    memory.result_bytes += renderMemory({}, camera, options).result_bytes;
    const uint64_t pixels = static_cast<uint64_t>(large.width) * large.height;
    const SurfaceLayer& surface = options.surface;
    memory.other_bytes += pixels * sizeof(float) *
                          ((surface.depth ? 1u : 0u) + (surface.colour ? 4u : 0u) +
                           (surface.matte_opacity ? 1u : 0u));
  }
  return memory;
}

}  // namespace stipple
