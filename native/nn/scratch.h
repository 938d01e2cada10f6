#pragma once

#include <cstddef>

#include "base/default_init_vector.h"

namespace stipple {

/// Room for numbers while an object of this lives. What it says is left from before; memory comes
/// from a store of those that nobody uses, because fresh pages cost as much as a tenth of a layer.
/// The store keeps at most kMostIdle floats.
class Scratch {
 public:
  static constexpr size_t kMostIdle = size_t{1} << 24;

  explicit Scratch(size_t count);
  ~Scratch();
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  /// At a cache line.
  float* data() { return line_; }
  const float* data() const { return line_; }

 private:
  void findLine();

  DefaultInitVector<float> values_;
  float* line_ = nullptr;
};

}  // namespace stipple
