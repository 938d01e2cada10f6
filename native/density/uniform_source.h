#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/random.h"

namespace stipple {

/// Where sampling gets its uniform numbers from.
class UniformSource {
 public:
  virtual ~UniformSource() = default;
  /// A number in [0, 1) for (use, index); a recorded source gives its next number instead.
  virtual double uniform(RandomUse use, uint64_t index) = 0;
};

/// Numbers keyed by (seed, use, index): independent of the order of the calls.
class KeyedUniformSource final : public UniformSource {
 public:
  explicit KeyedUniformSource(uint64_t seed) : seed_(seed) {}
  double uniform(RandomUse use, uint64_t index) override {
    return unitDouble(keyedBits(seed_, use, index));
  }

 private:
  uint64_t seed_;
};

/// A recorded stream, for test vectors. Errors: kInvalidArgument when it runs out.
class RecordedUniformSource final : public UniformSource {
 public:
  explicit RecordedUniformSource(std::vector<double> values) : values_(std::move(values)) {}
  double uniform(RandomUse use, uint64_t index) override;
  uint64_t drawnCount() const { return next_; }

 private:
  std::vector<double> values_;
  uint64_t next_ = 0;
};

}  // namespace stipple
