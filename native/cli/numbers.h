#pragma once

#include <cstdint>

namespace stipple::cli {

/// A count as it was typed: negative numbers must reach the message as they were. Throws Failure
/// where it is not first...2^40.
uint64_t counted(int64_t value, const char* name, int64_t first = 1);

/// The same; numbers that are too large for 32 bits are left for the library to refuse.
uint32_t counted32(int64_t value, const char* name, int64_t first = 1);

/// Bytes of mebibytes; none of negative ones.
uint64_t bytesOfMebibytes(double mebibytes);

}  // namespace stipple::cli
