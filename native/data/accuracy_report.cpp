#include "data/accuracy_report.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "base/error.h"
#include "base/number_text.h"

namespace stipple {

namespace {

void requireRows(const AccuracyReport& report) {
  if (report.rows.empty())
    fail(ErrorCode::kInvalidArgument, "the report has no rows to choose from");
}

struct Words {
  const char* within;  ///< what no setting does
  const char* where;
};

Words wordsOf(AccuracySubject subject) {
  switch (subject) {
    case AccuracySubject::kVolume:
      return {"voxel size fills this volume", "in this volume"};
    case AccuracySubject::kFit:
      return {"measurement of this fit came", "in this fit"};
    default:
      return {"setting draws this view", "in this view"};
  }
}

/// The value below which a share of sorted numbers lies, between two of them in proportion.
double quantile(const std::vector<double>& sorted, double share) {
  const double place = share * static_cast<double>(sorted.size() - 1);
  const size_t below = static_cast<size_t>(place);
  const size_t above = std::min(below + 1, sorted.size() - 1);
  const double rest = place - static_cast<double>(below);
  return sorted[below] * (1 - rest) + sorted[above] * rest;
}

}  // namespace

void markFront(AccuracyReport& report) {
  for (AccuracyRow& row : report.rows) {
    row.is_on_front =
        std::none_of(report.rows.begin(), report.rows.end(), [&](const AccuracyRow& other) {
          return other.seconds <= row.seconds && other.psnr >= row.psnr &&
                 (other.seconds < row.seconds || other.psnr > row.psnr);
        });
  }
}

size_t bestWithin(const AccuracyReport& report, double seconds) {
  requireRows(report);
  if (!(seconds > 0)) {
    fail(ErrorCode::kInvalidArgument,
         "the time budget is " + numberText(seconds) + " s; more than 0 is allowed");
  }
  std::optional<size_t> best;
  size_t cheapest = 0;
  for (size_t i = 0; i < report.rows.size(); ++i) {
    const AccuracyRow& row = report.rows[i];
    if (row.seconds < report.rows[cheapest].seconds) cheapest = i;
    if (row.seconds > seconds) continue;
    const bool is_better =
        !best || row.psnr > report.rows[*best].psnr ||
        (row.psnr == report.rows[*best].psnr && row.seconds < report.rows[*best].seconds);
    if (is_better) best = i;
  }
  if (!best) {
    const AccuracyRow& least = report.rows[cheapest];
    fail(ErrorCode::kInvalidArgument, std::string("no ") + wordsOf(report.subject).within +
                                          " within " + timeText(seconds) + "; the fastest, " +
                                          least.name + ", needs " + timeText(least.seconds));
  }
  return *best;
}

size_t cheapestAbove(const AccuracyReport& report, double psnr) {
  requireRows(report);
  if (!std::isfinite(psnr)) {
    fail(ErrorCode::kInvalidArgument,
         "the PSNR asked for is " + numberText(psnr) + " dB; a finite number is allowed");
  }
  std::optional<size_t> cheapest;
  double best = -std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < report.rows.size(); ++i) {
    const AccuracyRow& row = report.rows[i];
    if (std::isfinite(row.psnr)) best = std::max(best, row.psnr);
    if (!(row.psnr >= psnr)) continue;
    if (!cheapest || row.seconds < report.rows[*cheapest].seconds) cheapest = i;
  }
  if (!cheapest) {
    fail(ErrorCode::kInvalidArgument, "no setting reaches " + numberText(psnr) + " dB " +
                                          wordsOf(report.subject).where + "; the best has " +
                                          numberText(best) + " dB");
  }
  return *cheapest;
}

void setErrors(std::vector<float>& differences, AccuracyRow& row) {
  double squares = 0;
  for (float& value : differences) {
    value = std::abs(value);
    squares += static_cast<double>(value) * static_cast<double>(value);
  }
  if (differences.empty()) return;
  const double mean = squares / static_cast<double>(differences.size());
  row.psnr = mean > 0 ? -10 * std::log10(mean) : std::numeric_limits<double>::infinity();
  row.largest_error =
      static_cast<double>(*std::max_element(differences.begin(), differences.end()));
  const double place = std::ceil(0.999 * static_cast<double>(differences.size())) - 1;
  const auto at = differences.begin() + static_cast<ptrdiff_t>(place);
  std::nth_element(differences.begin(), at, differences.end());
  row.error_99_9 = static_cast<double>(*at);
}

void setSeconds(std::vector<double> times, AccuracyRow& row) {
  std::sort(times.begin(), times.end());
  row.repetitions = static_cast<uint32_t>(times.size());
  row.seconds = quantile(times, 0.5);
  row.seconds_low = quantile(times, 0.25);
  row.seconds_high = quantile(times, 0.75);
}

std::string timeText(double seconds) {
  return seconds < 1 ? numberText(seconds * 1e3, 4) + " ms" : numberText(seconds, 4) + " s";
}

}  // namespace stipple
