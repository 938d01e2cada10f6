#include "densify/strategy.h"

#include <algorithm>

namespace stipple {

uint64_t scaleSchedule(uint64_t published, uint64_t iterations) {
  constexpr uint64_t kPublished = 30000;
  return std::max<uint64_t>(1, (published * iterations + kPublished / 2) / kPublished);
}

}  // namespace stipple
