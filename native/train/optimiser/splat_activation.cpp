#include "train/optimiser/splat_activation.h"

#include <algorithm>
#include <functional>

#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 14;

/// out[i] = map(i) for i < count, by all threads.
template <class Map>
void fillInParallel(size_t count, float* out, const Map& map) {
  const auto fill_range = [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) out[i] = map(i);
  };
  // By reference: a std::function of a large capture allocates.
  parallelFor(count, kGrain, std::cref(fill_range));
}

void scalesThrough(const SplatCloud& cloud, const float* by_scales, float* out) {
  fillInParallel(cloud.scales.size(), out,
                 [&](size_t i) { return by_scales[i] * cloud.scales[i]; });
}

void opacitiesThrough(const SplatCloud& cloud, const float* by_opacities, float* out) {
  fillInParallel(cloud.opacities.size(), out, [&](size_t i) {
    return by_opacities[i] * (cloud.opacities[i] * (1.0f - cloud.opacities[i]));
  });
}

}  // namespace

CloudGradient spansOf(SplatCloud& gradients) {
  return {gradients.positions, gradients.rotations, gradients.scales, gradients.opacities,
          gradients.sh};
}

void activateShapes(const RawSplats& raw, SplatCloud& cloud) {
  cloud.scales.resize(raw.log_scales.size());
  cloud.opacities.resize(raw.logits.size());
  fillInParallel(raw.log_scales.size(), cloud.scales.data(),
                 [&](size_t i) { return activatedScale(raw.log_scales[i]); });
  fillInParallel(raw.logits.size(), cloud.opacities.data(),
                 [&](size_t i) { return activatedOpacity(raw.logits[i]); });
}

void activateWith(const RawSplats& raw, const Parameterisation& how, SplatCloud& cloud) {
  activateShapes(raw, cloud);
  cloud.positions = raw.positions;
  cloud.rotations = raw.rotations;
  how.activate(raw, cloud);
}

void throughActivations(const SplatCloud& cloud, SplatCloud& gradients) {
  scalesThrough(cloud, gradients.scales.data(), gradients.scales.data());
  opacitiesThrough(cloud, gradients.opacities.data(), gradients.opacities.data());
}

void throughActivations(const RawSplats& raw, const SplatCloud& cloud, const Parameterisation& how,
                        SplatCloud& by_cloud, RawSplats& by_raw) {
  by_raw.sh_degree = raw.sh_degree;
  by_raw.extra_lengths = raw.extra_lengths;
  by_raw.resize(raw.size());
  std::copy(by_cloud.positions.begin(), by_cloud.positions.end(), by_raw.positions.begin());
  std::copy(by_cloud.rotations.begin(), by_cloud.rotations.end(), by_raw.rotations.begin());
  scalesThrough(cloud, by_cloud.scales.data(), by_raw.log_scales.data());
  opacitiesThrough(cloud, by_cloud.opacities.data(), by_raw.logits.data());
  how.adjoint(raw, cloud, spansOf(by_cloud), by_raw);
}

}  // namespace stipple
