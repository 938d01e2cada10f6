#include "io/splats/cloud_parts.h"

#include <algorithm>
#include <array>
#include <limits>

#include "base/parallel.h"
#include "math/morton.h"
#include "math/radix_order.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 4096;

void addValues(std::vector<float>& to, const std::vector<float>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

}  // namespace

SplatCloud joined(const std::vector<SplatCloud>& parts) {
  SplatCloud all;
  all.colour_space = parts.front().colour_space;
  all.antialias = parts.front().antialias;
  all.frame = parts.front().frame;
  for (const SplatCloud& part : parts) all.sh_degree = std::max(all.sh_degree, part.sh_degree);
  for (const SplatCloud& part : parts) {
    addValues(all.positions, part.positions);
    addValues(all.rotations, part.rotations);
    addValues(all.scales, part.scales);
    addValues(all.opacities, part.opacities);
    const size_t from = part.shStride();
    const size_t to = all.shStride();
    const size_t first = all.sh.size();
    all.sh.resize(first + part.size() * to, 0.0f);
    for (size_t i = 0; i < part.size(); ++i) {
      std::copy_n(&part.sh[i * from], from, &all.sh[first + i * to]);
    }
  }
  return all;
}

SplatCloud gathered(const SplatCloud& cloud, const uint32_t* indices, size_t count) {
  SplatCloud some;
  some.sh_degree = cloud.sh_degree;
  some.colour_space = cloud.colour_space;
  some.antialias = cloud.antialias;
  some.frame = cloud.frame;
  some.resize(count);
  const size_t stride = cloud.shStride();
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    for (size_t k = begin; k < end; ++k) {
      const size_t i = indices[k];
      std::copy_n(&cloud.positions[i * 3], 3, &some.positions[k * 3]);
      std::copy_n(&cloud.rotations[i * 4], 4, &some.rotations[k * 4]);
      std::copy_n(&cloud.scales[i * 3], 3, &some.scales[k * 3]);
      some.opacities[k] = cloud.opacities[i];
      std::copy_n(&cloud.sh[i * stride], stride, &some.sh[k * stride]);
    }
  });
  return some;
}

void sortAlongMortonCurve(const std::vector<float>& positions, uint32_t* indices, size_t count) {
  if (count == 0) return;
  std::array<double, 3> low;
  std::array<double, 3> side;
  for (size_t axis = 0; axis < 3; ++axis) {
    double high = -std::numeric_limits<double>::infinity();
    low[axis] = -high;
    for (size_t k = 0; k < count; ++k) {
      const double value = static_cast<double>(positions[indices[k] * size_t{3} + axis]);
      low[axis] = std::min(low[axis], value);
      high = std::max(high, value);
    }
    side[axis] = high - low[axis];
  }
  constexpr double kCells = (1 << 21) - 1;
  KeyedIndices keys(count);
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    for (size_t k = begin; k < end; ++k) {
      uint32_t cell[3];
      for (size_t axis = 0; axis < 3; ++axis) {
        const double value = static_cast<double>(positions[indices[k] * size_t{3} + axis]);
        const double share = side[axis] > 0 ? (value - low[axis]) / side[axis] : 0.0;
        cell[axis] = static_cast<uint32_t>(share * kCells);
      }
      keys[k] = {mortonEncode(cell[0], cell[1], cell[2]), indices[k]};
    }
  });
  sortByKey(keys);
  for (size_t k = 0; k < count; ++k) indices[k] = keys[k].index;
}

}  // namespace stipple
