#include "math/lens.h"

#include <gtest/gtest.h>

#include <cmath>

namespace stipple {
namespace {

const Vec2d kPoints[] = {{0.3, -0.2}, {-0.7, 0.4}, {0.01, 0.02}, {0.0, 0.5}, {1.1, 0.9}};

// Two roundings of each of a few dozen operations.
constexpr double kTolerance = 1e-14;

void expectSame(const Lens& lens, Vec2d (*reference)(double x, double y)) {
  EXPECT_TRUE(lens.isDistorted());
  for (const Vec2d& point : kPoints) {
    const Vec2d expected = reference(point.x(), point.y());
    EXPECT_LT((distort(lens, point) - expected).norm(), kTolerance) << point.transpose();
  }
}

TEST(Lens, WithoutParametersIsAPinhole) {
  const Lens lens;
  EXPECT_FALSE(lens.isDistorted());
  for (const Vec2d& point : kPoints) EXPECT_EQ(distort(lens, point), point);
  EXPECT_EQ(validRadius(lens, 3), 3);
}

TEST(Lens, RadialAndTangentialTermsAreBrowns) {
  Lens lens;
  lens.radial = {-0.2, 0.05};
  lens.tangential = {0.003, -0.002};
  expectSame(lens, [](double x, double y) {
    const double r2 = x * x + y * y, radial = 1 - 0.2 * r2 + 0.05 * r2 * r2;
    return Vec2d(x * radial + 2 * 0.003 * x * y - 0.002 * (r2 + 2 * x * x),
                 y * radial + 0.003 * (r2 + 2 * y * y) - 2 * 0.002 * x * y);
  });
}

TEST(Lens, RationalFactorDivides) {
  Lens lens;
  lens.radial = {0.1, -0.02, 0.003};
  lens.divisor = {0.05, 0.01, 0.002};
  expectSame(lens, [](double x, double y) {
    const double r2 = x * x + y * y, r4 = r2 * r2, r6 = r4 * r2;
    const double factor =
        (1 + 0.1 * r2 - 0.02 * r4 + 0.003 * r6) / (1 + 0.05 * r2 + 0.01 * r4 + 0.002 * r6);
    return Vec2d(x * factor, y * factor);
  });
}

TEST(Lens, FisheyeIsAPolynomialOfTheAngle) {
  Lens lens;
  lens.fisheye = true;
  lens.radial = {0.02, -0.01, 0.004, -0.001};
  expectSame(lens, [](double x, double y) {
    const double r = std::hypot(x, y), t = std::atan(r);
    const double seen = t + 0.02 * std::pow(t, 3) - 0.01 * std::pow(t, 5) + 0.004 * std::pow(t, 7) -
                        0.001 * std::pow(t, 9);
    return Vec2d(x / r * seen, y / r * seen);
  });
}

TEST(Lens, ThinPrismActsOnTheAngle) {
  Lens lens;
  lens.fisheye = true;
  lens.radial = {0.02, -0.01};
  lens.tangential = {0.001, 0.002};
  lens.prism = {0.003, 0, -0.004, 0};
  expectSame(lens, [](double x, double y) {
    const double r = std::hypot(x, y), t = std::atan(r), u = x / r * t, v = y / r * t;
    const double t2 = t * t, radial = 1 + 0.02 * t2 - 0.01 * t2 * t2;
    return Vec2d(u * radial + 2 * 0.001 * u * v + 0.002 * (t2 + 2 * u * u) + 0.003 * t2,
                 v * radial + 2 * 0.002 * u * v + 0.001 * (t2 + 2 * v * v) - 0.004 * t2);
  });
}

TEST(Lens, TangentialTermsMaySeeTheRadiusAfterTheRadialFactor) {
  Lens lens;
  lens.fisheye = true;
  lens.radial = {0.02, 0, 0, 0, 0, 0.001};
  lens.tangential = {0.001, 0.002};
  lens.prism = {0.003, 0.0001, -0.004, 0.0002};
  lens.tangential_after_radial = true;
  expectSame(lens, [](double x, double y) {
    const double r = std::hypot(x, y), t = std::atan(r);
    const double seen = t * (1 + 0.02 * t * t + 0.001 * std::pow(t, 12));
    const double u = x / r * seen, v = y / r * seen, s2 = seen * seen, s4 = s2 * s2;
    return Vec2d(u + 0.002 * (2 * u * u + s2) + 2 * 0.001 * u * v + 0.003 * s2 + 0.0001 * s4,
                 v + 0.001 * (2 * v * v + s2) + 2 * 0.002 * u * v - 0.004 * s2 + 0.0002 * s4);
  });
}

TEST(Lens, FieldOfViewFollowsDevernayAndFaugeras) {
  Lens lens;
  lens.field_of_view = 0.8;
  expectSame(lens, [](double x, double y) {
    const double r = std::hypot(x, y);
    const double seen = std::atan(2 * r * std::tan(0.4)) / 0.8;
    return Vec2d(x / r * seen, y / r * seen);
  });
  // A field of view of nearly 0 is nearly a pinhole, not a division by it.
  lens.field_of_view = 1e-9;
  EXPECT_LT((distort(lens, kPoints[0]) - kPoints[0]).norm(), 1e-12);
}

TEST(Lens, DivisionIsTheInverseOfItsQuotient) {
  Lens lens;
  lens.division = -0.15;
  for (const Vec2d& point : kPoints) {
    const Vec2d seen = distort(lens, point);
    EXPECT_LT((seen / (1 - 0.15 * seen.squaredNorm()) - point).norm(), kTolerance);
  }
}

TEST(Lens, ModelEndsWhereItFoldsOver) {
  Lens lens;
  lens.radial = {-0.2};
  // d/dr (r - 0.2 r^3) = 0 at r = sqrt(1 / 0.6).
  EXPECT_NEAR(validRadius(lens, 3), std::sqrt(1 / 0.6), 1e-6);
  EXPECT_EQ(validRadius(lens, 1), 1);
  lens.radial = {0.3};
  EXPECT_EQ(validRadius(lens, 3), 3);
  // The division model has no root beyond r = 1 / (2 sqrt(k)).
  lens = {};
  lens.division = 1;
  EXPECT_NEAR(validRadius(lens, 3), 0.5, 1e-5);
}

}  // namespace
}  // namespace stipple
