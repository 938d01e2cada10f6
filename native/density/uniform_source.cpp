#include "density/uniform_source.h"

#include <string>

#include "base/error.h"

namespace stipple {

double RecordedUniformSource::uniform(RandomUse, uint64_t) {
  if (next_ >= values_.size()) {
    fail(ErrorCode::kInvalidArgument,
         "the recorded stream of random numbers is at its end: it has " +
             std::to_string(values_.size()) + " numbers and one more was asked for");
  }
  const double value = values_[next_++];
  if (!(value >= 0.0 && value < 1.0)) {
    fail(ErrorCode::kInvalidArgument, "recorded random number " + std::to_string(next_ - 1) +
                                          " is " + std::to_string(value) +
                                          "; allowed is 0 up to below 1");
  }
  return value;
}

}  // namespace stipple
