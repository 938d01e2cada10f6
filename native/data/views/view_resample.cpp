#include "data/views/view_resample.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "base/error.h"
#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kRowsPerTask = 16;
// A pinhole picture grows without bound towards 90 degrees; at 60 its corners have a quarter of the
// resolution of its middle.
const double kMaxExtent = std::tan(60.0 * std::numbers::pi / 180.0);
constexpr int kExtentSteps = 256;

Image emptyLike(const Image& image, uint32_t width, uint32_t height) {
  Image made;
  made.width = width;
  made.height = height;
  made.channels = image.channels;
  made.transfer = image.transfer;
  made.pixels.assign(made.pixelCount() * made.channels, 0.0f);
  return made;
}

/// Pixel of the lens's picture for a point of the plane at distance 1.
Vec2d lensPixel(const Camera& seen_by, const Lens& lens, const Vec2d& point) {
  const Vec2d at = distort(lens, point);
  return {seen_by.fx * at.x() + seen_by.cx, seen_by.fy * at.y() + seen_by.cy};
}

bool isInside(const Camera& camera, const Vec2d& pixel) {
  return pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() <= camera.width &&
         pixel.y() <= camera.height;
}

/// How far one can go from the principal point in a direction before the lens's picture ends.
double extent(const Camera& seen_by, const Lens& lens, const Vec2d& along, double limit) {
  for (int step = 1; step <= kExtentSteps; ++step) {
    const double radius = limit * step / kExtentSteps;
    if (isInside(seen_by, lensPixel(seen_by, lens, along * radius))) continue;
    double inside = limit * (step - 1) / kExtentSteps, outside = radius;
    while (outside - inside > 1e-12 * limit) {
      const double middle = 0.5 * (inside + outside);
      (isInside(seen_by, lensPixel(seen_by, lens, along * middle)) ? inside : outside) = middle;
    }
    return inside;
  }
  return limit;
}

struct Tap {
  size_t first = 0;
  size_t second = 0;
  float share = 0;  ///< of the second
};

/// The two pixels around a position along one axis; beyond the outer centres the outer pixel alone.
Tap tapAt(double position, uint32_t size) {
  const double centred = std::clamp(position - 0.5, 0.0, size - 1.0);
  const double floor = std::floor(centred);
  Tap tap;
  tap.first = static_cast<size_t>(floor);
  tap.second = std::min<size_t>(tap.first + 1, size - 1);
  tap.share = static_cast<float>(centred - floor);
  return tap;
}

void sample(const Image& image, const Vec2d& at, PixelLookup lookup, float* out) {
  Tap x = tapAt(at.x(), image.width), y = tapAt(at.y(), image.height);
  if (lookup == PixelLookup::kNearest) {
    x = {x.share < 0.5f ? x.first : x.second, 0, 0.0f};
    y = {y.share < 0.5f ? y.first : y.second, 0, 0.0f};
  }
  const size_t channels = image.channels;
  const auto pixel = [&](size_t column, size_t row) {
    return &image.pixels[(row * image.width + column) * channels];
  };
  const float* corners[4] = {pixel(x.first, y.first), pixel(x.second, y.first),
                             pixel(x.first, y.second), pixel(x.second, y.second)};
  for (size_t c = 0; c < channels; ++c) {
    const float top = corners[0][c] + (corners[1][c] - corners[0][c]) * x.share;
    const float bottom = corners[2][c] + (corners[3][c] - corners[2][c]) * x.share;
    out[c] = top + (bottom - top) * y.share;
  }
}

/// What new pixels take of the old ones along one axis.
struct AxisShares {
  struct Range {
    size_t first = 0;
    size_t end = 0;
    double first_share = 0;  ///< of the first and last old pixel; those between count whole
    double last_share = 0;
  };
  std::vector<Range> ranges;
  double inverse_length = 0;

  AxisShares(uint32_t from, uint32_t to) : inverse_length(static_cast<double>(to) / from) {
    for (uint64_t i = 0; i < to; ++i) {
      // Bounds as fractions of `to`, exact in integers: i from / to.
      const uint64_t begin = i * from, end = (i + 1) * from;
      Range range;
      range.first = begin / to;
      range.end = (end + to - 1) / to;
      range.first_share = 1.0 - static_cast<double>(begin % to) / to;
      range.last_share = end % to == 0 ? 1.0 : static_cast<double>(end % to) / to;
      if (range.end - range.first == 1) range.first_share = range.last_share = 1.0;
      ranges.push_back(range);
    }
  }

  static double share(const Range& range, size_t i) {
    return i == range.first ? range.first_share : i + 1 == range.end ? range.last_share : 1.0;
  }
};

}  // namespace

