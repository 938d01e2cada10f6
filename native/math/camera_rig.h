#pragma once

#include <cstdint>
#include <numbers>

#include "math/camera.h"

namespace stipple {

/// Full angles of the cameras of a rig, radians: from around a thing, and inside a room.
constexpr double kAngleAround = 40.0 * std::numbers::pi / 180;
constexpr double kAngleInside = 75.0 * std::numbers::pi / 180;

/// Direction `index` of a Fibonacci sphere: `count` directions, nearly evenly spread, from +z down
/// to -z. Unit up to rounding.
/// Based on: Gonzalez, Measurement of Areas on a Sphere Using Fibonacci and Latitude-Longitude
/// Lattices, Mathematical Geosciences 2010.
Vec3d fibonacciDirection(uint32_t index, uint32_t count);

/// A perspective camera at `eye` that looks along `forward`. In: forward: unit; up: not along it,
/// points upwards in the image; angle: full, of both sides, radians; size: pixels of each side.
/// The near and far planes are the default ones.
Camera cameraAlong(const Vec3d& eye, const Vec3d& forward, const Vec3d& up, double angle,
                   uint32_t size);

}  // namespace stipple
