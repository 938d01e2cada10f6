#include "splat/edit/local_surface.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "math/cross_product.h"

namespace stipple {

namespace {

constexpr int kRounds = 6;
constexpr double kMadToSigma = 1.4826;
/// Deviations from the surface within which points belong to it: for the fit, and to the ground.
constexpr double kFitSigmas = 3;
constexpr double kBandSigmas = 5;
/// Share of the size that rounding may move a point by: a perfect plane has a band, too.
constexpr double kRounding = 1e-6;
/// Points all around a place tell how the ground bends there; from one side it would be a guess.
constexpr size_t kSectors = 16;
constexpr size_t kNeededSectors = 12;
/// Slopes whose square is below this are those of a plane, to rounding.
constexpr double kLevel = 1e-12;

double medianOf(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

using Terms = std::array<double, 6>;

Terms termsAt(double u, double v) {
  return {1, u, v, u * u, u * v, v * v};
}

/// Solves the first `count` normal equations by elimination with pivots; what they do not determine
/// is 0.
Terms solved(std::array<Terms, 6> rows, Terms right, size_t count) {
  double largest = 0;
  for (size_t i = 0; i < count; ++i) largest = std::max(largest, rows[i][i]);
  std::array<bool, 6> determined = {};
  for (size_t i = 0; i < count; ++i) {
    size_t pivot = i;
    for (size_t k = i + 1; k < count; ++k) {
      if (std::abs(rows[k][i]) > std::abs(rows[pivot][i])) pivot = k;
    }
    std::swap(rows[i], rows[pivot]);
    std::swap(right[i], right[pivot]);
    determined[i] = std::abs(rows[i][i]) > 1e-11 * largest;
    if (!determined[i]) continue;
    for (size_t k = i + 1; k < count; ++k) {
      const double factor = rows[k][i] / rows[i][i];
      for (size_t j = i; j < count; ++j) rows[k][j] -= factor * rows[i][j];
      right[k] -= factor * right[i];
    }
  }
  Terms result = {};
  for (size_t i = count; i-- > 0;) {
    if (!determined[i]) continue;
    double sum = right[i];
    for (size_t j = i + 1; j < count; ++j) sum -= rows[i][j] * result[j];
    result[i] = sum / rows[i][i];
  }
  return result;
}

}  // namespace

LocalSurface::LocalSurface(const Plane& plane, const Vec3d& origin, std::span<const Vec3d> points,
                           double reach)
    : origin_(origin - (plane.normal.dot(origin) - plane.offset) * plane.normal), n_(plane.normal) {
  // Any two directions will do; the axis that the normal is furthest from gives the first.
  Eigen::Index axis = 0;
  n_.cwiseAbs().minCoeff(&axis);
  u_ = crossProduct(n_, Vec3d::Unit(axis)).normalized();
  v_ = crossProduct(n_, u_);
  std::vector<Place> places;
  double farthest = 0;
  std::array<bool, kSectors> seen = {};
  for (const Vec3d& point : points) {
    const Vec3d d = point - origin_;
    const Place place{u_.dot(d), v_.dot(d), n_.dot(d)};
    if (std::abs(place.h) > reach) continue;
    places.push_back(place);
    farthest = std::max({farthest, std::abs(place.u), std::abs(place.v)});
    const double turns = std::atan2(place.v, place.u) / (2 * std::numbers::pi) + 0.5;
    seen[std::min(kSectors - 1, static_cast<size_t>(turns * kSectors))] = true;
  }
  if (farthest > 0) unit_ = farthest;
  if (places.empty()) return;
  const auto sectors = static_cast<size_t>(std::count(seen.begin(), seen.end(), true));
  fit(places, reach, sectors >= kNeededSectors);
}

void LocalSurface::fit(const std::vector<Place>& places, double reach, bool bends) {
  const size_t count = bends ? 6 : 3;
  const double least = kRounding * unit_;
  double limit = reach;
  std::vector<double> deviations(places.size());
  for (int round = 0; round < kRounds; ++round) {
    std::array<Terms, 6> rows = {};
    Terms right = {};
    for (const Place& place : places) {
      const double off = place.h - height(place.u, place.v);
      if (round > 0 && std::abs(off) > limit) continue;
      const Terms terms = termsAt(place.u / unit_, place.v / unit_);
      for (size_t i = 0; i < count; ++i) {
        for (size_t j = 0; j < count; ++j) rows[i][j] += terms[i] * terms[j];
        right[i] += terms[i] * place.h;
      }
    }
    terms_ = solved(rows, right, count);
    for (size_t i = 0; i < places.size(); ++i) {
      deviations[i] = std::abs(places[i].h - height(places[i].u, places[i].v));
    }
    const double sigma = kMadToSigma * medianOf(deviations);
    limit = std::max(kFitSigmas * sigma, least);
    band_ = std::max(kBandSigmas * sigma, least);
  }
}

double LocalSurface::height(double u, double v) const {
  const Terms terms = termsAt(u / unit_, v / unit_);
  double sum = 0;
  for (size_t i = 0; i < terms.size(); ++i) sum += terms[i] * terms_[i];
  return sum;
}

Vec3d LocalSurface::normal(double u, double v) const {
  const double x = u / unit_, y = v / unit_;
  const double slope_u = (terms_[1] + 2 * terms_[3] * x + terms_[4] * y) / unit_;
  const double slope_v = (terms_[2] + terms_[4] * x + 2 * terms_[5] * y) / unit_;
  return (n_ - slope_u * u_ - slope_v * v_).normalized();
}

LocalSurface::Place LocalSurface::placeOf(const Vec3d& point) const {
  const Vec3d d = point - origin_;
  const double u = u_.dot(d), v = v_.dot(d);
  return {u, v, n_.dot(d) - height(u, v)};
}

Vec3d LocalSurface::pointAt(const Place& place) const {
  return origin_ + place.u * u_ + place.v * v_ + (height(place.u, place.v) + place.h) * n_;
}

Mat3d LocalSurface::turn(double from_u, double from_v, double to_u, double to_v) const {
  const Vec3d from = normal(from_u, from_v);
  const Vec3d to = normal(to_u, to_v);
  const Vec3d axis = crossProduct(from, to);
  if (axis.squaredNorm() < kLevel) return Mat3d::Identity();
  Mat3d skew;
  skew << 0, -axis[2], axis[1], axis[2], 0, -axis[0], -axis[1], axis[0], 0;
  // Normals of one surface over one plane are less than half a turn apart.
  return Mat3d::Identity() + skew + skew * skew / (1 + from.dot(to));
}

}  // namespace stipple