Camera undistortedCamera(const Camera& seen_by, const Lens& lens) {
  const double limit = std::min(validRadius(lens, 2 * kMaxExtent), kMaxExtent);
  const double left = extent(seen_by, lens, {-1, 0}, limit);
  const double right = extent(seen_by, lens, {1, 0}, limit);
  const double top = extent(seen_by, lens, {0, -1}, limit);
  const double bottom = extent(seen_by, lens, {0, 1}, limit);
  const double width = (left + right) * seen_by.fx, height = (top + bottom) * seen_by.fy;
  if (!(width > 0) || !(height > 0) || !std::isfinite(width * height)) {
    fail(ErrorCode::kUnsupported,
         "the camera's distortion cannot be taken out: its model folds the image over at its "
         "principal point, or that point lies outside of the image");
  }
  // As many pixels as the lens's picture has, so that neither detail nor memory changes much.
  const double scale =
      std::sqrt(static_cast<double>(seen_by.width) * seen_by.height / (width * height));
  Camera camera = seen_by;
  camera.width = static_cast<uint32_t>(std::clamp(std::round(width * scale), 1.0, 65536.0));
  camera.height = static_cast<uint32_t>(std::clamp(std::round(height * scale), 1.0, 65536.0));
  // Whole pixels: the field of view is kept, the focal lengths take the rounding.
  camera.fx = camera.width / (left + right);
  camera.fy = camera.height / (top + bottom);
  camera.cx = camera.fx * left;
  camera.cy = camera.fy * top;
  try {
    validate(camera);
  } catch (const Error& error) {
    fail(
        ErrorCode::kUnsupported,
        std::string("the camera's distortion cannot be taken out: without it the ") + error.what());
  }
  return camera;
}

Image undistort(const Image& image, const Camera& seen_by, const Lens& lens, const Camera& target,
                PixelLookup lookup, std::vector<float>* covered) {
  Image made = emptyLike(image, target.width, target.height);
  if (covered) covered->assign(made.pixelCount(), 0.0f);
  const double corner_x = std::max(target.cx, target.width - target.cx) / target.fx;
  const double corner_y = std::max(target.cy, target.height - target.cy) / target.fy;
  const double valid = validRadius(lens, std::hypot(corner_x, corner_y));
  parallelFor(target.height, kRowsPerTask, [&](size_t begin, size_t end) {
    for (size_t row = begin; row < end; ++row) {
      for (size_t column = 0; column < target.width; ++column) {
        const Vec2d point((static_cast<double>(column) + 0.5 - target.cx) / target.fx,
                          (static_cast<double>(row) + 0.5 - target.cy) / target.fy);
        if (point.squaredNorm() > valid * valid) continue;
        const Vec2d at = lensPixel(seen_by, lens, point);
        if (!isInside(seen_by, at)) continue;
        const size_t pixel = row * target.width + column;
        sample(image, at, lookup, &made.pixels[pixel * made.channels]);
        if (covered) (*covered)[pixel] = 1.0f;
      }
    }
  });
  return made;
}

Camera resized(const Camera& camera, uint32_t width, uint32_t height) {
  Camera made = camera;
  made.width = width;
  made.height = height;
  if (camera.width == 0 || camera.height == 0) {
    made.fx *= width;
    made.fy *= width;
    made.cx = 0.5 * width;
    made.cy = 0.5 * height;
    return made;
  }
  const double x = static_cast<double>(width) / camera.width;
  const double y = static_cast<double>(height) / camera.height;
  made.fx *= x;
  made.cx *= x;
  made.fy *= y;
  made.cy *= y;
  return made;
}

Image areaAverage(const Image& image, uint32_t width, uint32_t height) {
  if (width == image.width && height == image.height) return image;
  Image made = emptyLike(image, width, height);
  const AxisShares columns(image.width, width), rows(image.height, height);
  const size_t channels = image.channels;
  const double inverse_area = columns.inverse_length * rows.inverse_length;
  parallelFor(height, 1, [&](size_t row, size_t) {
    // Rows are summed before columns: they lie one after the other in memory.
    std::vector<double> sums(image.width * channels, 0.0);
    const AxisShares::Range& range = rows.ranges[row];
    for (size_t y = range.first; y < range.end; ++y) {
      const double share = AxisShares::share(range, y);
      const float* from = &image.pixels[y * image.width * channels];
      for (size_t i = 0; i < sums.size(); ++i) sums[i] += share * static_cast<double>(from[i]);
    }
    for (size_t column = 0; column < width; ++column) {
      const AxisShares::Range& span = columns.ranges[column];
      for (size_t c = 0; c < channels; ++c) {
        double sum = 0;
        for (size_t x = span.first; x < span.end; ++x) {
          sum += AxisShares::share(span, x) * sums[x * channels + c];
        }
        made.pixels[(row * width + column) * channels + c] = static_cast<float>(sum * inverse_area);
      }
    }
  });
  return made;
}

Image nearestPixels(const Image& image, uint32_t width, uint32_t height) {
  Image made = emptyLike(image, width, height);
  const size_t channels = image.channels;
  for (uint64_t row = 0; row < height; ++row) {
    const size_t y = (2 * row + 1) * image.height / (2 * uint64_t{height});
    for (uint64_t column = 0; column < width; ++column) {
      const size_t x = (2 * column + 1) * image.width / (2 * uint64_t{width});
      std::copy_n(&image.pixels[(y * image.width + x) * channels], channels,
                  &made.pixels[(row * width + column) * channels]);
    }
  }
  return made;
}

}  // namespace stipple
