#include "motion/motion_kernel.h"

namespace stipple {

namespace {

template <size_t kWidth>
void take(const float* column, size_t row, std::array<float, kWidth>& values) {
  for (size_t i = 0; i < kWidth; ++i) values[i] = column[row * kWidth + i];
}

template <size_t kWidth>
void put(const std::array<float, kWidth>& values, size_t row, float* column) {
  for (size_t i = 0; i < kWidth; ++i) column[row * kWidth + i] = values[i];
}

MovingSplat<float> splatOf(const MotionColumns<const float>& columns, size_t row) {
  MovingSplat<float> splat;
  take(columns.positions, row, splat.position);
  take(columns.rotations, row, splat.rotation);
  splat.opacity = columns.opacities[row];
  for (size_t wave = 0; wave < kMotionWaves; ++wave) {
    take(columns.waves[wave], row, splat.waves[wave]);
  }
  take(columns.phases, row, splat.phases);
  take(columns.spins, row, splat.spin);
  take(columns.lifespans, row, splat.lifespans);
  splat.centre = columns.centres[row];
  return splat;
}

void momentsScalar(const MotionColumns<const float>& splats, const TimeWindow& window, float time,
                   size_t begin, size_t end, const MomentColumns<float>& moments) {
  for (size_t row = begin; row < end; ++row) {
    const SplatMoment<float> moment = momentOf(splatOf(splats, row), window, time);
    put(moment.position, row, moments.positions);
    put(moment.rotation, row, moments.rotations);
    moments.opacities[row] = moment.opacity;
  }
}

void gradientsScalar(const MotionColumns<const float>& splats, const TimeWindow& window, float time,
                     size_t begin, size_t end, const MomentColumns<const float>& by_moments,
                     const MotionColumns<float>& by_splats) {
  for (size_t row = begin; row < end; ++row) {
    SplatMoment<float> by_moment;
    take(by_moments.positions, row, by_moment.position);
    take(by_moments.rotations, row, by_moment.rotation);
    by_moment.opacity = by_moments.opacities[row];
    const MovingSplat<float> by = momentGradient(splatOf(splats, row), window, time, by_moment);
    put(by.position, row, by_splats.positions);
    put(by.rotation, row, by_splats.rotations);
    by_splats.opacities[row] = by.opacity;
    for (size_t wave = 0; wave < kMotionWaves; ++wave) {
      put(by.waves[wave], row, by_splats.waves[wave]);
    }
    put(by.phases, row, by_splats.phases);
    put(by.spin, row, by_splats.spins);
    put(by.lifespans, row, by_splats.lifespans);
  }
}

}  // namespace

MotionKernel scalarMotionKernel() {
  return {"scalar", momentsScalar, gradientsScalar};
}

}  // namespace stipple
