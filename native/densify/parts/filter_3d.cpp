// Based on: Yu, Chen, Huang, Sattler, Geiger, Mip-Splatting: Alias-free 3D Gaussian Splatting, CVPR
// 2024, section 4.1 and equation 9, with the square that its dimensions ask for. Differs: each view
// counts with its own focal length, as the equation has it; depth begins at the near plane; opacity
// by logarithms, so that no determinant leaves the range of numbers.

#include "densify/parts/filter_3d.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "densify/parts/splat_filter.h"
#include "densify/state_arrays.h"
#include "densify/strategies.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 12;
constexpr double kMargin = 0.15;       ///< of a picture's side, beyond it
constexpr double kLeastScale = 1e-38;  ///< smaller ones count as this: a square is far above 0

/// Metres between the rays of two pixels that are side by side, at this place; infinity where the
/// camera does not see it.
double intervalAt(const Camera& camera, const Vec3d& position) {
  constexpr double kUnseen = std::numeric_limits<double>::infinity();
  const Vec3d seen = camera.world_to_camera.topLeftCorner<3, 3>() * position +
                     camera.world_to_camera.topRightCorner<3, 1>();
  if (!(seen.z() > camera.near_plane)) return kUnseen;
  const bool is_perspective = camera.model == CameraModel::kPerspective;
  const double depth = is_perspective ? seen.z() : 1.0;
  const double x = camera.fx * seen.x() / depth + camera.cx;
  const double y = camera.fy * seen.y() / depth + camera.cy;
  const double width = camera.width, height = camera.height;
  const bool is_inside = x >= -kMargin * width && x <= (1 + kMargin) * width &&
                         y >= -kMargin * height && y <= (1 + kMargin) * height;
  return is_inside ? depth / camera.fx : kUnseen;
}

/// Of one splat, in double.
struct Filtered {
  double scale[3];     ///< before
  double widened[3];   ///< after
  double coefficient;  ///< opacity after over before

  Filtered(const float* scales, double size) {
    double logarithm = 0;
    for (int a = 0; a < 3; ++a) {
      scale[a] = std::max(static_cast<double>(scales[a]), kLeastScale);
      widened[a] = std::hypot(scale[a], size);
      logarithm += std::log(scale[a]) - std::log(widened[a]);
    }
    coefficient = std::exp(logarithm);
  }
};

class Filter3d final : public ControlPart, private SplatFilter {
 public:
  explicit Filter3d(const Filter3dOptions& options) : options_(options) {}

  const char* name() const override { return "filter_3d"; }
  ControlRoles owns() const override { return roles(ControlRole::kFilter); }
  const SplatFilter* filter() const override { return this; }

  bool wantsSweep(const ControlMoment& moment) const override {
    if (is_stale_) return true;
    const uint64_t interval = std::max(EventSchedule{}.least_interval,
                                       scaleSchedule(options_.interval, moment.iterations));
    return moment.takes_steps && !moment.is_learning &&
           moment.iteration < scaleSchedule(options_.last, moment.iterations) &&
           moment.iteration % interval == 0;
  }

  void sweep(const ControlMoment&, ViewEvaluator& views) override {
    std::vector<const Camera*> cameras;
    for (size_t v = 0; v < views.viewCount(); ++v) cameras.push_back(&views.camera(v));
    sizes_ = filterSizes(views.splats().positions, cameras, options_.variance);
    is_stale_ = false;
  }

  /// New splats are drawn as they are until the next look, an iteration later.
  void edited(const ControlMoment& moment, const SplatEdit& edit, size_t count_before) override {
    if (sizes_.size() == count_before) followEdit(edit, 1, 0.0f, sizes_);
    if (moment.is_event || edit.keep || edit.append.size() > 0) is_stale_ = true;
  }

