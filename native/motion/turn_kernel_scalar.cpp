#include "math/principal_axes.h"
#include "math/spherical_harmonics.h"
#include "motion/turn_kernel.h"

namespace stipple {

namespace {

void turnScalar(const TurnColumns& splats, size_t count) {
  const auto side = static_cast<size_t>(splats.degree + 1);
  for (size_t row = 0; row < count; ++row) {
    Mat3d deformation;
    for (size_t i = 0; i < 9; ++i) {
      deformation(static_cast<Eigen::Index>(i / 3), static_cast<Eigen::Index>(i % 3)) =
          static_cast<double>(splats.deformations[i * splats.stride + row]);
    }
    rotateHarmonics(nearestOrthogonal(deformation), splats.degree,
                    splats.sh + row * side * side * 3);
  }
}

}  // namespace

TurnKernel scalarTurnKernel() {
  return {"scalar", turnScalar};
}

}  // namespace stipple
