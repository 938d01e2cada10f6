#pragma once

#include <cstddef>
#include <cstdint>

namespace stipple::platform {

/// The large pages that advice is about.
constexpr size_t kHugePageBytes = size_t{2} << 20;

/// Memory that begins at a large page, on large pages where the system has them. In: bytes: a
/// multiple of kHugePageBytes. Returns: null where there is not enough.
void* allocateOnHugePages(size_t bytes);
void freeHugePages(void* memory);
/// Advice that the pages of a range be large ones. In: memory: at the begin of one.
void adviseHugePages(void* memory, size_t bytes);
/// Gives the range its memory now, as the first write to each page would.
void populatePages(void* memory, size_t bytes);

/// Bytes of main memory; where the system does not tell, as many as can be named.
uint64_t machineMemory();

}  // namespace stipple::platform
