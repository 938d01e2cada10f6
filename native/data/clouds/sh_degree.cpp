#include "data/clouds/sh_degree.h"

#include <algorithm>

#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 4096;

}  // namespace

SplatCloud withShDegree(const SplatCloud& cloud, int degree) {
  if (cloud.sh_degree == degree) return cloud;
  SplatCloud copy;
  copy.sh_degree = degree;
  copy.colour_space = cloud.colour_space;
  copy.antialias = cloud.antialias;
  copy.frame = cloud.frame;
  copy.positions = cloud.positions;
  copy.rotations = cloud.rotations;
  copy.scales = cloud.scales;
  copy.opacities = cloud.opacities;
  const size_t before = cloud.shStride();
  const size_t after = copy.shStride();
  copy.sh.resize(cloud.size() * after);
  parallelFor(cloud.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      std::copy_n(&cloud.sh[i * before], std::min(before, after), &copy.sh[i * after]);
    }
  });
  return copy;
}

}  // namespace stipple
