#include "math/quaternion_turn.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

namespace stipple {
namespace {

using Turn = std::array<float, 3>;
using Rotation = std::array<float, 4>;

double lengthOf(const Rotation& q) {
  double sum = 0;
  for (const float c : q) sum += static_cast<double>(c) * static_cast<double>(c);
  return std::sqrt(sum);
}

TEST(QuaternionTurn, TurnsByTwiceTheAngleWhoseTangentIsItsLength) {
  const float half = static_cast<float>(std::sqrt(0.5));
  Rotation q = {half, half, 0, 0};  // a quarter about x
  turnQuaternion(Turn{0, 0, 1}.data(), q.data());
  // A quarter about z of the world after it: (1, 0, 0, 1) (1, 1, 0, 0) / 2.
  for (const float c : q) EXPECT_NEAR(c, 0.5f, 1e-7f);
}

TEST(QuaternionTurn, LargeAndSmallTurnsLeaveAUnitQuaternion) {
  for (const float size : {0.0f, 1e-30f, 1e-3f, 1.0f, 1e6f, 1e18f}) {
    Rotation q = {0.5f, -0.5f, 0.5f, 0.5f};
    turnQuaternion(Turn{size, -size, size}.data(), q.data());
    EXPECT_NEAR(lengthOf(q), 1, 2e-7) << size;
  }
}

TEST(QuaternionTurn, DerivativesAreThoseOfDifferences) {
  const Turn turn = {0.7f, -1.3f, 0.2f};
  const Rotation start = {0.1f, 0.7f, -0.5f, 0.5f};  // of length 1
  const Rotation weights = {0.3f, -2.0f, 1.1f, 0.9f};
  ASSERT_NEAR(lengthOf(start), 1, 1e-7);
  const auto loss = [&](const Turn& by, Rotation q) {
    turnQuaternion(by.data(), q.data());
    double sum = 0;
    for (size_t k = 0; k < 4; ++k) sum += static_cast<double>(weights[k] * q[k]);
    return sum;
  };
  Rotation turned = start, gradient = weights;
  turnQuaternion(turn.data(), turned.data());
  Turn by_turn;
  turnQuaternionBackward(turn.data(), turned.data(), gradient.data(), by_turn.data());
  // Losses of size 2 round by 3e-7, differences of 1/64 by 2e-5, and err by its square, 2e-4.
  const float eps = 0x1.0p-7f;
  const double step = 2 * static_cast<double>(eps);
  for (size_t axis = 0; axis < 3; ++axis) {
    Turn high = turn, low = turn;
    high[axis] += eps;
    low[axis] -= eps;
    const double difference = (loss(high, start) - loss(low, start)) / step;
    EXPECT_NEAR(static_cast<double>(by_turn[axis]), difference, 3e-4);
  }
  // Along the sphere: a quaternion that leaves it is not one that is turned.
  for (size_t k = 0; k < 4; ++k) {
    Rotation high = start, low = start;
    high[k] += eps;
    low[k] -= eps;
    const auto onSphere = [](Rotation q) {
      const float length = static_cast<float>(lengthOf(q));
      for (float& c : q) c /= length;
      return q;
    };
    const double difference = (loss(turn, onSphere(high)) - loss(turn, onSphere(low))) / step;
    EXPECT_NEAR(static_cast<double>(gradient[k]), difference, 3e-4);
  }
}

}  // namespace
}  // namespace stipple
