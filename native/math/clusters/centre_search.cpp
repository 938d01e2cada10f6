// The scores against all centres are a matrix product whose rows are looked through at once and
// never stored. Lanes are centres; four vectors share what is loaded.
#include "math/clusters/centre_search.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "math/clusters/centre_search.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace stipple {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, CentreTable::kTile / 2>;
using Ints = hn::Rebind<int32_t, Floats>;
constexpr size_t kRows = 4;

struct Nearest {
  hn::Vec<Floats> first, second;
  hn::Vec<Ints> first_index, second_index;

  HWY_INLINE void take(hn::Vec<Floats> score, hn::Vec<Ints> index) {
    const Ints ints;
    const auto best = hn::Lt(score, first);
    const auto good = hn::Lt(score, second);
    second = hn::IfThenElse(best, first, hn::IfThenElse(good, score, second));
    second_index = hn::IfThenElse(hn::RebindMask(ints, best), first_index,
                                  hn::IfThenElse(hn::RebindMask(ints, good), index, second_index));
    first = hn::IfThenElse(best, score, first);
    first_index = hn::IfThenElse(hn::RebindMask(ints, best), index, first_index);
  }
};

/// The best two of all lanes; of equal scores the lowest index.
HWY_INLINE NearestTwo bestOf(const Nearest& nearest) {
  const Floats d;
  const Ints ints;
  auto scores = nearest.first;
  auto indices = nearest.first_index;
  NearestTwo out;
  for (size_t place = 0; place < 2; ++place) {
    const auto least = hn::MinOfLanes(d, scores);
    const auto is_least = hn::RebindMask(ints, hn::Eq(scores, least));
    const auto none = hn::Set(ints, hwy::HighestValue<int32_t>());
    const auto index = hn::MinOfLanes(ints, hn::IfThenElse(is_least, indices, none));
    out.score[place] = hn::GetLane(least);
    out.index[place] = static_cast<uint32_t>(hn::GetLane(index));
    // In the lane of the first, its second one takes part in the next turn.
    const auto found = hn::And(is_least, hn::Eq(indices, index));
    scores = hn::IfThenElse(hn::RebindMask(d, found), nearest.second, scores);
    indices = hn::IfThenElse(found, nearest.second_index, indices);
  }
  return out;
}

void search(const float* vectors, size_t count, const CentreTable& centres, NearestTwo* out) {
  const Floats d;
  const Ints ints;
  const size_t lanes = hn::Lanes(d);
  const size_t width = centres.width();
  const auto none = hn::Set(d, hwy::HighestValue<float>());
  for (size_t begin = 0; begin < count; begin += kRows) {
    // Past the end, the last vector stands in again.
    const float* rows[kRows];
    for (size_t r = 0; r < kRows; ++r) {
      rows[r] = vectors + (begin + r < count ? begin + r : count - 1) * width;
    }
    Nearest nearest[kRows];
    for (Nearest& of : nearest) {
      of.first = of.second = none;
      of.first_index = of.second_index = hn::Zero(ints);
    }
    for (size_t t = 0; t < centres.tileCount(); ++t) {
      for (size_t from = 0; from < CentreTable::kTile; from += 2 * lanes) {
        const float* tile = centres.tile(t) + from;
        auto a0 = hn::Zero(d), a1 = a0, b0 = a0, b1 = a0, c0 = a0, c1 = a0, e0 = a0, e1 = a0;
        for (size_t k = 0; k < width; ++k, tile += CentreTable::kTile) {
          const auto left = hn::LoadU(d, tile);
          const auto right = hn::LoadU(d, tile + lanes);
          const auto a = hn::Set(d, rows[0][k]);
          a0 = hn::Add(a0, hn::Mul(a, left));
          a1 = hn::Add(a1, hn::Mul(a, right));
          const auto b = hn::Set(d, rows[1][k]);
          b0 = hn::Add(b0, hn::Mul(b, left));
          b1 = hn::Add(b1, hn::Mul(b, right));
          const auto c = hn::Set(d, rows[2][k]);
          c0 = hn::Add(c0, hn::Mul(c, left));
          c1 = hn::Add(c1, hn::Mul(c, right));
          const auto e = hn::Set(d, rows[3][k]);
          e0 = hn::Add(e0, hn::Mul(e, left));
          e1 = hn::Add(e1, hn::Mul(e, right));
        }
        const float* halves = centres.halfSquares(t) + from;
        const auto half_left = hn::LoadU(d, halves);
        const auto half_right = hn::LoadU(d, halves + lanes);
        const auto first = static_cast<int32_t>(t * CentreTable::kTile + from);
        const auto left_index = hn::Iota(ints, first);
        const auto right_index = hn::Iota(ints, first + static_cast<int32_t>(lanes));
        nearest[0].take(hn::Sub(half_left, a0), left_index);
        nearest[0].take(hn::Sub(half_right, a1), right_index);
        nearest[1].take(hn::Sub(half_left, b0), left_index);
        nearest[1].take(hn::Sub(half_right, b1), right_index);
        nearest[2].take(hn::Sub(half_left, c0), left_index);
        nearest[2].take(hn::Sub(half_right, c1), right_index);
        nearest[3].take(hn::Sub(half_left, e0), left_index);
        nearest[3].take(hn::Sub(half_right, e1), right_index);
      }
    }
    for (size_t r = 0; r < kRows && begin + r < count; ++r) out[begin + r] = bestOf(nearest[r]);
  }
}

