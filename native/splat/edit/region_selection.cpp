#include "splat/edit/region_selection.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <string>

#include "base/error.h"
#include "base/number_text.h"
#include "base/parallel.h"
#include "math/affine.h"
#include "math/colour.h"
#include "math/oklab.h"
#include "mesh/point_growth.h"
#include "splat/edit/lasso_outline.h"
#include "splat/edit/stroke_path.h"

namespace stipple {

namespace {

/// Splats that all regions look at before the next: their positions stay in the cache.
constexpr size_t kGrain = 8192;
/// Regions that are ready at a time: a stroke's grid takes up to 1 MB.
constexpr size_t kTogether = 32;

[[noreturn]] void refuse(const std::string& what) {
  fail(ErrorCode::kInvalidArgument, what);
}

/// Beyond what any scene needs, and small enough that no product of two overflows.
constexpr double kLargest = 1e30;

template <class Values>
void requireNumbers(const Values& values, const std::string& name) {
  if (!values.allFinite()) refuse(name + " holds a number that is not finite");
  if (values.cwiseAbs().maxCoeff() > kLargest) {
    refuse(name + " holds " + numberText(values.cwiseAbs().maxCoeff()) +
           "; numbers up to 1e30 are allowed");
  }
}

void requireNumber(double value, const std::string& name) {
  requireNumbers(Vec2d(value, value), name);
}

void requireNotNegative(double value, const std::string& name) {
  if (!(value >= 0 && value <= kLargest)) {
    refuse(name + " is " + numberText(value) + "; 0 to 1e30 is allowed");
  }
}

void requirePoints(const Region& region, size_t least, size_t most, const std::string& name) {
  const size_t count = region.points.size() / 2;
  if (count < least || count > most) {
    refuse(name + ".points holds " + std::to_string(count) + " points; " + std::to_string(least) +
           " to " + std::to_string(most) + " are allowed");
  }
  requireFinite(region.points.data(), count * 2, 2, (name + ".points: point").c_str());
}

void requireSeen(const Region& region, const std::string& name) {
  const SeenDepths& seen = region.seen;
  if (seen.width == 0 || seen.height == 0 || seen.depths.empty()) {
    refuse(name + ".depths has " + std::to_string(seen.width) + " x " +
           std::to_string(seen.height) + " pixels; at least 1 x 1 is needed");
  }
  if (seen.depths.size() != size_t{seen.width} * seen.height) {
    refuse(name + ".depths holds " + std::to_string(seen.depths.size()) + " values; " +
           std::to_string(size_t{seen.width} * seen.height) + " are needed");
  }
  requireNumbers(seen.rect, name + ".depth_rect");
  if (!(seen.rect[2] > seen.rect[0] && seen.rect[3] > seen.rect[1])) {
    refuse(name + ".depth_rect has no area; x1 above x0 and y1 above y0 are needed");
  }
  requireNumber(seen.margin, name + ".depth_margin");
  requireNumbers(region.cloud_to_depth, name + ".cloud_to_depth");
  requireNumbers(region.cloud_to_pixels, name + ".cloud_to_pixels");
  for (const float depth : seen.depths) {
    if (std::isnan(depth)) refuse(name + ".depths holds NaN; infinity means that nothing is there");
  }
}

void requireRegion(const Region& region, const std::string& name) {
  switch (region.kind) {
    case RegionKind::kAll:
      break;
    case RegionKind::kBrush:
      requireNumbers(region.cloud_to_pixels, name + ".cloud_to_pixels");
      requirePoints(region, 1, kMaxBrushPoints, name);
      requireNotNegative(region.radius, name + ".radius");
      break;
    case RegionKind::kLasso:
      requireNumbers(region.cloud_to_pixels, name + ".cloud_to_pixels");
      requirePoints(region, 3, kMaxLassoPoints, name);
      break;
    case RegionKind::kSphere:
      requireNumbers(region.centre, name + ".centre");
      validateAffine(region.cloud_to_box, (name + ".cloud_to_box").c_str());
      requireNotNegative(region.radius, name + ".radius");
      break;
    case RegionKind::kColour:
      requireNumbers(region.colour, name + ".colour");
      requireNotNegative(region.tolerance, name + ".tolerance");
      requireNotNegative(region.radius, name + ".radius");
      if (region.radius > 0) {
        requireNumbers(region.centre, name + ".centre");
        validateAffine(region.cloud_to_box, (name + ".cloud_to_box").c_str());
      }
      break;
    case RegionKind::kGrow:
      requireNumber(region.distance, name + ".distance");
      return;  // in front or not, what is selected grows
    case RegionKind::kBox:
      validateAffine(region.cloud_to_box, (name + ".cloud_to_box").c_str());
      break;
  }
  if (region.seen.given) requireSeen(region, name);
}

Vec3d positionOf(const SplatCloud& cloud, size_t i) {
  const float* p = &cloud.positions[i * 3];
  return {static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2])};
}

