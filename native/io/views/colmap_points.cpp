// Based on: the output format of COLMAP (colmap.github.io/format.html), points3D.
#include "io/views/colmap_points.h"

#include <array>
#include <cmath>
#include <filesystem>

#include "base/error.h"
#include "io/views/colmap_reading.h"
#include "math/colour.h"

namespace stipple {

namespace {

namespace fs = std::filesystem;

void add(PointSet& points, const std::array<double, 3>& position,
         const std::array<uint8_t, 3>& colour, const std::string& place) {
  for (const double value : position) {
    const float stored = static_cast<float>(value);
    if (!std::isfinite(stored)) {
      fail(ErrorCode::kFormat, place + " has a position that is not made of finite numbers");
    }
    points.positions.push_back(stored);
  }
  for (const uint8_t value : colour) {
    points.colours.push_back(srgbToLinear(static_cast<float>(value) / 255.0f));
  }
  points.opacities.push_back(1.0f);
}

PointSet readBinaryPoints(const std::string& path) {
  ColmapBytes file(path);
  PointSet points;
  const auto count = file.take<uint64_t>("the number of points");
  for (uint64_t i = 0; i < count; ++i) {
    const auto id = file.take<uint64_t>("a point's number");
    const std::string place = path + ": point " + std::to_string(id);
    std::array<double, 3> position;
    std::array<uint8_t, 3> colour;
    for (double& value : position) value = file.take<double>("a point's position");
    for (uint8_t& value : colour) value = file.take<uint8_t>("a point's colour");
    file.skip(sizeof(double), "a point's error");
    const auto sightings = file.take<uint64_t>("a point's number of sightings");
    constexpr uint64_t kSightingBytes = 8;
    // Compared by division, because the product of a damaged number may not fit.
    if (sightings > file.left() / kSightingBytes) {
      fail(ErrorCode::kFormat, place + " claims " + std::to_string(sightings) +
                                   " sightings of 8 bytes at byte " +
                                   std::to_string(file.offset()) + "; " +
                                   std::to_string(file.left()) + " bytes are left");
    }
    file.skip(sightings * kSightingBytes, "a point's sightings");
    add(points, position, colour, place);
  }
  return points;
}

PointSet readTextPoints(const std::string& path) {
  ColmapLines file(path);
  PointSet points;
  while (file.next(true)) {
    const auto id = file.number<uint64_t>("the point's number");
    std::array<double, 3> position;
    std::array<uint8_t, 3> colour;
    for (double& value : position) value = file.number<double>("the point's position");
    for (uint8_t& value : colour) value = file.number<uint8_t>("the point's colour");
    add(points, position, colour, path + ": point " + std::to_string(id));
  }
  return points;
}

}  // namespace

PointSet readColmapPoints(const std::string& folder) {
  std::error_code ignored;
  const fs::path binary = fs::path(folder) / "points3D.bin",
                 text = fs::path(folder) / "points3D.txt";
  if (fs::exists(binary, ignored)) return readBinaryPoints(binary.string());
  if (fs::exists(text, ignored)) return readTextPoints(text.string());
  return {};
}

}  // namespace stipple
