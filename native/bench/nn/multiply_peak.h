#pragma once

namespace stipple::bench {

/// Multiplications and additions that this thread makes in a second when nothing else is to be
/// done: fused products of vectors that stay in registers, 12 beside each other, of the best
/// instruction set. Each is two operations.
double peakOperationsPerSecond();

/// The instruction set of that.
const char* peakTarget();

}  // namespace stipple::bench