double rowTimes(const Vec4d& row, const Vec3d& p) {
  return row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3];
}

/// The rows of a matrix that make a pixel of a point.
class ToPixels {
 public:
  explicit ToPixels(const Mat4d& matrix)
      : x_(matrix.row(0)), y_(matrix.row(1)), w_(matrix.row(3)) {}
  /// False for what is behind, or so near to the camera's plane that its pixel is nowhere.
  bool operator()(const Vec3d& p, double& x, double& y) const {
    constexpr double kFarthestPixel = 1e15;
    constexpr double kNearest = 1e-300;  // what can be divided by
    const double w = rowTimes(w_, p);
    if (!(w > kNearest)) return false;
    x = rowTimes(x_, p);
    y = rowTimes(y_, p);
    const double most = w * kFarthestPixel;
    if (!(std::abs(x) < most && std::abs(y) < most)) return false;
    const double inverse = 1 / w;
    x *= inverse;
    y *= inverse;
    return true;
  }

 private:
  Vec4d x_, y_, w_;
};

class InFront {
 public:
  explicit InFront(const Region& region)
      : seen_(region.seen), depth_(region.cloud_to_depth), to_pixels_(region.cloud_to_pixels) {}
  bool operator()(const Vec3d& p) const {
    const Vec4d& rect = seen_.rect;
    double x, y;
    if (!to_pixels_(p, x, y)) return false;
    if (x < rect[0] || x > rect[2] || y < rect[1] || y > rect[3]) return false;
    const auto place = [](double share, uint32_t count) {
      return std::min<size_t>(count - 1, static_cast<size_t>(share * count));
    };
    const size_t column = place((x - rect[0]) / (rect[2] - rect[0]), seen_.width);
    const size_t row = place((y - rect[1]) / (rect[3] - rect[1]), seen_.height);
    const double limit = static_cast<double>(seen_.depths[row * seen_.width + column]);
    return rowTimes(depth_, p) <= limit + seen_.margin;
  }

 private:
  SeenDepths seen_;
  Vec4d depth_;
  ToPixels to_pixels_;
};

/// A region's ball, in the frame that it is given in.
class Ball {
 public:
  explicit Ball(const Region& region)
      : linear_(linearPart(region.cloud_to_box)),
        move_(translationPart(region.cloud_to_box)),
        centre_(region.centre),
        squared_radius_(region.radius * region.radius) {}
  bool has(const Vec3d& p) const {
    return (linear_ * p + move_ - centre_).squaredNorm() <= squared_radius_;
  }

 private:
  Mat3d linear_;
  Vec3d move_, centre_;
  double squared_radius_;
};

/// Changes the selection of splats [begin, end).
using BlockWork = std::function<void(size_t begin, size_t end, uint8_t* mask)>;

