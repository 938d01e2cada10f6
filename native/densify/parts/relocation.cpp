// Based on: Kheradmand, Rebain, Sharma, Sun, Tseng, Isack, Kar, Tagliasacchi, Yi, 3D Gaussian
// Splatting as Markov Chain Monte Carlo, NeurIPS 2024, section 3.3 and its appendix. Differs: the
// alternating binomial sum of the scale is evaluated as the integral that it comes from, which
// cancels nothing, needs no table and has no largest number of copies.

#include "densify/parts/relocation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "base/parallel.h"
#include "base/random.h"

namespace stipple {

namespace {

/// Ends of opacities after relocation, as published: 1 - 2^-23 is the largest float32 below 1 minus
/// one place, and what is fainter than 0.005 counts as dead.
constexpr double kLeastOpacity = 0.005;
constexpr double kGreatestLogit = 15.942385;  // of 1 - 2^-23

/// The trapezoidal rule on [-6.5, 6.5] with 64 panels: integrands that fall like exp(-x^2) are
/// analytic and have no ends there, so that it is exact but for about 1e-11.
constexpr double kEnd = 6.5;
constexpr size_t kHalfPanels = 32;
constexpr double kStep = kEnd / static_cast<double>(kHalfPanels);
constexpr double kRootOfPi = 1.7724538509055160;

/// exp(-x^2) at the right half's places.
const std::array<double, kHalfPanels + 1>& bell() {
  static const std::array<double, kHalfPanels + 1> values = [] {
    std::array<double, kHalfPanels + 1> made;
    for (size_t k = 0; k <= kHalfPanels; ++k) {
      const double x = static_cast<double>(k) * kStep;
      made[k] = std::exp(-x * x);
    }
    return made;
  }();
  return values;
}

/// (1 / sqrt(pi)) times the integral of 1 - (1 - o exp(-x^2))^count.
double compositeIntegral(double opacity, double count) {
  double sum = 0;
  for (size_t k = 0; k <= kHalfPanels; ++k) {
    const double value = -std::expm1(count * std::log1p(-opacity * bell()[k]));
    sum += k == 0 || k == kHalfPanels ? 0.5 * value : value;
  }
  return 2 * kStep * sum / kRootOfPi;
}

double opacityOf(double logit) {
  const double small = std::exp(-std::abs(logit));
  return (logit >= 0 ? 1.0 : small) / (1 + small);
}

RowWrite writeOf(const std::vector<uint32_t>& rows, RawArray array, bool clear_moments,
                 const std::vector<float>& values) {
  RowWrite write;
  write.array = array;
  write.rows = rows;
  write.values = values;
  write.clear_moments = clear_moments;
  return write;
}

}  // namespace

RelocationShare relocationShare(float given, uint64_t count) {
  // Below -80 an opacity counts for nothing, and the quotient of two of them is still a number.
  const double logit = std::clamp(static_cast<double>(given), -80.0, kGreatestLogit);
  if (count <= 1) return {opacityOf(logit), logit, 0};
  const double n = static_cast<double>(count);
  // -ln(1 - o) of each copy.
  const double depth = (std::max(logit, 0.0) + std::log1p(std::exp(-std::abs(logit)))) / n;
  RelocationShare share;
  share.opacity = -std::expm1(-depth);
  share.logit = std::log(share.opacity) + depth;
  share.log_shrink = std::log(opacityOf(logit) / compositeIntegral(share.opacity, n));
  return share;
}

RelocatedSplats::RelocatedSplats(const RawSplats& splats)
    : splats_(splats),
      origins_(splats.size()),
      logits_(splats.logits),
      log_scales_(splats.log_scales),
      draw_counts_(splats.size(), 0),
      has_moved_(splats.size(), 0) {
  for (uint32_t i = 0; i < origins_.size(); ++i) origins_[i] = i;
}

void RelocatedSplats::moveDead(const FitMoment& moment, double dead_opacity) {
  const float dead_logit = rawOpacity(static_cast<float>(dead_opacity));
  std::vector<uint32_t> dead;
  std::vector<double> weights(logits_.size(), 0.0);
  for (uint32_t i = 0; i < logits_.size(); ++i) {
    if (logits_[i] <= dead_logit) {
      dead.push_back(i);
    } else {
      weights[i] = opacityOf(static_cast<double>(logits_[i]));
    }
  }
  const std::vector<uint32_t> drawn =
      drawWithReplacement(moment, RandomUse::kRelocation, 0, weights, dead.size());
  if (drawn.empty()) return;
  shareOut(drawn);
  for (size_t k = 0; k < dead.size(); ++k) {
    const uint32_t to = dead[k], from = drawn[k];
    origins_[to] = origins_[from];
    logits_[to] = logits_[from];
    std::copy_n(&log_scales_[from * 3], 3, &log_scales_[to * 3]);
    has_moved_[to] = 1;
  }
}

void RelocatedSplats::appendCopies(const FitMoment& moment, size_t count, RawSplats& append) {
  if (count == 0) return;
  std::vector<double> weights(logits_.size());
  for (size_t i = 0; i < weights.size(); ++i) {
    weights[i] = opacityOf(static_cast<double>(logits_[i]));
  }
  const std::vector<uint32_t> drawn =
      drawWithReplacement(moment, RandomUse::kBirthChoice, 0, weights, count);
  shareOut(drawn);
  append = rowsOf(drawn);
}

/// Splats that are drawn, and copies of them that follow, share what the splats were.
void RelocatedSplats::shareOut(const std::vector<uint32_t>& drawn) {
  std::vector<uint32_t> rows = drawn;
  std::sort(rows.begin(), rows.end());
  std::vector<std::pair<uint32_t, uint32_t>> times;  // row, draws
  for (const uint32_t row : rows) {
    if (times.empty() || times.back().first != row) times.push_back({row, 0});
    ++times.back().second;
  }
  const float least_logit = rawOpacity(static_cast<float>(kLeastOpacity));
  parallelFor(times.size(), 256, [&](size_t begin, size_t end) {
    for (size_t k = begin; k < end; ++k) {
      const auto [row, draws] = times[k];
      const RelocationShare share = relocationShare(logits_[row], uint64_t{draws} + 1);
      // After the scale: a share of a limited opacity would shrink what is faint for nothing.
      logits_[row] = std::max(static_cast<float>(share.logit), least_logit);
      for (size_t axis = 0; axis < 3; ++axis) {
        log_scales_[row * 3 + axis] += static_cast<float>(share.log_shrink);
      }
      draw_counts_[row] += draws;
    }
  });
}

RawSplats RelocatedSplats::rowsOf(const std::vector<uint32_t>& rows) const {
  std::vector<uint32_t> from(rows.size());
  for (size_t k = 0; k < rows.size(); ++k) from[k] = origins_[rows[k]];
  RawSplats chosen = stipple::rowsOf(splats_, from);
  for (size_t k = 0; k < rows.size(); ++k) {
    chosen.logits[k] = logits_[rows[k]];
    std::copy_n(&log_scales_[rows[k] * 3], 3, &chosen.log_scales[k * 3]);
  }
  return chosen;
}

void RelocatedSplats::write(SplatEdit& edit) const {
  std::vector<uint32_t> drawn, moved;
  for (uint32_t i = 0; i < origins_.size(); ++i) {
    if (draw_counts_[i] > 0) {
      drawn.push_back(i);
    } else if (has_moved_[i]) {
      moved.push_back(i);
    }
  }
  for (const bool clears : {true, false}) {
    const std::vector<uint32_t>& rows = clears ? drawn : moved;
    if (rows.empty()) continue;
    const RawSplats now = rowsOf(rows);
    for (size_t i = 0; i < arrayCount(now); ++i) {
      const RawArray array = static_cast<RawArray>(i);
      if (rowLength(now, array) == 0) continue;
      edit.writes.push_back(writeOf(rows, array, clears, arrayOf(now, array)));
    }
  }
}

}  // namespace stipple
