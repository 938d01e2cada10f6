// Based on: McIlroy, Bostic and McIlroy, Engineering Radix Sort, Computing Systems 1993 (American
// flag sort for the parts, in place), after one parallel pass into parts by the highest bits.
#include "math/radix_order.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>

#include "base/parallel.h"

namespace stipple {

namespace {

// Below this many, comparing is quicker than counting.
constexpr size_t kFew = 64;
constexpr size_t kGrain = size_t{1} << 16;
constexpr unsigned kPartBits = 10;
constexpr size_t kParts = size_t{1} << kPartBits;
constexpr unsigned kDigitBits = 8;
constexpr size_t kDigits = size_t{1} << kDigitBits;

using Digits = std::array<size_t, kDigits>;

/// Sorts [begin, end), whose keys agree in all bits from `bits` on.
void sortPart(KeyedIndex* begin, KeyedIndex* end, unsigned bits) {
  const auto count = static_cast<size_t>(end - begin);
  if (count <= kFew || bits == 0) {
    std::sort(begin, end);
    return;
  }
  const unsigned shift = bits > kDigitBits ? bits - kDigitBits : 0;
  const auto digitOf = [shift](const KeyedIndex& key) {
    return static_cast<size_t>(key.key >> shift) & (kDigits - 1);
  };
  Digits last{};
  for (const KeyedIndex* key = begin; key != end; ++key) ++last[digitOf(*key)];
  Digits next{};
  for (size_t digit = 1; digit < kDigits; ++digit) {
    next[digit] = last[digit - 1];
    last[digit] += last[digit - 1];
  }
  // Each key that is out of place goes where it belongs and gives the one there its turn.
  for (size_t digit = 0; digit < kDigits; ++digit) {
    while (next[digit] < last[digit]) {
      KeyedIndex held = begin[next[digit]];
      for (size_t to = digitOf(held); to != digit; to = digitOf(held)) {
        std::swap(held, begin[next[to]++]);
      }
      begin[next[digit]++] = held;
    }
  }
  for (size_t digit = 0; digit < kDigits; ++digit) {
    const size_t first = digit == 0 ? 0 : last[digit - 1];
    if (last[digit] - first > 1) sortPart(begin + first, begin + last[digit], shift);
  }
}

}  // namespace

void sortByKey(KeyedIndices& keys) {
  const size_t count = keys.size();
  if (count < kGrain) {
    std::sort(keys.begin(), keys.end());
    return;
  }
  uint64_t all = 0;
  for (const KeyedIndex& key : keys) all |= key.key;
  const auto bits = static_cast<unsigned>(std::bit_width(all));
  const unsigned shift = bits > kPartBits ? bits - kPartBits : 0;
  const auto partOf = [shift](const KeyedIndex& key) {
    return static_cast<size_t>(key.key >> shift);
  };
  // places[range][part]: first how many, then where the next of them goes.
  std::vector<std::array<size_t, kParts>> places(rangeCount(count, kGrain));
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    std::array<size_t, kParts>& counts = places[begin / kGrain];
    counts.fill(0);
    for (size_t i = begin; i < end; ++i) ++counts[partOf(keys[i])];
  });
  std::array<size_t, kParts + 1> first{};
  size_t next = 0;
  for (size_t part = 0; part < kParts; ++part) {
    first[part] = next;
    for (std::array<size_t, kParts>& range : places) {
      const size_t here = range[part];
      range[part] = next;
      next += here;
    }
  }
  first[kParts] = count;
  KeyedIndices parted(count);
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    std::array<size_t, kParts>& places_here = places[begin / kGrain];
    for (size_t i = begin; i < end; ++i) parted[places_here[partOf(keys[i])]++] = keys[i];
  });
  keys.swap(parted);
  parallelFor(kParts, 8, [&](size_t begin, size_t end) {
    for (size_t part = begin; part < end; ++part) {
      sortPart(keys.data() + first[part], keys.data() + first[part + 1], shift);
    }
  });
}

void sortFloats(std::vector<float>& values) {
  constexpr unsigned kBits = 11;
  constexpr size_t kBuckets = size_t{1} << kBits;
  constexpr size_t kPasses = 3;
  if (values.size() < kBuckets) {
    std::sort(values.begin(), values.end());
    return;
  }
  // Bits whose order as whole numbers is that of the floats.
  std::vector<uint32_t> keys(values.size());
  std::vector<std::array<uint32_t, kBuckets>> counts(kPasses);
  for (std::array<uint32_t, kBuckets>& pass : counts) pass.fill(0);
  for (size_t i = 0; i < values.size(); ++i) {
    const auto bits = std::bit_cast<uint32_t>(values[i]);
    keys[i] = bits ^ ((bits >> 31) != 0 ? 0xffffffffu : 0x80000000u);
    for (size_t pass = 0; pass < kPasses; ++pass) {
      ++counts[pass][(keys[i] >> (pass * kBits)) & (kBuckets - 1)];
    }
  }
  std::vector<uint32_t> sorted(values.size());
  for (size_t pass = 0; pass < kPasses; ++pass) {
    uint32_t next = 0;
    for (uint32_t& place : counts[pass]) {
      const uint32_t here = place;
      place = next;
      next += here;
    }
    for (const uint32_t key : keys) {
      sorted[counts[pass][(key >> (pass * kBits)) & (kBuckets - 1)]++] = key;
    }
    keys.swap(sorted);
  }
  for (size_t i = 0; i < values.size(); ++i) {
    values[i] = std::bit_cast<float>(keys[i] ^ ((keys[i] >> 31) != 0 ? 0x80000000u : 0xffffffffu));
  }
}

}  // namespace stipple
