#include "shot/aperture.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <string>

#include "base/error.h"

namespace stipple {

namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kLargest = 1e6;  ///< metres; keeps every product far inside double

void refuse(const char* what, double value, const char* allowed) {
  char text[160];
  std::snprintf(text, sizeof(text), "the lens's %s is %g; %s is allowed", what, value, allowed);
  fail(ErrorCode::kInvalidArgument, text);
}

/// Squares around the middle become circles around it.
Vec2d onDisc(double u, double v) {
  const double x = 2 * u - 1, y = 2 * v - 1;
  if (x == 0 && y == 0) return {0, 0};
  const bool is_flat = std::abs(x) > std::abs(y);
  const double radius = is_flat ? x : y;
  const double turn = is_flat ? kPi / 4 * (y / x) : kPi / 2 - kPi / 4 * (x / y);
  return {radius * std::cos(turn), radius * std::sin(turn)};
}

/// u chooses a triangle between the middle and two corners, and a place in it.
Vec2d onPolygon(uint32_t blades, double u, double v) {
  const double place = u * blades;
  const double corner = std::min(std::floor(place), static_cast<double>(blades - 1));
  const double out = std::sqrt(place - corner);  // from the middle to the edge
  const double half = kPi / blades;
  const double x = out * std::cos(half), y = out * (2 * v - 1) * std::sin(half);
  const double turn = 2 * half * corner;
  return {x * std::cos(turn) - y * std::sin(turn), x * std::sin(turn) + y * std::cos(turn)};
}

}  // namespace

void validate(const Aperture& aperture) {
  requireFinite(aperture.radius, "lens.aperture_radius");
  requireFinite(aperture.focus_distance, "lens.focus_distance");
  requireFinite(aperture.rotation, "lens.rotation");
  requireFinite(aperture.ratio, "lens.ratio");
  if (aperture.radius < 0 || aperture.radius > kLargest) {
    refuse("aperture radius", aperture.radius, "0 to 1e6 m");
  }
  if (aperture.focus_distance < 1e-6 || aperture.focus_distance > 1e15) {
    refuse("focus distance", aperture.focus_distance, "1e-6 to 1e15 m");
  }
  // Beyond this rays lean so far that a space sheared by them counts as flat.
  if (aperture.radius > 1e6 * aperture.focus_distance) {
    refuse("aperture radius", aperture.radius, "at most a million times its focus distance");
  }
  if (aperture.blades != 0 && (aperture.blades < 3 || aperture.blades > 64)) {
    refuse("number of blades", aperture.blades, "0 (round) or 3 to 64");
  }
  if (std::abs(aperture.rotation) > 1e6) {
    refuse("rotation", aperture.rotation, "-1e6 to 1e6 radians");
  }
  if (aperture.ratio < 1e-3 || aperture.ratio > 1e3) {
    refuse("ratio", aperture.ratio, "0.001 to 1000");
  }
}

Vec2d aperturePoint(const Aperture& aperture, double u, double v) {
  const Vec2d flat = aperture.blades == 0 ? onDisc(u, v) : onPolygon(aperture.blades, u, v);
  const double c = std::cos(aperture.rotation), s = std::sin(aperture.rotation);
  const double x = c * flat[0] - s * flat[1], y = s * flat[0] + c * flat[1];
  return {aperture.radius * x / aperture.ratio, -aperture.radius * y};
}

}  // namespace stipple
