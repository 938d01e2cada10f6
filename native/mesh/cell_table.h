#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace stipple {

/// Occupied cells of a grid of side 2^level, over elements that are sorted by Morton code: the run
/// of elements of each cell and a lookup from code to run.
class CellTable {
 public:
  static constexpr uint32_t kNone = UINT32_MAX;
  static constexpr int kMaxBitmapLevel = 8;

  CellTable() = default;
  /// In: sorted codes [N] at a level; cell of an element = code >> shift. `level` is that of the
  /// cells.
  CellTable(std::span<const uint64_t> sorted_codes, int shift, int level);

  size_t size() const { return codes_.size(); }
  uint64_t code(size_t cell) const { return codes_[cell]; }
  uint32_t begin(size_t cell) const { return begins_[cell]; }
  uint32_t end(size_t cell) const { return begins_[cell + 1]; }
  /// The cell with this code, or kNone.
  uint32_t find(uint64_t code) const;
  /// The occupied ones of the 27 cells around and at `code`; returns how many.
  size_t neighbours(uint64_t code, std::array<uint32_t, 27>& out) const;

 private:
  std::vector<uint64_t> codes_;
  std::vector<uint32_t> begins_;
  std::vector<uint32_t> slots_;  ///< open addressing, power-of-two size, at most half full
  /// One bit per cell of the whole grid, in Morton order, up to kMaxBitmapLevel (2 MB): most
  /// lookups are of empty cells and end here.
  std::vector<uint64_t> occupied_;
  uint64_t mask_ = 0;
  uint32_t side_ = 1;
};

/// Order of keys, ascending and stable. Cost: O(N) (radix sort of the low `bits` bits).
std::vector<uint32_t> sortedOrder(std::span<const uint64_t> keys, int bits);

}  // namespace stipple
