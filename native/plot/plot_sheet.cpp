#include "base/number_text.h"
#include "plot/plot.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace stipple {

namespace {

constexpr double kLeft = 70, kRight = 16, kTop = 34, kBottom = 48;
constexpr int kTicks = 5;
constexpr double kFaint = 0.35;
constexpr double kTextSize = 11, kTitleSize = 13;
/// Told apart by people who see colours differently, too (Okabe and Ito).
constexpr uint32_t kColours[] = {0x0072b2, 0xd55e00, 0x009e73, 0xcc79a7, 0xe69f00, 0x56b4e9};
constexpr uint32_t kBlack = 0, kWhite = 0xffffff, kGrid = 0xdddddd, kFrame = 0x444444;

/// One axis: a range of values on a range of the picture.
struct Axis {
  bool is_logarithmic = false;
  double low = 0, high = 1;    ///< values; logarithms to base 10 where logarithmic
  double first = 0, last = 1;  ///< picture units

  bool shows(double value) const { return std::isfinite(value) && (!is_logarithmic || value > 0); }
  double scaled(double value) const { return is_logarithmic ? std::log10(value) : value; }
  double at(double value) const {
    return first + (scaled(value) - low) / (high - low) * (last - first);
  }
};

/// 1, 2 or 5 times a power of ten, so that about kTicks of them fill the range.
double stepFor(double range) {
  const double rough = range / kTicks;
  const double decade = std::pow(10.0, std::floor(std::log10(rough)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (rough <= factor * decade) return factor * decade;
  }
  return 10 * decade;
}

std::vector<double> evenTicks(double low, double high) {
  std::vector<double> ticks;
  const double step = stepFor(high - low);
  for (double k = std::ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k) {
    ticks.push_back(k * step);
  }
  return ticks;
}

std::vector<double> ticksOf(const Axis& axis) {
  if (!axis.is_logarithmic) return evenTicks(axis.low, axis.high);
  std::vector<double> ticks;
  const bool is_short = axis.high - axis.low < 2.5;
  for (double k = std::floor(axis.low); k <= axis.high; ++k) {
    for (const double factor : {1.0, 2.0, 5.0}) {
      const double value = factor * std::pow(10.0, k);
      const double place = std::log10(value);
      if (place < axis.low - 1e-9 || place > axis.high + 1e-9) continue;
      if (factor == 1.0 || is_short) ticks.push_back(value);
    }
  }
  // Less than a doubling may lie between two of them.
  if (ticks.size() < 2) return evenTicks(std::pow(10.0, axis.low), std::pow(10.0, axis.high));
  return ticks;
}

std::string tickText(double value) {
  if (value == 0) return "0";
  const double size = std::abs(value);
  if (size >= 1e6) return numberText(value / 1e6, 3) + "M";
  if (size >= 1e4) return numberText(value / 1e3, 3) + "k";
  return numberText(value, 4);
}

/// Lines of the legend: none where there is but one curve to name.
size_t legendCount(const PlotPanel& panel) {
  const auto count =
      static_cast<size_t>(std::count_if(panel.lines.begin(), panel.lines.end(),
                                        [](const PlotLine& line) { return !line.label.empty(); }));
  return count < 2 ? 0 : count;
}

Axis axisOf(const PlotPanel& panel, PanelSize size, bool along_x, bool& is_empty) {
  Axis axis;
  axis.is_logarithmic = along_x ? panel.x_is_logarithmic : panel.y_is_logarithmic;
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const PlotLine& line : panel.lines) {
    for (const double value : along_x ? line.x : line.y) {
      if (!axis.shows(value)) continue;
      low = std::min(low, axis.scaled(value));
      high = std::max(high, axis.scaled(value));
    }
  }
  is_empty = !(low <= high);
  if (is_empty) return axis;
  if (!along_x && panel.y_starts_at_zero && !axis.is_logarithmic) low = std::min(low, 0.0);
  // A single value gets a range around it.
  const double least = axis.is_logarithmic ? 0.1 : std::max(std::abs(high) * 1e-3, 1e-9);
  if (high - low < least) {
    low -= least;
    high += least;
  }
  const bool has_names = std::any_of(panel.lines.begin(), panel.lines.end(),
                                     [](const PlotLine& line) { return !line.names.empty(); });
  const double margin = along_x && !has_names ? 0 : 0.05 * (high - low);
  axis.low = low == 0 ? 0 : low - margin;
  // A legend stands above the curves, 15 units a line.
  const size_t named = along_x ? 0 : legendCount(panel);
  const double legend = named == 0 ? 0 : 15.0 * static_cast<double>(named) + 4;
  axis.high = high + margin + legend / (size.height - kTop - kBottom - legend) * (high - low);
  return axis;
}

/// Marks of one panel, whose upper left corner is at `origin`.
class PanelMarks {
 public:
  PanelMarks(std::vector<PlotMark>& marks, double left, double top)
      : marks_(marks), left_(left), top_(top) {}

