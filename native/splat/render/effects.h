#pragma once

namespace stipple {

/// False in stipple_plain alone, a library for tests that has no effects compiled in: no surface,
/// holdouts, depth, other passes or counts. With all of them off, the full library must draw the
/// same bits in the same time.
#ifdef STIPPLE_PLAIN
constexpr bool kHasEffects = false;
#else
constexpr bool kHasEffects = true;
#endif

}  // namespace stipple
