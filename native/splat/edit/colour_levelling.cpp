#include "splat/edit/colour_levelling.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "base/parallel.h"

namespace stipple {

namespace {

using Cell = HoleRaster::Cell;

constexpr uint32_t kNone = UINT32_MAX;
constexpr size_t kGrain = 16;  ///< rows or columns
/// Deviation of the mean in widths of a patch's half.
constexpr double kMeanReach = 1.5;
constexpr double kMeanSigmas = 2.5;
/// Colours that differ by so much are of two materials rather than of one in two lights.
constexpr double kMaterialStep = 0.1;
/// Mean coverage below which a mean says nothing.
constexpr double kLeastCover = 0.05;
/// Light does not change by more across a hole.
constexpr double kMostAdded = 0.25;
/// Passes over the hole per cell of its width, after which nothing changes by a thousandth any
/// more.
constexpr size_t kPassesPerCell = 3;
constexpr size_t kLeastPasses = 30;

/// Sums of looks under a bell, along rows or columns: `count` cells that are `step` apart.
void blurLine(const CellLook* from, CellLook* to, size_t count, size_t step,
              const std::vector<double>& bell) {
  const auto reach = static_cast<std::ptrdiff_t>(bell.size()) - 1;
  const auto last = static_cast<std::ptrdiff_t>(count) - 1;
  for (std::ptrdiff_t i = 0; i <= last; ++i) {
    CellLook sum = CellLook::Zero();
    for (std::ptrdiff_t k = std::max(-reach, -i); k <= std::min(reach, last - i); ++k) {
      sum += bell[static_cast<size_t>(std::abs(k))] * from[static_cast<size_t>(i + k) * step];
    }
    to[static_cast<size_t>(i) * step] = sum;
  }
}

/// The mean look around each cell, of solid ground; everything else counts as not covered.
std::vector<CellLook> meansOf(const HoleRaster& raster, const std::vector<CellLook>& looks,
                              size_t reach) {
  const double sigma = kMeanReach * static_cast<double>(reach);
  std::vector<double> bell(static_cast<size_t>(kMeanSigmas * sigma) + 1);
  for (size_t k = 0; k < bell.size(); ++k) {
    const double x = static_cast<double>(k) / sigma;
    bell[k] = std::exp(-x * x / 2);
  }
  std::vector<CellLook> ground(looks.size(), CellLook::Zero()), across(looks.size());
  for (size_t i = 0; i < looks.size(); ++i) {
    if (raster.cells[i] == Cell::kSolid) ground[i] = looks[i];
  }
  parallelFor(raster.height, kGrain, [&](size_t begin, size_t end) {
    for (size_t y = begin; y < end; ++y) {
      blurLine(&ground[y * raster.width], &across[y * raster.width], raster.width, 1, bell);
    }
  });
  parallelFor(raster.width, kGrain, [&](size_t begin, size_t end) {
    for (size_t x = begin; x < end; ++x) {
      blurLine(&across[x], &ground[x], raster.height, raster.width, bell);
    }
  });
  double whole = bell[0];
  for (size_t k = 1; k < bell.size(); ++k) whole += 2 * bell[k];
  for (CellLook& look : ground) look /= whole * whole;
  return ground;
}

/// What is known of the ground, and what each cell's copy looks like.
class Ground {
 public:
  Ground(const HoleRaster& raster, std::vector<CellLook> means,
         const std::vector<uint32_t>& sources)
      : raster_(raster), means_(std::move(means)), sources_(sources) {}

  /// How much more has to be added to a cell of the hole than to its neighbour, so that there is no
  /// step between what they show. False where nothing is known of the two.
  /// In: to: one of the four cells beside `from`.
  bool step(size_t from, size_t to, Vec3d& step) const {
    const uint32_t source = sources_[from];
    const std::ptrdiff_t move = offset(from, to);
    if (sources_[to] == kNone) {
      // The ground goes on where the patch would.
      if (raster_.cells[to] != Cell::kSolid) return false;
      const size_t beside = beyond(source, move);
      return difference(to, beside == kNone ? source : beside, step);
    }
    const uint32_t other = sources_[to];
    step = Vec3d::Zero();
    if (static_cast<std::ptrdiff_t>(other) == static_cast<std::ptrdiff_t>(source) + move)
      return true;
    // The mean of what the two patches say of the way from one cell to the other.
    const size_t there = beyond(source, move), back = beyond(other, -move);
    Vec3d one, two;
    const bool has_one = there != kNone && difference(other, there, one);
    const bool has_two = back != kNone && difference(back, source, two);
    if (has_one) step += one;
    if (has_two) step += two;
    if (has_one && has_two) step /= 2;
    return has_one || has_two || difference(other, source, step);
  }

