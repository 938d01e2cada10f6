#include "shot/mesh_layers.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "data/images/hole_fill.h"
#include "math/empty_depth.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 14;

/// Less than a rounding of alpha and transmittance is nothing.
constexpr float kRounding = 1e-5f;

template <typename Each>
void forPixels(size_t count, const Each& each) {
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) each(i);
  });
}

float finiteOr(float value, float otherwise) {
  return std::isfinite(value) ? value : otherwise;
}

float unit(float value) {
  return std::clamp(value, 0.0f, 1.0f);
}

/// A factor of light. What is not known, or endless, leaves it as it is.
float factor(float value) {
  if (std::isnan(value) || value == INFINITY) return 1.0f;
  return std::max(value, 0.0f);
}

/// What a shadow leaves of the light behind it, as Cycles' alpha of a picture has it.
float passedOf(const float* light) {
  return unit((light[0] + light[1] + light[2]) / 3.0f);
}

/// Alpha of meshes alone: that of the picture is 1 - (1 - a) s where a shadow lets s pass. Where s
/// is 0, all is black.
float alphaWithoutShadow(float alpha, float passed) {
  const float left = passed > 0.0f ? (1.0f - alpha) / passed : 1.0f - alpha;
  return unit(1.0f - left);
}

void requireSize(size_t seen, size_t expected, const char* what) {
  if (seen == expected) return;
  fail(ErrorCode::kInvalidArgument, std::string(what) + " has " + std::to_string(seen) +
                                        " values; " + std::to_string(expected) + " are needed");
}

}  // namespace

MeshLayers::MeshLayers(uint32_t width, uint32_t height, std::span<const float> combined,
                       std::span<const float> depth, std::span<const float> shadow)
    : width_(width), height_(height) {
  if (width < 1 || height < 1) {
    fail(ErrorCode::kInvalidArgument, "the layers are " + std::to_string(width) + " x " +
                                          std::to_string(height) +
                                          " pixels; sides of at least 1 are allowed");
  }
  const size_t count = pixelCount();
  requireSize(combined.size(), count * 4, "combined");
  requireSize(depth.size(), count, "depth");
  if (!shadow.empty()) requireSize(shadow.size(), count * 3, "shadow");
  depth_.resize(count);
  colour_.resize(count * 4);
  if (!shadow.empty()) {
    light_.resize(count * 3);
    passed_.resize(count);
  }
  forPixels(count, [&](size_t i) {
    depth_[i] = std::isnan(depth[i]) ? kEmptyDepth : depth[i];
    float* pixel = &colour_[i * 4];
    for (size_t c = 0; c < 4; ++c) pixel[c] = finiteOr(combined[i * 4 + c], 0.0f);
    pixel[3] = unit(pixel[3]);
    if (light_.empty()) return;
    float* light = &light_[i * 3];
    for (size_t c = 0; c < 3; ++c) light[c] = factor(shadow[i * 3 + c]);
    passed_[i] = passedOf(light);
    pixel[3] = alphaWithoutShadow(pixel[3], passed_[i]);
  });
}

void MeshLayers::holdOut(std::span<const float> depth, std::span<const float> opacity) {
  requireSize(depth.size(), pixelCount(), "the holdouts' depth");
  requireSize(opacity.size(), pixelCount(), "the holdouts' opacity");
  held_depth_.assign(depth.begin(), depth.end());
  held_opacity_.assign(opacity.begin(), opacity.end());
}

void MeshLayers::takeWorld(std::span<const float> seen,
                           const std::optional<std::vector<float>>& plain) {
  const size_t count = pixelCount();
  requireSize(seen.size(), count * 3, "the world");
  world_.resize(count * 3);
  forPixels(count * 3, [&](size_t i) { world_[i] = finiteOr(seen[i], 0.0f); });
  if (light_.empty()) return;
  // The pass leaves out what it would show behind a shadow catcher.
  const auto is_free = [&](size_t i) {
    return light_[i * 3] == 1.0f && light_[i * 3 + 1] == 1.0f && light_[i * 3 + 2] == 1.0f;
  };
  const auto is_empty = [&](size_t i) { return depth_[i] >= kEmptyDepth; };
  std::vector<float> spread;
  if (!plain) {
    std::vector<uint8_t> shows(count);
    forPixels(count, [&](size_t i) {
      shows[i] = is_free(i) && is_empty(i) && colour_[i * 4 + 3] == 0.0f ? 1 : 0;
    });
    spread = filledHoles(world_, shows, width_, height_);
  }
  forPixels(count, [&](size_t i) {
    if (is_free(i) && (is_empty(i) || colour_[i * 4 + 3] > 0.0f)) return;
    const float gap = 1.0f - hiddenAt(i);
    const float* behind = plain ? plain->data() : &spread[i * 3];
    for (size_t c = 0; c < 3; ++c) world_[i * 3 + c] = gap * behind[c];
  });
}

