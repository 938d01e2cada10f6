#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "densify/raw_splats.h"

namespace stipple {

/// New numbers for some splats in one array.
struct RowWrite {
  RawArray array = RawArray::kPositions;  ///< or extraArray()
  std::vector<uint32_t> rows;             ///< each at most once
  std::vector<float> values;              ///< [rows, row length]
  bool clear_moments = false;             ///< also both moments of these numbers become 0
};

/// What a strategy wants done to the splats of a fit, as lists and new rows, so that whoever holds
/// the splats can do it where they are. In this order: writes, then keep, then append. Parameters
/// and moments of a splat stay together.
struct SplatEdit {
  std::vector<RowWrite> writes;
  /// The splats that stay, in the order in which they then stand; one that is named twice is
  /// copied, moments too. Absent: all stay. Rising lists are the cheapest.
  std::optional<std::vector<uint32_t>> keep;
  RawSplats append;  ///< at the end, with moments of 0, extras too; no splats: nothing

  /// How many splats there are after it.
  size_t countAfter(size_t count) const { return (keep ? keep->size() : count) + append.size(); }
};

/// Refuses an edit that does not fit splats like these: rows that are not there or are named twice
/// in a write, values of another number, numbers that are not finite, appended splats of another
/// degree or of other extras or whose arrays disagree, more than 2^32 - 1 splats.
void validate(const SplatEdit& edit, const RawSplats& splats);

/// Something of as many rows as the splats have.
struct EditTarget {
  RawSplats* splats = nullptr;
  /// Moments and the like: cleared where a write says so, and 0 for new splats.
  bool is_moments = false;
};

/// Applies an edit that validate() accepts to all of them, or, where memory is short, to none.
/// Same result for any number of threads. Cost: reads and writes what moves; arrays that grow take
/// a quarter more than they need, so that most edits allocate nothing.
void applyEdit(const SplatEdit& edit, std::span<const EditTarget> targets);

}  // namespace stipple
