#include "data/clouds/cloud_columns.h"

#include <algorithm>
#include <cstring>

#include "base/parallel.h"

namespace stipple {

namespace {

// Splats of a task, and of a block whose harmonics (192 bytes each at degree 3) stay in the first
// cache while its columns are gone through one by one.
constexpr size_t kGrain = 16384;
constexpr size_t kBlock = 128;

/// body(begin, end) for every block of the cloud, on all threads.
template <class Body>
void forBlocks(size_t count, const Body& body) {
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    for (size_t first = begin; first < end; first += kBlock) {
      body(first, std::min(first + kBlock, end));
    }
  });
}

void copyRows(const float* from, float* to, size_t width, size_t begin, size_t end) {
  std::memcpy(to + begin * width, from + begin * width, (end - begin) * width * sizeof(float));
}

/// Rows of three floats between arrays whose rows are `from_stride` and `to_stride` floats apart.
void copyThrees(const float* from, size_t from_stride, float* to, size_t to_stride, size_t count) {
  for (size_t i = 0; i < count; ++i) {
    for (size_t k = 0; k < 3; ++k) to[i * to_stride + k] = from[i * from_stride + k];
  }
}

}  // namespace

SplatCloud cloudFromColumns(const CloudColumns<const float>& columns, size_t count, int sh_degree) {
  SplatCloud cloud;
  cloud.sh_degree = sh_degree;
  cloud.resize(count);
  const size_t stride = cloud.shStride();
  forBlocks(count, [&](size_t begin, size_t end) {
    copyRows(columns.positions, cloud.positions.data(), 3, begin, end);
    copyRows(columns.rotations, cloud.rotations.data(), 4, begin, end);
    copyRows(columns.scales, cloud.scales.data(), 3, begin, end);
    float* sh = cloud.sh.data() + begin * stride;
    copyThrees(columns.base + begin * 4, 4, sh, stride, end - begin);
    for (size_t i = begin; i < end; ++i) cloud.opacities[i] = columns.base[i * 4 + 3];
    for (size_t k = 1; k * 3 < stride; ++k) {
      copyThrees(columns.rest[k - 1] + begin * 3, 3, sh + k * 3, stride, end - begin);
    }
  });
  return cloud;
}

void readColumns(const SplatCloud& cloud, const CloudColumns<float>& columns) {
  const size_t stride = cloud.shStride();
  forBlocks(cloud.size(), [&](size_t begin, size_t end) {
    if (columns.positions) copyRows(cloud.positions.data(), columns.positions, 3, begin, end);
    if (columns.rotations) copyRows(cloud.rotations.data(), columns.rotations, 4, begin, end);
    if (columns.scales) copyRows(cloud.scales.data(), columns.scales, 3, begin, end);
    const float* sh = cloud.sh.data() + begin * stride;
    if (columns.base) {
      copyThrees(sh, stride, columns.base + begin * 4, 4, end - begin);
      for (size_t i = begin; i < end; ++i) columns.base[i * 4 + 3] = cloud.opacities[i];
    }
    for (size_t k = 1; k <= kMaxShColumns; ++k) {
      float* rest = columns.rest[k - 1];
      if (!rest) continue;
      if (k * 3 < stride) {
        copyThrees(sh + k * 3, stride, rest + begin * 3, 3, end - begin);
      } else {
        std::fill(rest + begin * 3, rest + end * 3, 0.0f);
      }
    }
  });
}

}  // namespace stipple
