// Based on: the sources that lens.h names with each model. Differs: one function evaluates all
// models, whose parameters are the non-zero members.
#include "math/lens.h"

#include <cmath>
#include <numbers>

namespace stipple {

namespace {

// Directions and radii at which the fold is looked for; between two radii it is bisected.
constexpr int kDirections = 16;
constexpr int kRadii = 512;

template <size_t N>
double polynomial(const std::array<double, N>& coefficients, double square) {
  double sum = 0;
  for (size_t i = N; i-- > 0;) sum = (sum + coefficients[i]) * square;
  return 1 + sum;
}

/// Fields of view below this are a pinhole: the factor differs from 1 by omega^2 (r^2 - 1/4) / 3.
constexpr double kLeastFieldOfView = 1e-8;

/// Factor of the radius by the models that are not polynomials.
double radiusFactor(const Lens& lens, double radius) {
  double scaled = radius;
  if (lens.fisheye) scaled = std::atan(scaled);
  if (std::abs(lens.field_of_view) > kLeastFieldOfView) {
    scaled = std::atan(2 * scaled * std::tan(0.5 * lens.field_of_view)) / lens.field_of_view;
  }
  if (lens.division != 0) {
    // The root that tends to r for k -> 0: r_d = 2 r / (1 + sqrt(1 - 4 k r^2)).
    scaled = 2 * scaled / (1 + std::sqrt(1 - 4 * lens.division * scaled * scaled));
  }
  return scaled / radius;
}

bool anyOf(const auto& values) {
  for (const double value : values) {
    if (value != 0) return true;
  }
  return false;
}

/// Whether the mapping keeps its orientation at a point: area grows by a positive factor there.
bool mapsOneToOne(const Lens& lens, const Vec2d& point) {
  // Central differences: 1e-6 of a plane at distance 1 keeps ten digits of the derivative.
  constexpr double kStep = 1e-6;
  const Vec2d dx = distort(lens, point + Vec2d(kStep, 0)) - distort(lens, point - Vec2d(kStep, 0));
  const Vec2d dy = distort(lens, point + Vec2d(0, kStep)) - distort(lens, point - Vec2d(0, kStep));
  const double area = dx.x() * dy.y() - dx.y() * dy.x();
  return std::isfinite(area) && area > 0;
}

}  // namespace

bool Lens::isDistorted() const {
  return fisheye || field_of_view != 0 || division != 0 || anyOf(radial) || anyOf(divisor) ||
         anyOf(tangential) || anyOf(prism);
}

Vec2d distort(const Lens& lens, const Vec2d& point) {
  Vec2d at = point;
  if (lens.fisheye || lens.field_of_view != 0 || lens.division != 0) {
    const double radius = point.norm();
    if (radius > 0) at *= radiusFactor(lens, radius);
  }
  double square = at.squaredNorm();
  double factor = polynomial(lens.radial, square);
  if (anyOf(lens.divisor)) factor /= polynomial(lens.divisor, square);
  const Vec2d radial = at * factor;
  if (lens.tangential_after_radial) {
    at = radial;
    square = at.squaredNorm();
  }
  const auto [p1, p2] = lens.tangential;
  const double cross = 2 * at.x() * at.y();
  const double fourth = square * square;
  return radial + Vec2d(p1 * cross + p2 * (square + 2 * at.x() * at.x()) + lens.prism[0] * square +
                            lens.prism[1] * fourth,
                        p2 * cross + p1 * (square + 2 * at.y() * at.y()) + lens.prism[2] * square +
                            lens.prism[3] * fourth);
}

double validRadius(const Lens& lens, double limit) {
  double valid = limit;
  for (int direction = 0; direction < kDirections; ++direction) {
    const double angle = 2 * std::numbers::pi * direction / kDirections;
    const Vec2d along(std::cos(angle), std::sin(angle));
    for (int step = 1; step <= kRadii; ++step) {
      const double radius = limit * step / kRadii;
      if (radius > valid) break;
      if (mapsOneToOne(lens, along * radius)) continue;
      double good = limit * (step - 1) / kRadii, bad = radius;
      while (bad - good > 1e-9 * limit) {
        const double middle = 0.5 * (good + bad);
        (mapsOneToOne(lens, along * middle) ? good : bad) = middle;
      }
      valid = good;
      break;
    }
  }
  return valid;
}

}  // namespace stipple