  void put(TensorTable& table) const override {
    table["sizes"] = {{sizes_.size()}, sizes_};
    table["is_stale"] = {{1}, std::vector<uint32_t>{is_stale_ ? 1u : 0u}};
  }
  void take(const TensorTable& table) override {
    std::vector<float> sizes = stateArray<float>(table, "sizes");
    const std::vector<uint32_t> stale = stateArray<uint32_t>(table, "is_stale");
    for (const float size : sizes) {
      if (size >= 0 && std::isfinite(size)) continue;
      fail(ErrorCode::kFormat, "the strategy's state has " + std::to_string(size) +
                                   " among sizes; 0 and more is allowed");
    }
    if (stale.size() != 1) {
      fail(ErrorCode::kFormat, "the strategy's state has " + std::to_string(stale.size()) +
                                   " numbers in is_stale; 1 is needed");
    }
    sizes_ = std::move(sizes);
    is_stale_ = stale[0] != 0;
  }

 private:
  void apply(SplatCloud& cloud) const override {
    if (sizes_.size() != cloud.size()) return;  // before the first look
    parallelFor(sizes_.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        if (!(sizes_[i] > 0)) continue;
        const Filtered one(&cloud.scales[i * 3], static_cast<double>(sizes_[i]));
        for (size_t a = 0; a < 3; ++a) {
          cloud.scales[i * 3 + a] = static_cast<float>(one.widened[a]);
        }
        cloud.opacities[i] =
            static_cast<float>(static_cast<double>(cloud.opacities[i]) * one.coefficient);
      }
    });
  }

  // With c = prod s_a / s'_a: ds'_a / ds_a = s_a / s'_a, and d ln c / d s_a = f^2 / (s_a s'_a^2).
  void adjoint(const SplatCloud& cloud, const CloudGradient& gradient) const override {
    if (sizes_.size() != cloud.opacities.size()) return;
    parallelFor(sizes_.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        if (!(sizes_[i] > 0)) continue;
        const double size = static_cast<double>(sizes_[i]);
        const Filtered one(&cloud.scales[i * 3], size);
        const double by_opacity = static_cast<double>(gradient.opacities[i]) * one.coefficient;
        const double by_logarithm = by_opacity * static_cast<double>(cloud.opacities[i]);
        for (size_t a = 0; a < 3; ++a) {
          const double share = size / one.widened[a];
          float& by_scale = gradient.scales[i * 3 + a];
          by_scale =
              static_cast<float>(static_cast<double>(by_scale) * one.scale[a] / one.widened[a] +
                                 by_logarithm * share * share / one.scale[a]);
        }
        gradient.opacities[i] = static_cast<float>(by_opacity);
      }
    });
  }

  Filter3dOptions options_;
  std::vector<float> sizes_;  ///< [N] metres; other counts: nothing is known yet
  bool is_stale_ = true;
};

}  // namespace

std::vector<float> filterSizes(std::span<const float> positions,
                               std::span<const Camera* const> cameras, double variance) {
  const size_t count = positions.size() / 3;
  std::vector<float> sizes(count);
  const double deviation = std::sqrt(variance);
  constexpr float kUnseen = std::numeric_limits<float>::infinity();
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const Vec3d position(static_cast<double>(positions[i * 3]),
                           static_cast<double>(positions[i * 3 + 1]),
                           static_cast<double>(positions[i * 3 + 2]));
      double interval = std::numeric_limits<double>::infinity();
      for (const Camera* camera : cameras) {
        interval = std::min(interval, intervalAt(*camera, position));
      }
      sizes[i] = std::isfinite(interval) ? static_cast<float>(interval * deviation) : kUnseen;
    }
  });
  float largest = 0;
  for (const float size : sizes) largest = std::isfinite(size) ? std::max(largest, size) : largest;
  for (float& size : sizes) size = std::isfinite(size) ? size : largest;
  return sizes;
}

std::unique_ptr<ControlPart> filter3d(StrategySettings& settings) {
  Filter3dOptions options;
  options.variance = settings.number("variance", options.variance, 0, 100);
  return makeFilter3d(options);
}

std::unique_ptr<ControlPart> makeFilter3d(const Filter3dOptions& options) {
  return std::make_unique<Filter3d>(options);
}

}  // namespace stipple