NamedCentreSearch namedSearch() {
  return {hwy::TargetName(HWY_TARGET), search};
}

}  // namespace HWY_NAMESPACE
}  // namespace stipple
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include <algorithm>
#include <limits>

#include "base/kernel_choice.h"

namespace stipple {

HWY_EXPORT(namedSearch);

CentreTable::CentreTable(const float* rows, size_t count, size_t width)
    : count_(count),
      width_(width),
      coordinates_(tileCount() * kTile * width, 0.0f),
      // Finite: the largest number less any product stays above every score that counts.
      half_squares_(tileCount() * kTile, std::numeric_limits<float>::max()) {
  for (size_t c = 0; c < count; ++c) {
    float* out = &coordinates_[c / kTile * kTile * width + c % kTile];
    float square = 0;
    for (size_t k = 0; k < width; ++k) {
      const float value = rows[c * width + k];
      out[k * kTile] = value;
      square += value * value;
    }
    half_squares_[c] = 0.5f * square;
  }
}

void searchCentresPlainly(const float* vectors, size_t count, const CentreTable& centres,
                          NearestTwo* out) {
  constexpr float kNone = std::numeric_limits<float>::max();
  for (size_t i = 0; i < count; ++i) {
    NearestTwo nearest = {{kNone, kNone}, {0, 0}};
    for (size_t c = 0; c < centres.count(); ++c) {
      const size_t t = c / CentreTable::kTile;
      const size_t at = c % CentreTable::kTile;
      float dot = 0;
      for (size_t k = 0; k < centres.width(); ++k) {
        dot += vectors[i * centres.width() + k] * centres.tile(t)[k * CentreTable::kTile + at];
      }
      const float score = centres.halfSquares(t)[at] - dot;
      if (score < nearest.score[0]) {
        nearest = {{score, nearest.score[0]}, {static_cast<uint32_t>(c), nearest.index[0]}};
      } else if (score < nearest.score[1]) {
        nearest.score[1] = score;
        nearest.index[1] = static_cast<uint32_t>(c);
      }
    }
    out[i] = nearest;
  }
}

namespace {

NamedCentreSearch dispatched() {
  return HWY_DYNAMIC_DISPATCH(namedSearch)();
}

}  // namespace

std::vector<NamedCentreSearch> centreSearches() {
  return onEveryTarget(NamedCentreSearch{"scalar", searchCentresPlainly}, dispatched);
}

CentreSearch chosenCentreSearch() {
  static const CentreSearch chosen = chooseKernel(dispatched(), centreSearches).search;
  return chosen;
}

}  // namespace stipple

#endif  // HWY_ONCE
