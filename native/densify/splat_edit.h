#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "densify/raw_splats.h"

namespace stipple {

/// New numbers for some splats in one array.
struct RowWrite {
  RawArray array = RawArray::kPositions;
  std::vector<uint32_t> rows;  ///< each at most once
  std::vector<float> values;   ///< [rows, row length]
  bool clear_moments = false;  ///< also both moments of these numbers become 0
};

/// What a strategy wants done to the splats of a fit, as lists and new rows, so that whoever holds
/// the splats can do it where they are. In this order: writes, then keep, then append. Parameters
/// and moments of a splat stay together.
struct SplatEdit {
  std::vector<RowWrite> writes;
  /// The splats that stay, in the order in which they then stand; one that is named twice is
  /// copied, moments too. Absent: all stay.
  std::optional<std::vector<uint32_t>> keep;
  RawSplats append;  ///< at the end, with moments of 0; no splats: nothing
};

/// Refuses an edit that does not fit splats like these: rows that are not there or are named twice
/// in a write, values of another number, numbers that are not finite, appended splats of another
/// degree or whose arrays disagree, more than 2^32 - 1 splats.
void validate(const SplatEdit& edit, const RawSplats& splats);

/// Applies an edit that validate() accepts. In: moments: whether these are moments, whose numbers
/// are cleared where they are asked to be, and 0 for new splats.
void applyEdit(const SplatEdit& edit, bool moments, RawSplats& splats);

}  // namespace stipple
