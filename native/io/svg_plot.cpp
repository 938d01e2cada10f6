#include "io/svg_plot.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

namespace stipple {

namespace {

constexpr double kPanelWidth = 480;
constexpr double kPanelHeight = 320;
constexpr double kLeft = 70, kRight = 16, kTop = 34, kBottom = 48;
constexpr int kTicks = 5;
/// Told apart by people who see colours differently, too (Okabe and Ito).
constexpr const char* kColours[] = {"#0072b2", "#d55e00", "#009e73",
                                    "#cc79a7", "#e69f00", "#56b4e9"};

template <typename... Values>
std::string format(const char* pattern, Values... values) {
  char text[256];
  std::snprintf(text, sizeof(text), pattern, values...);
  return text;
}

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '&') {
      out += "&amp;";
    } else if (c == '<') {
      out += "&lt;";
    } else if (c == '>') {
      out += "&gt;";
    } else {
      out += c;
    }
  }
  return out;
}

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

std::vector<double> ticksOf(const Axis& axis) {
  std::vector<double> ticks;
  const bool by_value = !axis.is_logarithmic;
  if (by_value) {
    const double step = stepFor(axis.high - axis.low);
    for (double k = std::ceil(axis.low / step - 1e-9); k * step <= axis.high + 1e-9 * step; ++k) {
      ticks.push_back(k * step);
    }
    return ticks;
  }
  const bool is_short = axis.high - axis.low < 2.5;
  for (double k = std::floor(axis.low); k <= axis.high; ++k) {
    for (const double factor : {1.0, 2.0, 5.0}) {
      const double value = factor * std::pow(10.0, k);
      const double place = std::log10(value);
      if (place < axis.low - 1e-9 || place > axis.high + 1e-9) continue;
      if (factor == 1.0 || is_short) ticks.push_back(value);
    }
  }
  return ticks;
}

std::string tickText(double value) {
  if (value == 0) return "0";
  const double size = std::abs(value);
  if (size >= 1e6) return format("%.3gM", value / 1e6);
  if (size >= 1e4) return format("%.3gk", value / 1e3);
  return format("%.4g", value);
}

/// Lines of the legend: none where there is but one curve to name.
size_t legendCount(const PlotPanel& panel) {
  const auto count =
      static_cast<size_t>(std::count_if(panel.lines.begin(), panel.lines.end(),
                                        [](const PlotLine& line) { return !line.label.empty(); }));
  return count < 2 ? 0 : count;
}

Axis axisOf(const PlotPanel& panel, bool along_x, bool& is_empty) {
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
  const double margin = along_x ? 0 : 0.05 * (high - low);
  axis.low = low == 0 ? 0 : low - margin;
  // A legend stands above the curves, 15 units a line.
  const size_t named = along_x ? 0 : legendCount(panel);
  const double legend = named == 0 ? 0 : 15.0 * static_cast<double>(named) + 4;
  axis.high = high + margin + legend / (kPanelHeight - kTop - kBottom - legend) * (high - low);
  return axis;
}

void addText(std::string& out, double x, double y, const char* anchor, const std::string& text,
             const char* more = "") {
  out += format("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\"%s>", x, y, anchor, more) +
         escaped(text) + "</text>\n";
}

void addLine(std::string& out, const PlotLine& line, const char* colour, const Axis& x,
             const Axis& y) {
  std::string points, markers;
  for (size_t i = 0; i < std::min(line.x.size(), line.y.size()); ++i) {
    if (!x.shows(line.x[i]) || !y.shows(line.y[i])) continue;
    const double left = x.at(line.x[i]), top = y.at(line.y[i]);
    points += format("%.1f,%.1f ", left, top);
    if (line.has_markers) {
      markers +=
          format("<circle cx=\"%.1f\" cy=\"%.1f\" r=\"2.5\" fill=\"%s\"/>\n", left, top, colour);
    }
  }
  out += "<polyline points=\"" + points +
         format("\" fill=\"none\" stroke=\"%s\" stroke-width=\"%s\" stroke-opacity=\"%s\"/>\n",
                colour, line.is_faint ? "1" : "1.8", line.is_faint ? "0.35" : "1") +
         markers;
}

