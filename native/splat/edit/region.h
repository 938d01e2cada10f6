#pragma once

#include <cstdint>
#include <span>

#include "math/vec.h"

namespace stipple {

enum class RegionKind : uint32_t {
  kAll = 0,
  kBrush = 1,
  kLasso = 2,
  kSphere = 3,
  kColour = 4,
  kGrow = 5,
  kBox = 6,
};
constexpr uint32_t kLastRegionKind = 6;

/// What a region does to the selection before.
enum class RegionOperation : uint32_t {
  kSet = 0,
  kAdd = 1,
  kSubtract = 2,
  kIntersect = 3,
  kToggle = 4,
};
constexpr uint32_t kLastRegionOperation = 4;

constexpr size_t kMaxBrushPoints = 65536;
constexpr size_t kMaxLassoPoints = 16384;

/// An image of the depths of what is seen: splats behind it, and those it does not cover, are not
/// in front.
struct SeenDepths {
  std::span<const float> depths;  ///< [height,width] cloud units, infinity where nothing is
  uint32_t width = 0;
  uint32_t height = 0;
  Vec4d rect = Vec4d::Zero();  ///< x0, y0, x1, y1: pixels that it covers
  double margin = 0;           ///< cloud units that a splat may lie behind it
  bool given = false;          ///< false: through, everything passes
};

/// Where splats are selected. A kind reads what is said here, and `seen` where that is given.
struct Region {
  RegionKind kind = RegionKind::kAll;
  RegionOperation operation = RegionOperation::kSet;
  /// Brush, lasso, seen: (x, y, z, 1) to (X, Y, -, W); the pixel is (X/W, Y/W), W <= 0 is behind.
  Mat4d cloud_to_pixels = Mat4d::Identity();
  Vec4d cloud_to_depth = Vec4d::UnitZ();  ///< seen: depth along the view axis, cloud units
  std::span<const float> points;          ///< brush, lasso: [n,2] pixels
  double radius = 0;  ///< brush: pixels; sphere, colour (0: everywhere): units of the box's frame
  SeenDepths seen;
  Vec3d centre = Vec3d::Zero();            ///< sphere, colour: in the box's frame
  Vec3d colour = Vec3d::Zero();            ///< linear Rec.709
  double tolerance = 0;                    ///< colour: distance in OKLab
  Mat4d cloud_to_box = Mat4d::Identity();  ///< sphere, colour, box
  double distance = 0;  ///< grow: cloud units; 0: from the splats' distances; < 0: shrink
  bool shrink = false;  ///< grow: shrink by the distance
};

}  // namespace stipple
