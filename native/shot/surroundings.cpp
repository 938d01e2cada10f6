#include "shot/surroundings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "math/affine.h"
#include "math/camera_rays.h"

namespace stipple {

namespace {

constexpr size_t kGrainRows = 16;
constexpr double kPi = std::numbers::pi;

/// Where a row or column lies between two of the picture's.
struct Between {
  size_t first, second;
  float share;  ///< of the second
};

/// Columns go around.
Between columnsAt(double turn, uint32_t width) {
  const double place = turn * width - 0.5;
  const double floor = std::floor(place);
  const auto last = static_cast<int64_t>(width);
  const int64_t first = (static_cast<int64_t>(floor) + last) % last;
  return {static_cast<size_t>(first), static_cast<size_t>((first + 1) % last),
          static_cast<float>(place - floor)};
}

/// Beyond the first and the last row there is no other.
Between rowsAt(double share, uint32_t height) {
  const double place = std::clamp(share * height - 0.5, 0.0, static_cast<double>(height - 1));
  const auto first = static_cast<size_t>(place);
  return {first, std::min<size_t>(first + 1, height - 1),
          static_cast<float>(place - static_cast<double>(first))};
}

/// In: direction: of any length but 0.
void lookUp(const Surroundings& from, const Vec3d& direction, float* pixel) {
  const double turn = std::atan2(direction[0], direction[1]) / (2 * kPi) + 0.5;
  const double up = std::atan2(direction[2], std::hypot(direction[0], direction[1]));
  const Between x = columnsAt(turn, from.width), y = rowsAt(0.5 - up / kPi, from.height);
  const auto at = [&](size_t row, size_t column) {
    return from.pixels + (row * from.width + column) * 3;
  };
  const float *a = at(y.first, x.first), *b = at(y.first, x.second), *c = at(y.second, x.first),
              *d = at(y.second, x.second);
  for (size_t k = 0; k < 3; ++k) {
    const float upper = a[k] + x.share * (b[k] - a[k]), lower = c[k] + x.share * (d[k] - c[k]);
    pixel[k] = upper + y.share * (lower - upper);
  }
}

}  // namespace

void validate(const Surroundings& surroundings) {
  if (!surroundings.pixels || (surroundings.width > 0 && surroundings.height > 0)) return;
  fail(ErrorCode::kInvalidArgument,
       "options->surroundings has " + std::to_string(surroundings.width) + " x " +
           std::to_string(surroundings.height) + " pixels; at least 1 x 1 is needed");
}

std::vector<float> surroundingsSeen(const Surroundings& surroundings, const Camera& camera) {
  const size_t width = camera.width, height = camera.height;
  std::vector<float> seen(width * height * 3, 0.0f);
  const CameraRays rays(camera);
  const Mat3d to_world = linearPart(camera.world_to_camera).transpose();
  parallelFor(height, kGrainRows, [&](size_t begin, size_t end) {
    for (size_t y = begin; y < end; ++y) {
      for (size_t x = 0; x < width; ++x) {
        PixelRay ray;
        if (!rays.through(static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5, ray)) {
          continue;
        }
        lookUp(surroundings, to_world * ray.direction, &seen[(y * width + x) * 3]);
      }
    }
  });
  return seen;
}

uint64_t surroundingsSeenBytes(const Camera& camera) {
  return uint64_t{camera.width} * camera.height * 3 * sizeof(float);
}

}  // namespace stipple