void addAxes(std::string& out, const PlotPanel& panel, const Axis& x, const Axis& y) {
  for (const double tick : ticksOf(x)) {
    const double at = x.at(tick);
    out += format("<line x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\" stroke=\"#dddddd\"/>\n",
                  at, y.first, at, y.last);
    addText(out, at, y.first + 16, "middle", tickText(tick));
  }
  for (const double tick : ticksOf(y)) {
    const double at = y.at(tick);
    out += format("<line x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\" stroke=\"#dddddd\"/>\n",
                  x.first, at, x.last, at);
    addText(out, x.first - 6, at + 4, "end", tickText(tick));
  }
  out += format(
      "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"none\" "
      "stroke=\"#444444\"/>\n",
      x.first, y.last, x.last - x.first, y.first - y.last);
  addText(out, (x.first + x.last) / 2, y.first + 36, "middle", panel.x_label);
  const double middle = (y.first + y.last) / 2, left = x.first - 54;
  addText(out, left, middle, "middle", panel.y_label,
          format(" transform=\"rotate(-90 %.1f %.1f)\"", left, middle).c_str());
}

void addLegend(std::string& out, const PlotPanel& panel, const Axis& x, const Axis& y) {
  const size_t labelled = legendCount(panel);
  if (labelled == 0) return;
  double widest = 0;
  for (const PlotLine& line : panel.lines) {
    widest = std::max(widest, 6.2 * static_cast<double>(line.label.size()));
  }
  const double left = x.last - widest - 34;
  double top = y.last + 6;
  out += format(
      "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"white\" "
      "fill-opacity=\"0.85\"/>\n",
      left, top, widest + 30, 15.0 * static_cast<double>(labelled) + 4);
  for (size_t i = 0; i < panel.lines.size(); ++i) {
    if (panel.lines[i].label.empty()) continue;
    top += 15;
    out += format(
        "<line x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\" stroke=\"%s\" "
        "stroke-width=\"2\"/>\n",
        left + 4, top - 4, left + 20, top - 4, kColours[i % std::size(kColours)]);
    addText(out, left + 25, top, "start", panel.lines[i].label);
  }
}

void addPanel(std::string& out, const PlotPanel& panel) {
  addText(out, kPanelWidth / 2, 20, "middle", panel.title,
          " font-weight=\"bold\" font-size=\"13\"");
  bool no_x = false, no_y = false;
  Axis x = axisOf(panel, true, no_x);
  Axis y = axisOf(panel, false, no_y);
  if (no_x || no_y) {
    addText(out, kPanelWidth / 2, kPanelHeight / 2, "middle", "nothing was measured");
    return;
  }
  x.first = kLeft;
  x.last = kPanelWidth - kRight;
  y.first = kPanelHeight - kBottom;
  y.last = kTop;
  addAxes(out, panel, x, y);
  for (size_t i = 0; i < panel.lines.size(); ++i) {
    addLine(out, panel.lines[i], kColours[i % std::size(kColours)], x, y);
  }
  addLegend(out, panel, x, y);
}

}  // namespace

std::string svgOf(const std::vector<PlotPanel>& panels) {
  const size_t columns = std::min<size_t>(2, std::max<size_t>(1, panels.size()));
  const size_t rows = (panels.size() + columns - 1) / columns;
  const double width = kPanelWidth * static_cast<double>(columns);
  const double height = kPanelHeight * static_cast<double>(std::max<size_t>(1, rows));
  std::string out = format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%.0f\" height=\"%.0f\" "
      "viewBox=\"0 0 %.0f %.0f\" font-family=\"sans-serif\" font-size=\"11\">\n",
      width, height, width, height);
  out += "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n";
  for (size_t i = 0; i < panels.size(); ++i) {
    out += format("<g transform=\"translate(%.0f %.0f)\">\n",
                  kPanelWidth * static_cast<double>(i % columns),
                  kPanelHeight * static_cast<double>(i / columns));
    addPanel(out, panels[i]);
    out += "</g>\n";
  }
  return out + "</svg>\n";
}

}  // namespace stipple
