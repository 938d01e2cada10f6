#include "mesh/cell_table.h"

#include <bit>
#include <numeric>

#include "base/random.h"
#include "math/morton.h"

namespace stipple {

CellTable::CellTable(std::span<const uint64_t> sorted_codes, int shift, int level)
    : side_(uint32_t{1} << level) {
  // Counted first: a table that grows as it is filled would take up to three times its memory.
  size_t count = sorted_codes.empty() ? 0 : 1;
  for (size_t i = 1; i < sorted_codes.size(); ++i) {
    count += sorted_codes[i] >> shift != sorted_codes[i - 1] >> shift ? 1 : 0;
  }
  codes_.reserve(count);
  begins_.reserve(count + 1);
  for (size_t i = 0; i < sorted_codes.size(); ++i) {
    const uint64_t code = sorted_codes[i] >> shift;
    if (codes_.empty() || code != codes_.back()) {
      codes_.push_back(code);
      begins_.push_back(static_cast<uint32_t>(i));
    }
  }
  begins_.push_back(static_cast<uint32_t>(sorted_codes.size()));
  slots_.assign(std::bit_ceil(codes_.size() * 2 + 2), kNone);
  mask_ = slots_.size() - 1;
  for (size_t cell = 0; cell < codes_.size(); ++cell) {
    uint64_t slot = mixBits(codes_[cell]) & mask_;
    while (slots_[slot] != kNone) slot = (slot + 1) & mask_;
    slots_[slot] = static_cast<uint32_t>(cell);
  }
  if (level <= kMaxBitmapLevel) {
    occupied_.assign((size_t{1} << (3 * level)) / 64 + 1, 0);
    for (const uint64_t code : codes_) occupied_[code / 64] |= uint64_t{1} << (code % 64);
  }
}

uint32_t CellTable::find(uint64_t code) const {
  if (slots_.empty()) return kNone;
  if (!occupied_.empty() && (occupied_[code / 64] >> (code % 64) & 1) == 0) return kNone;
  uint64_t slot = mixBits(code) & mask_;
  while (slots_[slot] != kNone) {
    if (codes_[slots_[slot]] == code) return slots_[slot];
    slot = (slot + 1) & mask_;
  }
  return kNone;
}

size_t CellTable::neighbours(uint64_t code, std::array<uint32_t, 27>& out) const {
  const std::array<uint32_t, 3> centre = mortonDecode(code);
  // Bits of the three coordinates below, at and above the centre, per axis; absent ones are
  // skipped.
  uint64_t bits[3][3];
  bool present[3][3];
  for (size_t axis = 0; axis < 3; ++axis) {
    for (size_t step = 0; step < 3; ++step) {
      const int64_t coordinate =
          static_cast<int64_t>(centre[axis]) + static_cast<int64_t>(step) - 1;
      present[axis][step] = coordinate >= 0 && coordinate < side_;
      bits[axis][step] =
          present[axis][step] ? spreadBits3(static_cast<uint64_t>(coordinate)) << axis : 0;
    }
  }
  size_t count = 0;
  for (size_t z = 0; z < 3; ++z) {
    for (size_t y = 0; y < 3; ++y) {
      for (size_t x = 0; x < 3; ++x) {
        if (!present[0][x] || !present[1][y] || !present[2][z]) continue;
        const uint32_t cell = find(bits[0][x] | bits[1][y] | bits[2][z]);
        if (cell != kNone) out[count++] = cell;
      }
    }
  }
  return count;
}

std::vector<uint32_t> sortedOrder(std::span<const uint64_t> keys, int bits) {
  constexpr int kDigitBits = 11;
  constexpr uint64_t kDigitMask = (uint64_t{1} << kDigitBits) - 1;
  std::vector<uint32_t> order(keys.size());
  std::iota(order.begin(), order.end(), 0u);
  std::vector<uint32_t> next(keys.size());
  for (int shift = 0; shift < bits; shift += kDigitBits) {
    std::array<uint32_t, size_t{1} << kDigitBits> offsets{};
    for (const uint64_t key : keys) ++offsets[(key >> shift) & kDigitMask];
    uint32_t sum = 0;
    for (uint32_t& offset : offsets) {
      const uint32_t count = offset;
      offset = sum;
      sum += count;
    }
    for (const uint32_t i : order) next[offsets[(keys[i] >> shift) & kDigitMask]++] = i;
    order.swap(next);
  }
  return order;
}

}  // namespace stipple