  PlotMark& text(double x, double y, TextAnchor anchor, const std::string& text) {
    PlotMark& mark = add(PlotMark::Kind::kText, kBlack, kTextSize, {{x, y}});
    mark.anchor = anchor;
    mark.text = text;
    return mark;
  }
  PlotMark& stroke(const std::vector<std::array<double, 2>>& points, uint32_t colour,
                   double width) {
    return add(PlotMark::Kind::kStroke, colour, width, points);
  }
  void dot(double x, double y, uint32_t colour, double radius) {
    add(PlotMark::Kind::kDot, colour, radius, {{x, y}});
  }
  void veil(double left, double top, double right, double bottom) {
    add(PlotMark::Kind::kBox, kWhite, 0, {{left, top}, {right, bottom}}).opacity = 0.85;
  }

 private:
  PlotMark& add(PlotMark::Kind kind, uint32_t colour, double size,
                const std::vector<std::array<double, 2>>& points) {
    PlotMark mark;
    mark.kind = kind;
    mark.colour = colour;
    mark.size = size;
    for (const auto& [x, y] : points) mark.points.push_back({left_ + x, top_ + y});
    marks_.push_back(std::move(mark));
    return marks_.back();
  }

  std::vector<PlotMark>& marks_;
  double left_, top_;
};

void addLine(PanelMarks& marks, const PlotLine& line, uint32_t colour, const Axis& x,
             const Axis& y) {
  std::vector<std::array<double, 2>> points;
  for (size_t i = 0; i < std::min(line.x.size(), line.y.size()); ++i) {
    if (!x.shows(line.x[i]) || !y.shows(line.y[i])) continue;
    points.push_back({x.at(line.x[i]), y.at(line.y[i])});
  }
  if (points.empty()) return;
  if (line.has_stroke) {
    PlotMark& stroke = marks.stroke(points, colour, line.is_faint ? 1 : 1.8);
    if (line.is_faint) stroke.opacity = kFaint;
  }
  if (!line.has_markers) return;
  for (const auto& [left, top] : points) marks.dot(left, top, colour, 2.5);
}

/// Names of points, placed one after the other where they cover neither a point nor each other.
class NamePlaces {
 public:
  NamePlaces(PanelMarks& marks, const Axis& x, const Axis& y) : marks_(marks), x_(x), y_(y) {}

  void keepClear(const PlotLine& line) {
    for (size_t i = 0; i < std::min(line.x.size(), line.y.size()); ++i) {
      if (!x_.shows(line.x[i]) || !y_.shows(line.y[i])) continue;
      const double x = x_.at(line.x[i]), y = y_.at(line.y[i]);
      taken_.push_back({x - 3, y - 3, x + 3, y + 3});
    }
  }

  void add(const PlotLine& line) {
    for (size_t i = 0; i < std::min({line.x.size(), line.y.size(), line.names.size()}); ++i) {
      if (!x_.shows(line.x[i]) || !y_.shows(line.y[i])) continue;
      place(x_.at(line.x[i]), y_.at(line.y[i]), line.names[i]);
    }
  }

 private:
  struct Box {
    double left, top, right, bottom;
  };

  void place(double x, double y, const std::string& name) {
    const double width = 5.6 * static_cast<double>(name.size());
    struct Try {
      double left, base, at;
      TextAnchor anchor;
    };
    // Right, left, above and below, then the same further off.
    for (double far = 0; far < 60; far += 12) {
      const Try tries[] = {{x + 6, y + 4 - far, x + 6, TextAnchor::kStart},
                           {x - 6 - width, y + 4 - far, x - 6, TextAnchor::kEnd},
                           {x + 6, y + 4 + far, x + 6, TextAnchor::kStart},
                           {x - 6 - width, y + 4 + far, x - 6, TextAnchor::kEnd},
                           {x - width / 2, y - 7 - far, x, TextAnchor::kMiddle},
                           {x - width / 2, y + 15 + far, x, TextAnchor::kMiddle}};
      for (const Try& one : tries) {
        const Box box = {one.left, one.base - 10, one.left + width, one.base + 2};
        if (!isFree(box)) continue;
        taken_.push_back(box);
        const double nearest = std::clamp(x, one.left, one.left + width);
        if (far > 0) marks_.stroke({{x, y}, {nearest, one.base - 3}}, kGrid, 1);
        marks_.text(one.at, one.base, one.anchor, name).size = 10;
        return;
      }
    }
  }