/// Asks `covers(splat, centre)` only where the answer can change the selection.
template <class Covers>
BlockWork blockWork(const SplatCloud& cloud, const Region& region, Covers covers) {
  const RegionOperation operation = region.operation;
  const bool always = operation == RegionOperation::kSet || operation == RegionOperation::kToggle;
  const std::shared_ptr<const InFront> front =
      region.seen.given ? std::make_shared<const InFront>(region) : nullptr;
  return [=, &cloud](size_t begin, size_t end, uint8_t* mask) {
    for (size_t i = begin; i < end; ++i) {
      const bool was = mask[i] != 0;
      if (!always && was == (operation == RegionOperation::kAdd)) continue;
      const Vec3d p = positionOf(cloud, i);
      const bool covered = covers(i, p) && (!front || (*front)(p));
      const bool inverts =
          operation == RegionOperation::kSubtract || (operation == RegionOperation::kToggle && was);
      mask[i] = covered != inverts ? 1 : 0;
    }
  };
}

Vec3d storedColour(const SplatCloud& cloud, size_t i) {
  const float* sh = &cloud.sh[i * cloud.shStride()];
  constexpr double kC0 = static_cast<double>(kShC0);
  return {kC0 * static_cast<double>(sh[0]) + 0.5, kC0 * static_cast<double>(sh[1]) + 0.5,
          kC0 * static_cast<double>(sh[2]) + 0.5};
}

Vec3d baseColour(const SplatCloud& cloud, size_t i) {
  const Vec3d stored = storedColour(cloud, i);
  if (cloud.colour_space == ColourSpace::kLinear) return stored;
  return {srgbToLinear(stored[0]), srgbToLinear(stored[1]), srgbToLinear(stored[2])};
}

/// srgbToLinear() by straight lines between exact values. Near black the curve itself is straight,
/// so that even its cube root is off by 1e-5 at most.
class TransferTable {
 public:
  TransferTable() {
    for (size_t i = 0; i < values_.size(); ++i) {
      values_[i] = srgbToLinear(kFirst + static_cast<double>(i) / kSteps);
    }
  }
  /// False for colours so far outside 0..1 that they are not in the table.
  bool linear(const Vec3d& stored, Vec3f& result) const {
    for (Eigen::Index c = 0; c < 3; ++c) {
      const double place = (stored[c] - kFirst) * kSteps;
      if (!(place >= 0 && place < static_cast<double>(kSize - 1))) return false;
      const auto i = static_cast<size_t>(place);
      const double share = place - static_cast<double>(i);
      result[c] = static_cast<float>(values_[i] + share * (values_[i + 1] - values_[i]));
    }
    return true;
  }

 private:
  static constexpr size_t kSize = 4096;
  static constexpr double kFirst = -0.5;
  static constexpr double kSteps = 2048;  ///< of 1
  std::array<double, kSize> values_;
};

BlockWork colourWork(const SplatCloud& cloud, const Region& region) {
  static const TransferTable table;
  const Vec3d wanted = oklabFromLinear(region.colour);
  const Vec3f wanted_single = wanted.cast<float>();
  const bool encoded = cloud.colour_space == ColourSpace::kDisplay;
  const double tolerance = region.tolerance;
  // What the table and single precision say is as good as exact unless it is this near to the
  // limit.
  constexpr double kTableError = 1e-4;
  const double surely = std::max(0.0, tolerance - kTableError);
  const double surely_not = tolerance + kTableError;
  const bool everywhere = region.radius == 0;
  return blockWork(cloud, region, [=, ball = Ball(region), &cloud](size_t i, const Vec3d& p) {
    if (!everywhere && !ball.has(p)) return false;
    Vec3f linear;
    if (encoded && table.linear(storedColour(cloud, i), linear)) {
      const Vec3f off = oklabFromLinear(linear) - wanted_single;
      const auto squared = static_cast<double>(off.squaredNorm());
      if (squared > surely_not * surely_not) return false;
      if (squared < surely * surely) return true;
    }
    return (oklabFromLinear(baseColour(cloud, i)) - wanted).squaredNorm() <= tolerance * tolerance;
  });
}

/// In: area: says of a pixel whether it is covered.
template <class Area>
BlockWork pixelWork(const SplatCloud& cloud, const Region& region,
                    const std::shared_ptr<const Area>& area) {
  return blockWork(cloud, region,
                   [area, to = ToPixels(region.cloud_to_pixels)](size_t, const Vec3d& p) {
                     double x, y;
                     return to(p, x, y) && area->covers(x, y);
                   });
}

