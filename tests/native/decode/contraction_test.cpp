#include "decode/field/contraction.h"

#include <gtest/gtest.h>

#include <cmath>

namespace stipple {
namespace {

/// The inner half: 2 m to a side around (1, 2, 3).
const RootCube kRoot = {{-1, 0, 1}, 4.0};
const Vec3d kMiddle(1, 2, 3);

TEST(Contraction, LeavesTheInnerHalfAsItIs) {
  const Contraction contraction(kRoot);
  for (const Vec3d& offset : {Vec3d(0, 0, 0), Vec3d(0.9, -1.0, 0.3), Vec3d(-0.1, 0.2, -0.99)}) {
    const Vec3d place = kMiddle + offset;
    EXPECT_EQ(contraction.factor(place), 1.0);
    EXPECT_LT((contraction.toWorld(place) - place).norm(), 1e-15);
    EXPECT_EQ(contraction.fromWorld(place), place);
  }
}

TEST(Contraction, DrawsInWhatIsAround) {
  const Contraction contraction(kRoot);
  // A place at r halves of the inner cube stands at 2 - 1 / r: by hand, r = 4 m / 1 m.
  EXPECT_LT(
      (contraction.fromWorld(kMiddle + Vec3d(2, -4, 1)) - kMiddle - 1.75 / 4 * Vec3d(2, -4, 1))
          .norm(),
      1e-14);
  for (const double distance : {1.0, 1.001, 3.0, 20.0, 63.0}) {
    const Vec3d world = kMiddle + distance * Vec3d(0.3, -0.7, 1.0);
    const Vec3d place = contraction.fromWorld(world);
    EXPECT_LT((place - kMiddle).cwiseAbs().maxCoeff(), 2.0);
    EXPECT_LT((contraction.toWorld(place) - world).norm(), 1e-11 * distance);
  }
}

TEST(Contraction, HoldsWhatIsFarther) {
  const Contraction contraction(kRoot);
  const Vec3d place = contraction.fromWorld(kMiddle + Vec3d(1e9, 3, -5));
  EXPECT_NEAR(contraction.toWorld(place).x(), kMiddle.x() + 64, 1e-9);
  EXPECT_TRUE(std::isfinite(contraction.factor(kMiddle + Vec3d(2.5, 0, 0))));
}

TEST(Contraction, DerivativesAreThoseOfDifferences) {
  const Contraction contraction(kRoot);
  const Vec3d by_world(0.3, -0.8, 0.5);
  const double by_factor = 0.7;
  const auto loss = [&](const Vec3d& place) {
    return by_world.dot(contraction.toWorld(place)) + by_factor * contraction.factor(place);
  };
  for (const Vec3d& offset : {Vec3d(0.2, 0.5, -0.3), Vec3d(1.2, 0.1, 0.4), Vec3d(0.5, -1.6, 1.2),
                              Vec3d(-0.2, 0.3, 1.9)}) {
    const Vec3d place = kMiddle + offset;
    const Vec3d seen = contraction.backward(place, by_world, by_factor);
    for (int axis = 0; axis < 3; ++axis) {
      Vec3d step = Vec3d::Zero();
      step[axis] = 1e-6;
      // In double: truncation of 1e-12 and rounding of 1e-16 / 1e-6, times derivatives of 1e3.
      const double difference = (loss(place + step) - loss(place - step)) / 2e-6;
      EXPECT_NEAR(seen[axis], difference, 1e-6 * std::max(1.0, std::abs(difference)));
    }
  }
}

}  // namespace
}  // namespace stipple
