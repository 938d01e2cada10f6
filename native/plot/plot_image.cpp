#include "plot/plot_image.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.h"
#include "plot/text_outlines.h"

namespace stipple {

namespace {

constexpr double kSmallest = 0.25, kLargest = 8;

using Point = std::array<double, 2>;

double distance(const Point& p, const Point& a, const Point& b) {
  const double dx = b[0] - a[0], dy = b[1] - a[1];
  const double length = dx * dx + dy * dy;
  const double along = (p[0] - a[0]) * dx + (p[1] - a[1]) * dy;
  const double t = length > 0 ? std::clamp(along / length, 0.0, 1.0) : 0.0;
  return std::hypot(p[0] - a[0] - t * dx, p[1] - a[1] - t * dy);
}

/// An image in which marks cover what lies below: each mark once, however its parts overlap.
class Paper {
 public:
  Paper(Image& image, double scale)
      : image_(image), scale_(scale), covered_(image.pixelCount(), 0.0f) {}

  /// Coverage of a pen along a line; width in units of the sheet, points in pixels. One pixel of
  /// smooth edge on either side of the pen stands for the integral over the pixel.
  void pen(const std::vector<Point>& points, double width) {
    const double radius = 0.5 * width * scale_;
    for (size_t i = 0; i < points.size(); ++i) {
      if (i + 1 == points.size() && points.size() > 1) break;
      const Point& a = points[i];
      const Point& b = points[std::min(i + 1, points.size() - 1)];
      visit(std::min(a[0], b[0]) - radius, std::min(a[1], b[1]) - radius,
            std::max(a[0], b[0]) + radius, std::max(a[1], b[1]) + radius, [&](const Point& centre) {
              const double outside = distance(centre, a, b);
              // A pen thinner than a pixel covers a share of it.
              return std::min(std::clamp(radius + 0.5 - outside, 0.0, 1.0), 2 * radius);
            });
    }
  }

  void box(const Point& low, const Point& high) {
    const auto share = [](double centre, double from, double to) {
      return std::clamp(std::min(centre + 0.5, to) - std::max(centre - 0.5, from), 0.0, 1.0);
    };
    visit(low[0], low[1], high[0], high[1], [&](const Point& centre) {
      return share(centre[0], low[0], high[0]) * share(centre[1], low[1], high[1]);
    });
  }

  /// In: share of a pixel, which may lie outside the image.
  void cover(int x, int y, float share) {
    if (x < 0 || y < 0) return;
    const auto column = static_cast<uint32_t>(x), row = static_cast<uint32_t>(y);
    if (column >= image_.width || row >= image_.height) return;
    float& covered = covered_[static_cast<size_t>(row) * image_.width + column];
    covered = std::max(covered, share);
    first_row_ = std::min(first_row_, row);
    end_row_ = std::max(end_row_, row + 1);
  }

  double scale() const { return scale_; }

  /// Mixes the colour in where something was covered since the last call.
  void fill(uint32_t colour, double opacity) {
    for (uint32_t y = first_row_; y < end_row_; ++y) {
      for (uint32_t x = 0; x < image_.width; ++x) {
        const size_t i = static_cast<size_t>(y) * image_.width + x;
        if (covered_[i] == 0) continue;
        const double share = opacity * static_cast<double>(covered_[i]);
        covered_[i] = 0;
        for (int c = 0; c < 3; ++c) {
          const double wanted = ((colour >> (16 - 8 * c)) & 0xffu) / 255.0;
          float& value = image_.pixels[4 * i + static_cast<size_t>(c)];
          value = static_cast<float>(static_cast<double>(value) +
                                     share * (wanted - static_cast<double>(value)));
        }
      }
    }
    first_row_ = image_.height;
    end_row_ = 0;
  }

  Point pixel(const Point& at) const { return {at[0] * scale_, at[1] * scale_}; }

 private:
  template <typename Coverage>
  void visit(double left, double top, double right, double bottom, const Coverage& coverage) {
    const auto clamped = [](double value, uint32_t most) {
      return static_cast<uint32_t>(std::clamp(value, 0.0, static_cast<double>(most)));
    };
    const uint32_t x_begin = clamped(std::floor(left - 1), image_.width);
    const uint32_t x_end = clamped(std::ceil(right + 1), image_.width);
    const uint32_t y_begin = clamped(std::floor(top - 1), image_.height);
    const uint32_t y_end = clamped(std::ceil(bottom + 1), image_.height);
    for (uint32_t y = y_begin; y < y_end; ++y) {
      for (uint32_t x = x_begin; x < x_end; ++x) {
        cover(static_cast<int>(x), static_cast<int>(y),
              static_cast<float>(coverage({x + 0.5, y + 0.5})));
      }
    }
  }

  Image& image_;
  double scale_;
  std::vector<float> covered_;
  uint32_t first_row_ = 0, end_row_ = 0;
};

void drawText(Paper& paper, const PlotMark& mark) {
  OutlinedText text;
  text.text = mark.text;
  text.size_px = mark.size * paper.scale();
  text.is_bold = mark.is_bold;
  text.is_upright = mark.is_upright;
  double before = 0;  // of the baseline, in front of the mark's place
  if (mark.anchor == TextAnchor::kMiddle) before = lengthOf(text) / 2;
  if (mark.anchor == TextAnchor::kEnd) before = lengthOf(text);
  const Point at = paper.pixel(mark.points[0]);
  text.x = mark.is_upright ? at[0] - before : at[0];
  text.y = mark.is_upright ? at[1] : at[1] + before;
  coverText(text, [&](int x, int y, float share) { paper.cover(x, y, share); });
}

void draw(Paper& paper, const PlotMark& mark) {
  switch (mark.kind) {
    case PlotMark::Kind::kText:
      drawText(paper, mark);
      break;
    case PlotMark::Kind::kBox:
      paper.box(paper.pixel(mark.points[0]), paper.pixel(mark.points[1]));
      break;
    case PlotMark::Kind::kDot:
      paper.pen({paper.pixel(mark.points[0])}, 2 * mark.size);
      break;
    case PlotMark::Kind::kStroke: {
      std::vector<Point> points;
      for (const Point& point : mark.points) points.push_back(paper.pixel(point));
      paper.pen(points, mark.size);
      break;
    }
  }
  paper.fill(mark.colour, mark.opacity);
}

}  // namespace

uint32_t plotPixels(double units, double scale) {
  if (!(scale >= kSmallest && scale <= kLargest)) {
    fail(ErrorCode::kInvalidArgument,
         "scale is " + std::to_string(scale) + "; allowed are 0.25 to 8 pixels a unit");
  }
  return static_cast<uint32_t>(std::lround(units * scale));
}

Image imageOf(const PlotSheet& sheet, double scale) {
  Image image;
  image.width = plotPixels(sheet.width, scale);
  image.height = plotPixels(sheet.height, scale);
  image.channels = 4;
  image.transfer = Transfer::kSrgb;
  image.pixels.assign(4 * image.pixelCount(), 1.0f);
  Paper paper(image, scale);
  for (const PlotMark& mark : sheet.marks) draw(paper, mark);
  return image;
}

}  // namespace stipple