BlockWork workOf(const SplatCloud& cloud, const Region& region) {
  switch (region.kind) {
    case RegionKind::kBrush:
      return pixelWork(cloud, region,
                       std::make_shared<const StrokePath>(region.points, region.radius));
    case RegionKind::kLasso:
      return pixelWork(cloud, region, std::make_shared<const LassoOutline>(region.points));
    case RegionKind::kSphere:
      return blockWork(cloud, region,
                       [ball = Ball(region)](size_t, const Vec3d& p) { return ball.has(p); });
    case RegionKind::kColour:
      return colourWork(cloud, region);
    case RegionKind::kBox:
      return blockWork(
          cloud, region,
          [linear = linearPart(region.cloud_to_box), move = translationPart(region.cloud_to_box)](
              size_t, const Vec3d& p) { return (linear * p + move).cwiseAbs().maxCoeff() <= 1.0; });
    case RegionKind::kAll:
    case RegionKind::kGrow:
      break;
  }
  return blockWork(cloud, region, [](size_t, const Vec3d&) { return true; });
}

/// The selection grown or shrunken, combined with itself by the operation.
void applyGrowth(const SplatCloud& cloud, const Region& region, std::vector<uint8_t>& mask) {
  const double distance =
      region.distance != 0 ? std::abs(region.distance) : neighbourSpacing(cloud.positions, mask);
  const bool shrinks = region.shrink || region.distance < 0;
  const std::vector<uint8_t> covered =
      shrinks ? shrunken(cloud.positions, mask, distance) : grown(cloud.positions, mask, distance);
  parallelFor(mask.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      switch (region.operation) {
        case RegionOperation::kSet:
          mask[i] = covered[i];
          break;
        case RegionOperation::kAdd:
          mask[i] |= covered[i];
          break;
        case RegionOperation::kSubtract:
          mask[i] = mask[i] && !covered[i] ? 1 : 0;
          break;
        case RegionOperation::kIntersect:
          mask[i] &= covered[i];
          break;
        case RegionOperation::kToggle:
          mask[i] ^= covered[i];
          break;
      }
    }
  });
}

}  // namespace

std::vector<uint8_t> selectedByRegions(const SplatCloud& cloud, std::span<const Region> regions,
                                       std::span<const uint8_t> before) {
  validateSizes(cloud, "cloud");
  const size_t count = cloud.size();
  if (before.size() != count) {
    refuse("mask holds " + std::to_string(before.size()) + " values; the cloud has " +
           std::to_string(count) + " splats, one each is needed");
  }
  for (size_t r = 0; r < regions.size(); ++r) {
    requireRegion(regions[r], "regions[" + std::to_string(r) + "]");
  }
  std::vector<uint8_t> mask(count);
  for (size_t i = 0; i < count; ++i) mask[i] = before[i] != 0 ? 1 : 0;
  std::vector<BlockWork> pending;
  const auto finishPending = [&] {
    if (pending.empty()) return;
    parallelFor(count, kGrain, [&](size_t begin, size_t end) {
      for (const BlockWork& work : pending) work(begin, end, mask.data());
    });
    pending.clear();
  };
  for (const Region& region : regions) {
    if (region.kind == RegionKind::kGrow) {
      finishPending();
      applyGrowth(cloud, region, mask);
    } else {
      pending.push_back(workOf(cloud, region));
      if (pending.size() == kTogether) finishPending();
    }
  }
  finishPending();
  return mask;
}

std::vector<double> baseColours(const SplatCloud& cloud, std::span<const uint64_t> splats) {
  validateSizes(cloud, "cloud");
  std::vector<double> colours(splats.size() * 3);
  for (size_t k = 0; k < splats.size(); ++k) {
    if (splats[k] >= cloud.size()) {
      refuse("indices[" + std::to_string(k) + "] is " + std::to_string(splats[k]) +
             "; the cloud has " + std::to_string(cloud.size()) + " splats");
    }
    const Vec3d colour = baseColour(cloud, splats[k]);
    std::copy_n(colour.data(), 3, &colours[k * 3]);
  }
  return colours;
}

}  // namespace stipple
