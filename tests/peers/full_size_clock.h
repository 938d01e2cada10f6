#pragma once

#include <cstddef>

namespace stipple {

/// On the clock, from any beginning.
double seconds();
/// That this process's threads have worked.
double processorSeconds();

/// Memory of this process, bytes.
struct ProcessMemory {
  size_t own = 0;     ///< pages that no file lies behind
  size_t mapped = 0;  ///< pages of files

  static ProcessMemory now();
};

/// "onednn avx512_core_bf16, 2 threads": what multiplies matrices, and on how many threads.
void printMachine();

}  // namespace stipple
