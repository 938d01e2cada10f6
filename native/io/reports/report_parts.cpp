#include "io/reports/report_parts.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/number_text.h"
#include "io/bytes/input_file.h"
#include "io/bytes/output_file.h"
#include "io/bytes/output_kind.h"
#include "plot/svg_plot.h"

namespace stipple {

namespace {

/// What tells the kind of a file.
constexpr size_t kHeadBytes = 256;

void requireReportPlace(const std::string& path, const ReportKind& kind) {
  const std::string head = std::string("{\n \"") + kind.key + "\": ";
  requireOutputKind(path, kind.name, [&](const std::string& file) {
    return headOfFile(file, kHeadBytes).find(head) == 0;
  });
}

void requireCurvesPlace(const std::string& path) {
  requireOutputKind(path, "the curves of a report", [](const std::string& file) {
    return isHeadOfSvgPlot(headOfFile(file, kHeadBytes));
  });
}

void writeText(const std::string& text, const std::string& path) {
  OutputFile file(path);
  file.write(text.data(), text.size());
  file.commit();
}

}  // namespace

nlohmann::ordered_json reportNumber(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
}

nlohmann::ordered_json reportNumber(float value) {
  if (!std::isfinite(value)) return nullptr;
  return std::strtod(numberText(static_cast<double>(value)).c_str(), nullptr);
}

std::string curvesPath(const std::string& report_path) {
  return std::filesystem::path(report_path).replace_extension(".svg").string();
}

void requireReportPlaces(const std::string& path, const ReportKind& kind) {
  if (lowerExtension(path) == ".svg") {
    fail(ErrorCode::kInvalidArgument,
         path + " ends in .svg, where the curves of a report go; .json is expected");
  }
  requireReportPlace(path, kind);
  requireCurvesPlace(curvesPath(path));
}

void writeReport(const nlohmann::ordered_json& report, const ReportKind& kind,
                 const std::string& path) {
  requireReportPlace(path, kind);
  writeText(report.dump(1) + "\n", path);
}

void writeCurves(const std::vector<PlotPanel>& panels, const std::string& path) {
  requireCurvesPlace(path);
  writeText(svgOf(sheetOf(panels)), path);
}

PlotLine meanCurve(const char* label, size_t count, size_t point_count,
                   const std::function<double(size_t)>& value) {
  PlotLine line;
  line.label = label;
  const size_t points = std::min(count, point_count);
  for (size_t p = 0; p < points; ++p) {
    const size_t begin = p * count / points, end = (p + 1) * count / points;
    double sum = 0;
    size_t seen = 0;
    for (size_t i = begin; i < end; ++i) {
      const double number = value(i);
      if (!std::isfinite(number)) continue;
      sum += number;
      ++seen;
    }
    line.x.push_back(0.5 * static_cast<double>(begin + 1 + end));
    line.y.push_back(seen > 0 ? sum / static_cast<double>(seen)
                              : std::numeric_limits<double>::quiet_NaN());
  }
  return line;
}

}  // namespace stipple
