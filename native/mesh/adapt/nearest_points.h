#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "math/vec.h"

namespace stipple {

/// Finds the nearest of many points by a k-d tree. Memory: about 40 bytes a point.
class NearestPoints {
 public:
  /// In: points [N,3] finite, N > 0; they must outlive this. Cost: O(N log N), one thread.
  explicit NearestPoints(std::span<const float> points);
  ~NearestPoints();
  /// Index of the nearest point; of equal ones, always the same. May be called by any thread.
  uint32_t nearest(const Vec3d& to) const;

 private:
  struct Tree;
  std::unique_ptr<const Tree> tree_;
};

}  // namespace stipple
