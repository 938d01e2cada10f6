#include "plot/svg_plot.h"

#include <cstdio>

namespace stipple {

namespace {

constexpr char kStart[] = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"";
constexpr char kSheet[] =
    "font-family=\"sans-serif\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n";

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

const char* anchorName(TextAnchor anchor) {
  constexpr const char* kNames[] = {"start", "middle", "end"};
  return kNames[static_cast<int>(anchor)];
}

std::string strokeOf(const PlotMark& mark) {
  std::string out = "<polyline points=\"";
  for (const auto& [x, y] : mark.points) out += format("%.1f,%.1f ", x, y);
  return out + format(
                   "\" fill=\"none\" stroke=\"#%06x\" stroke-width=\"%g\" "
                   "stroke-opacity=\"%g\"/>\n",
                   mark.colour, mark.size, mark.opacity);
}

std::string dotOf(const PlotMark& mark) {
  return format("<circle cx=\"%.1f\" cy=\"%.1f\" r=\"%g\" fill=\"#%06x\"/>\n", mark.points[0][0],
                mark.points[0][1], mark.size, mark.colour);
}

std::string boxOf(const PlotMark& mark) {
  const auto& [a, b] = std::pair(mark.points[0], mark.points[1]);
  return format(
      "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"#%06x\" "
      "fill-opacity=\"%g\"/>\n",
      a[0], a[1], b[0] - a[0], b[1] - a[1], mark.colour, mark.opacity);
}

std::string textOf(const PlotMark& mark) {
  const auto& [x, y] = mark.points[0];
  std::string out = format("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\" font-size=\"%g\"", x, y,
                           anchorName(mark.anchor), mark.size);
  if (mark.is_bold) out += " font-weight=\"bold\"";
  if (!mark.is_upright) out += format(" transform=\"rotate(-90 %.1f %.1f)\"", x, y);
  return out + ">" + escaped(mark.text) + "</text>\n";
}

}  // namespace

bool isHeadOfSvgPlot(const std::string& head) {
  return head.compare(0, sizeof(kStart) - 1, kStart) == 0 && head.find(kSheet) != std::string::npos;
}

std::string svgOf(const PlotSheet& sheet) {
  std::string out = kStart + format("%.0f\" height=\"%.0f\" viewBox=\"0 0 %.0f %.0f\" ",
                                    sheet.width, sheet.height, sheet.width, sheet.height);
  out += kSheet;
  for (const PlotMark& mark : sheet.marks) {
    switch (mark.kind) {
      case PlotMark::Kind::kStroke:
        out += strokeOf(mark);
        break;
      case PlotMark::Kind::kDot:
        out += dotOf(mark);
        break;
      case PlotMark::Kind::kBox:
        out += boxOf(mark);
        break;
      case PlotMark::Kind::kText:
        out += textOf(mark);
        break;
    }
  }
  return out + "</svg>\n";
}

}  // namespace stipple
