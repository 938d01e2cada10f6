#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace stipple {

/// 256 ascending values that stand for many.
struct Codebook {
  std::array<float, 256> values{};
  /// The nearest one; of two as near, the lower.
  uint8_t nearest(float value) const;
};

/// Codebook::nearest with a table that says where to begin: for many values.
class NearestCode {
 public:
  explicit NearestCode(const Codebook& codebook);
  uint8_t operator()(float value) const;

 private:
  static constexpr size_t kBins = 1024;
  size_t binOf(float value) const;

  const Codebook& codebook_;
  float low_;
  float bins_per_value_;
  std::array<uint16_t, kBins> first_;  ///< the first of the codebook in this bin or a later one
};

/// A codebook of small squared error: 1-D k-means of 248 values, from a start that is the best in
/// the limit of many, to a fixed point or 1000 rounds; 8 more halve the widest ranges, which bounds
/// the error of rare values. 256 different values or fewer are kept exactly (the rest of the
/// codebook repeats the last). In: finite values in any order; may be empty. Determinism: no random
/// numbers. Cost: O(n log n).
Codebook makeCodebook(std::vector<float> values);

}  // namespace stipple