 private:
  std::ptrdiff_t offset(size_t from, size_t to) const {
    return static_cast<std::ptrdiff_t>(to) - static_cast<std::ptrdiff_t>(from);
  }
  /// Colour of `a` less that of `b`. False where too little of one is covered.
  bool difference(size_t a, size_t b, Vec3d& difference) const {
    const CellLook &first = means_[a], &second = means_[b];
    if (first[3] < kLeastCover || second[3] < kLeastCover) return false;
    difference = first.head<3>() / first[3] - second.head<3>() / second[3];
    return true;
  }
  /// The solid cell beside another one, or kNone.
  size_t beyond(size_t cell, std::ptrdiff_t move) const {
    const auto width = static_cast<std::ptrdiff_t>(raster_.width);
    const auto column = static_cast<std::ptrdiff_t>(cell) % width;
    if ((move == 1 && column + 1 == width) || (move == -1 && column == 0)) return kNone;
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(cell) + move;
    if (at < 0 || at >= static_cast<std::ptrdiff_t>(raster_.size())) return kNone;
    const auto found = static_cast<size_t>(at);
    return raster_.cells[found] == Cell::kSolid ? found : size_t{kNone};
  }

  const HoleRaster& raster_;
  std::vector<CellLook> means_;
  const std::vector<uint32_t>& sources_;
};

/// A cell of the hole and what its colour should differ by from those beside it.
struct Unknown {
  uint32_t cell;
  std::array<uint32_t, 4> beside;  ///< cells; kNone: nothing is asked there
  std::array<double, 4> weights;
  std::array<Vec3d, 4> steps;  ///< what is added here beyond what is added there
};

std::vector<Unknown> unknownsOf(const HoleRaster& raster, const Ground& ground,
                                const std::vector<uint32_t>& sources) {
  std::vector<Unknown> unknowns;
  const auto width = static_cast<uint32_t>(raster.width);
  for (uint32_t cell = 0; cell < raster.size(); ++cell) {
    if (sources[cell] == kNone) continue;
    Unknown unknown{cell, {kNone, kNone, kNone, kNone}, {}, {}};
    const uint32_t column = cell % width, row = cell / width;
    const std::array<uint32_t, 4> beside = {
        column > 0 ? cell - 1 : kNone, column + 1 < width ? cell + 1 : kNone,
        row > 0 ? cell - width : kNone, row + 1 < raster.height ? cell + width : kNone};
    for (size_t k = 0; k < 4; ++k) {
      if (beside[k] == kNone || !ground.step(cell, beside[k], unknown.steps[k])) continue;
      unknown.beside[k] = beside[k];
      const double share = unknown.steps[k].norm() / kMaterialStep;
      unknown.weights[k] = 1 / (1 + share * share);
    }
    unknowns.push_back(unknown);
  }
  return unknowns;
}

}  // namespace

std::vector<Vec3d> levelledColours(const HoleRaster& raster, const std::vector<CellLook>& looks,
                                   const std::vector<uint32_t>& sources, size_t reach) {
  std::vector<Vec3d> added(raster.size(), Vec3d::Zero());
  const Ground ground(raster, meansOf(raster, looks, reach), sources);
  const std::vector<Unknown> unknowns = unknownsOf(raster, ground, sources);
  if (unknowns.empty()) return added;
  // Cells beside each other have different parities: all of one are found from the other's, so that
  // their order is of no weight. Steps are taken too far, as Young's theory of over-relaxation
  // says.
  const double across = std::sqrt(static_cast<double>(unknowns.size()));
  const double beyond = 2 / (1 + std::sin(std::numbers::pi / (across + 1)));
  const size_t passes =
      std::max(kLeastPasses, kPassesPerCell * static_cast<size_t>(std::ceil(across)));
  for (size_t pass = 0; pass < 2 * passes; ++pass) {
    parallelFor(unknowns.size(), 4096, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const Unknown& unknown = unknowns[i];
        const size_t parity = unknown.cell % raster.width + unknown.cell / raster.width + pass;
        if (parity % 2 != 0) continue;
        Vec3d sum = Vec3d::Zero();
        double weight = 0;
        for (size_t k = 0; k < 4; ++k) {
          if (unknown.beside[k] == kNone) continue;
          sum += unknown.weights[k] * (added[unknown.beside[k]] + unknown.steps[k]);
          weight += unknown.weights[k];
        }
        if (weight > 0) added[unknown.cell] += beyond * (sum / weight - added[unknown.cell]);
      }
    });
  }
  for (Vec3d& colour : added) colour = colour.cwiseMax(-kMostAdded).cwiseMin(kMostAdded);
  return added;
}

}  // namespace stipple