void MeshLayers::takeShadow(std::span<const float> shadow) {
  const size_t count = pixelCount();
  requireSize(shadow.size(), count * 3, "the shadow");
  if (!light_.empty()) {
    fail(ErrorCode::kInvalidArgument,
         "the layers have a shadow that is in their passes; another is allowed without it");
  }
  light_.resize(count * 3);
  passed_.resize(count);
  forPixels(count, [&](size_t i) {
    float* light = &light_[i * 3];
    for (size_t c = 0; c < 3; ++c) light[c] = factor(shadow[i * 3 + c]);
    passed_[i] = passedOf(light);
  });
}

void MeshLayers::lightBefore(std::span<const float> before, std::span<const float> whole) {
  const size_t count = pixelCount();
  requireSize(before.size(), count * 4, "the splats before the catchers");
  requireSize(whole.size(), count * 4, "all splats");
  if (light_.empty()) return;
  forPixels(count, [&](size_t i) {
    for (size_t c = 0; c < 3; ++c) {
      const float all = whole[i * 4 + c];
      // A pixel without splats has no share of either.
      const float share = all > 0.0f ? unit(before[i * 4 + c] / all) : 0.0f;
      float& light = light_[i * 3 + c];
      light = share + (1.0f - share) * light;
    }
  });
}

bool MeshLayers::hasShadows() const {
  return std::any_of(light_.begin(), light_.end(), [](float value) { return value != 1.0f; });
}

float MeshLayers::hiddenAt(size_t pixel) const {
  const float alpha = colour_[pixel * 4 + 3];
  return held_opacity_.empty() ? alpha : std::min(alpha + held_opacity_[pixel], 1.0f);
}

std::vector<float> MeshLayers::hidden() const {
  std::vector<float> values(pixelCount());
  forPixels(values.size(), [&](size_t i) { values[i] = hiddenAt(i); });
  return values;
}

std::vector<float> MeshLayers::surfaceDepth() const {
  std::vector<float> values(pixelCount());
  forPixels(values.size(), [&](size_t i) {
    const float alpha = colour_[i * 4 + 3];
    float nearest = depth_[i];
    if (alpha > 0.0f && alpha < 1.0f) {
      const size_t x = i % width_, y = i / width_;
      for (size_t row = y > 0 ? y - 1 : 0; row <= std::min<size_t>(y + 1, height_ - 1); ++row) {
        for (size_t column = x > 0 ? x - 1 : 0; column <= std::min<size_t>(x + 1, width_ - 1);
             ++column) {
          const size_t at = row * width_ + column;
          if (colour_[at * 4 + 3] > 0.0f) nearest = std::min(nearest, depth_[at]);
        }
      }
    }
    // Where both share a pixel, one depth stands for both.
    values[i] = held_depth_.empty() ? nearest : std::min(nearest, held_depth_[i]);
  });
  return values;
}

void MeshLayers::matteOf(std::span<const float> catcher_depth, float margin, std::span<float> depth,
                         std::span<float> opacity) const {
  const size_t count = pixelCount();
  requireSize(catcher_depth.size(), count, "the catchers' depth");
  requireSize(depth.size(), count, "depth");
  requireSize(opacity.size(), count, "opacity");
  const std::vector<float> meshes = surfaceDepth();
  forPixels(count, [&](size_t i) {
    depth[i] = std::min(catcher_depth[i] - margin, meshes[i]);
    opacity[i] = catcher_depth[i] < kEmptyDepth ? 1.0f : hiddenAt(i);
  });
}

void MeshLayers::compose(std::span<float> colour, std::span<float> depth,
                         std::span<const float> transmittance) const {
  const size_t count = pixelCount();
  requireSize(colour.size(), count * 4, "colour");
  requireSize(depth.size(), count, "depth");
  requireSize(transmittance.size(), count, "transmittance");
  forPixels(count, [&](size_t i) {
    float* pixel = &colour[i * 4];
    if (std::equal(pixel, pixel + 4, &colour_[i * 4])) depth[i] = depth_[i];
    const float through = transmittance[i];
    const float passed = passed_.empty() ? 1.0f : passed_[i];
    if (world_.empty()) {
      // Shadows on nothing are black with an alpha.
      pixel[3] += through * (1.0f - passed);
      return;
    }
    // Of the world's light that the meshes let pass, splats take their share.
    const float gap = 1.0f - hiddenAt(i);
    const float share = gap > 0.0f ? std::min(through / gap, 1.0f) : 0.0f;
    for (size_t c = 0; c < 3; ++c) pixel[c] += share * passed * world_[i * 3 + c];
    // What neither shows nor passes is held out.
    const float held = 1.0f - pixel[3] - through;
    pixel[3] = held > kRounding ? 1.0f - held : 1.0f;
  });
}

uint64_t MeshLayers::memoryBound(uint32_t width, uint32_t height) {
  // What is kept, and beside it the levels of a fill with what it knows: 4/3 of four values.
  constexpr uint64_t kPerPixel = (1 + 4 + 2 + 3 + 3 + 1) * sizeof(float) + 24;
  return uint64_t{width} * height * kPerPixel;
}

}  // namespace stipple
