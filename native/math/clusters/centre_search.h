#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/default_init_vector.h"

namespace stipple {

/// Centres as the search reads them: kTile of them side by side, one coordinate after the other.
class CentreTable {
 public:
  static constexpr size_t kTile = 32;

  CentreTable() = default;
  /// In: rows [count, width].
  CentreTable(const float* rows, size_t count, size_t width);
  size_t count() const { return count_; }
  size_t width() const { return width_; }
  size_t tileCount() const { return (count_ + kTile - 1) / kTile; }
  /// [width, kTile]; zeros where centres end.
  const float* tile(size_t index) const { return coordinates_.data() + index * width_ * kTile; }
  /// [kTile] half of each centre's square; the largest float where centres end.
  const float* halfSquares(size_t index) const { return half_squares_.data() + index * kTile; }

 private:
  size_t count_ = 0;
  size_t width_ = 0;
  std::vector<float> coordinates_;
  std::vector<float> half_squares_;
};

/// The two nearest centres of a vector, of equal ones the first. Scores: half the squared distance
/// less half the square of the vector; the largest float, with the index 0, where there is none.
struct NearestTwo {
  float score[2];
  uint32_t index[2];
};

/// In: vectors [count, centres.width()]; out [count]. The same numbers on every instruction set:
/// products and sums are rounded one by one, in the order of the coordinates.
using CentreSearch = void (*)(const float* vectors, size_t count, const CentreTable& centres,
                              NearestTwo* out);
struct NamedCentreSearch {
  const char* target;
  CentreSearch search;
};

/// The plain loop that defines the result.
void searchCentresPlainly(const float* vectors, size_t count, const CentreTable& centres,
                          NearestTwo* out);

/// The search for this processor, or what STIPPLE_FORCE_TARGET names.
CentreSearch chosenCentreSearch();

/// The plain loop and every instruction set that runs on this processor. It changes Highway's
/// global choice for a moment: for tests and for STIPPLE_FORCE_TARGET.
std::vector<NamedCentreSearch> centreSearches();

}  // namespace stipple
