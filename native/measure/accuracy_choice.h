#pragma once

#include <cstddef>

#include "data/accuracy_report.h"

namespace stipple {

/// Sets is_on_front of every row.
void markFront(AccuracyReport& report);

/// The row with the largest PSNR among those of at most `seconds`. Errors: kInvalidArgument, with
/// the least that any row needs, where there is none; for a budget that is not above 0.
size_t bestWithin(const AccuracyReport& report, double seconds);

/// The fastest row of at least `psnr` dB. Errors: kInvalidArgument, with the best that any row but
/// the reference itself has, where there is none.
size_t cheapestAbove(const AccuracyReport& report, double psnr);

}  // namespace stipple
