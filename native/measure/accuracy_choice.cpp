#include "measure/accuracy_choice.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>

#include "base/error.h"

namespace stipple {

namespace {

std::string numberText(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.4g", value);
  return text;
}

void requireRows(const AccuracyReport& report) {
  if (report.rows.empty())
    fail(ErrorCode::kInvalidArgument, "the report has no rows to choose from");
}

/// "12.4 ms", "3.21 s".
std::string timeText(double seconds) {
  return seconds < 1 ? numberText(seconds * 1e3) + " ms" : numberText(seconds) + " s";
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

}  // namespace stipple