  bool isFree(const Box& box) const {
    if (box.left < x_.first + 2 || box.right > x_.last - 2 || box.top < y_.last + 2 ||
        box.bottom > y_.first - 2) {
      return false;
    }
    return std::none_of(taken_.begin(), taken_.end(), [&](const Box& other) {
      return box.left < other.right && other.left < box.right && box.top < other.bottom &&
             other.top < box.bottom;
    });
  }

  PanelMarks& marks_;
  const Axis& x_;
  const Axis& y_;
  std::vector<Box> taken_;
};

void addAxes(PanelMarks& marks, const PlotPanel& panel, const Axis& x, const Axis& y) {
  for (const double tick : ticksOf(x)) {
    const double at = x.at(tick);
    marks.stroke({{at, y.first}, {at, y.last}}, kGrid, 1);
    marks.text(at, y.first + 16, TextAnchor::kMiddle, tickText(tick));
  }
  for (const double tick : ticksOf(y)) {
    const double at = y.at(tick);
    marks.stroke({{x.first, at}, {x.last, at}}, kGrid, 1);
    marks.text(x.first - 6, at + 4, TextAnchor::kEnd, tickText(tick));
  }
  marks.stroke({{x.first, y.first},
                {x.last, y.first},
                {x.last, y.last},
                {x.first, y.last},
                {x.first, y.first}},
               kFrame, 1);
  marks.text((x.first + x.last) / 2, y.first + 36, TextAnchor::kMiddle, panel.x_label);
  marks.text(x.first - 54, (y.first + y.last) / 2, TextAnchor::kMiddle, panel.y_label).is_upright =
      false;
}

void addLegend(PanelMarks& marks, const PlotPanel& panel, const Axis& x, const Axis& y) {
  const size_t labelled = legendCount(panel);
  if (labelled == 0) return;
  double widest = 0;
  for (const PlotLine& line : panel.lines) {
    widest = std::max(widest, 6.2 * static_cast<double>(line.label.size()));
  }
  const double left = x.last - widest - 34;
  double top = y.last + 6;
  marks.veil(left, top, left + widest + 30, top + 15.0 * static_cast<double>(labelled) + 4);
  for (size_t i = 0; i < panel.lines.size(); ++i) {
    if (panel.lines[i].label.empty()) continue;
    top += 15;
    PlotMark& sample = marks.stroke({{left + 4, top - 4}, {left + 20, top - 4}},
                                    kColours[i % std::size(kColours)], 2);
    if (panel.lines[i].is_faint) sample.opacity = kFaint;
    marks.text(left + 25, top, TextAnchor::kStart, panel.lines[i].label);
  }
}

void addPanel(PanelMarks& marks, const PlotPanel& panel, PanelSize size) {
  PlotMark& title = marks.text(size.width / 2, 20, TextAnchor::kMiddle, panel.title);
  title.is_bold = true;
  title.size = kTitleSize;
  bool no_x = false, no_y = false;
  Axis x = axisOf(panel, size, true, no_x);
  Axis y = axisOf(panel, size, false, no_y);
  if (no_x || no_y) {
    marks.text(size.width / 2, size.height / 2, TextAnchor::kMiddle, "nothing was measured");
    return;
  }
  x.first = kLeft;
  x.last = size.width - kRight;
  y.first = size.height - kBottom;
  y.last = kTop;
  addAxes(marks, panel, x, y);
  for (size_t i = 0; i < panel.lines.size(); ++i) {
    addLine(marks, panel.lines[i], kColours[i % std::size(kColours)], x, y);
  }
  NamePlaces names(marks, x, y);
  for (const PlotLine& line : panel.lines) names.keepClear(line);
  for (const PlotLine& line : panel.lines) names.add(line);
  addLegend(marks, panel, x, y);
}

}  // namespace

PlotSheet sheetOf(const std::vector<PlotPanel>& panels, PanelSize size) {
  const size_t columns = std::min<size_t>(2, std::max<size_t>(1, panels.size()));
  const size_t rows = (panels.size() + columns - 1) / columns;
  PlotSheet sheet;
  sheet.width = size.width * static_cast<double>(columns);
  sheet.height = size.height * static_cast<double>(std::max<size_t>(1, rows));
  for (size_t i = 0; i < panels.size(); ++i) {
    PanelMarks marks(sheet.marks, size.width * static_cast<double>(i % columns),
                     size.height * static_cast<double>(i / columns));
    addPanel(marks, panels[i], size);
  }
  return sheet;
}

}  // namespace stipple
