#include "densify/parts/splat_filter.h"

#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 14;

}  // namespace

void FilteredParameterisation::activate(const RawSplats& raw, SplatCloud& cloud) const {
  if (how_) how_->activate(raw, cloud);
  filter_.apply(cloud);
}

void FilteredParameterisation::adjoint(const RawSplats& raw, const SplatCloud&,
                                       const CloudGradient& by_cloud, RawSplats& by_raw) const {
  const size_t count = raw.size();
  before_.scales.resize(count * 3);
  before_.opacities.resize(count);
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      for (size_t k = i * 3; k < i * 3 + 3; ++k) {
        before_.scales[k] = activatedScale(raw.log_scales[k]);
      }
      before_.opacities[i] = activatedOpacity(raw.logits[i]);
    }
  });
  if (how_) {
    before_.sh_degree = raw.sh_degree;
    before_.positions = raw.positions;
    before_.rotations = raw.rotations;
    how_->activate(raw, before_);
  }
  filter_.adjoint(before_, by_cloud);
  // What stands in by_raw is of the filtered splats.
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      for (size_t k = i * 3; k < i * 3 + 3; ++k) {
        by_raw.log_scales[k] = by_cloud.scales[k] * before_.scales[k];
      }
      const float opacity = before_.opacities[i];
      by_raw.logits[i] = by_cloud.opacities[i] * (opacity * (1.0f - opacity));
    }
  });
  if (how_) how_->adjoint(raw, before_, by_cloud, by_raw);
}

}  // namespace stipple
