#include "data/clouds/cloud_selection.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "math/affine.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 16384;

/// Copies the rows [stride] of the chosen splats.
void gather(const std::vector<float>& from, size_t stride, const std::vector<size_t>& chosen,
            std::vector<float>& to) {
  to.resize(chosen.size() * stride);
  parallelFor(chosen.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      std::copy_n(from.begin() + static_cast<std::ptrdiff_t>(chosen[i] * stride), stride,
                  to.begin() + static_cast<std::ptrdiff_t>(i * stride));
    }
  });
}

/// Indices of the splats whose mask is not 0.
std::vector<size_t> chosenBy(const SplatCloud& cloud, std::span<const uint8_t> mask) {
  validateSizes(cloud, "cloud");
  if (mask.size() != cloud.size()) {
    fail(ErrorCode::kInvalidArgument, "mask holds " + std::to_string(mask.size()) +
                                          " values; the cloud has " + std::to_string(cloud.size()) +
                                          " splats, one each is needed");
  }
  std::vector<size_t> chosen;
  for (size_t i = 0; i < mask.size(); ++i) {
    if (mask[i]) chosen.push_back(i);
  }
  return chosen;
}

}  // namespace

void invertMask(std::vector<uint8_t>& mask) {
  for (uint8_t& value : mask) value ^= 1;
}

uint64_t selectedCount(std::span<const uint8_t> mask) {
  uint64_t count = 0;
  for (const uint8_t value : mask) count += value;
  return count;
}

std::vector<uint8_t> insideBox(const SplatCloud& cloud, const Mat4d& cloud_to_box) {
  validate(cloud, "cloud");
  validateAffine(cloud_to_box, "cloud_to_box");
  const Mat3d linear = linearPart(cloud_to_box);
  const Vec3d move = translationPart(cloud_to_box);
  std::vector<uint8_t> mask(cloud.size());
  parallelFor(cloud.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const float* p = &cloud.positions[i * 3];
      const Vec3d at = linear * Vec3d(static_cast<double>(p[0]), static_cast<double>(p[1]),
                                      static_cast<double>(p[2])) +
                       move;
      mask[i] = at.cwiseAbs().maxCoeff() <= 1.0 ? 1 : 0;
    }
  });
  return mask;
}

std::vector<float> selectedPositions(const SplatCloud& cloud, std::span<const uint8_t> mask,
                                     size_t most) {
  std::vector<size_t> chosen = chosenBy(cloud, mask);
  const size_t count = std::min(chosen.size(), most);
  // A row's source is never before it, so that the list can be thinned where it is.
  for (size_t k = 0; k < count; ++k) chosen[k] = chosen[k * chosen.size() / count];
  chosen.resize(count);
  std::vector<float> positions;
  gather(cloud.positions, 3, chosen, positions);
  return positions;
}

std::vector<uint8_t> thinningMask(size_t total, size_t count, uint64_t seed) {
  if (count > total) {
    fail(ErrorCode::kInvalidArgument, "count is " + std::to_string(count) + "; the cloud has " +
                                          std::to_string(total) +
                                          " splats, at most as many can be kept");
  }
  if (count == total) return std::vector<uint8_t>(total, 1);
  std::vector<uint8_t> mask(total, 0);
  if (count == 0) return mask;
  std::vector<uint64_t> keys(total);
  parallelFor(total, kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) keys[i] = keyedBits(seed, RandomUse::kThinning, i);
  });
  // Keys are a permutation of 64-bit numbers, so none is there twice and the limit keeps exactly
  // count of them.
  std::vector<uint64_t> sorted = keys;
  const auto last = sorted.begin() + static_cast<std::ptrdiff_t>(count - 1);
  std::nth_element(sorted.begin(), last, sorted.end());
  const uint64_t limit = *last;
  for (size_t i = 0; i < total; ++i) mask[i] = keys[i] <= limit ? 1 : 0;
  return mask;
}

SplatCloud thinned(const SplatCloud& cloud, size_t count, uint64_t seed) {
  SplatCloud result = kept(cloud, thinningMask(cloud.size(), count, seed));
  if (count == cloud.size() || count == 0) return result;
  const auto wider =
      static_cast<float>(std::cbrt(static_cast<double>(cloud.size()) / static_cast<double>(count)));
  for (float& scale : result.scales) scale *= wider;
  return result;
}

SplatCloud kept(const SplatCloud& cloud, std::span<const uint8_t> mask) {
  const std::vector<size_t> chosen = chosenBy(cloud, mask);
  SplatCloud result;
  result.sh_degree = cloud.sh_degree;
  result.colour_space = cloud.colour_space;
  result.antialias = cloud.antialias;
  result.frame = cloud.frame;
  gather(cloud.positions, 3, chosen, result.positions);
  gather(cloud.rotations, 4, chosen, result.rotations);
  gather(cloud.scales, 3, chosen, result.scales);
  gather(cloud.opacities, 1, chosen, result.opacities);
  gather(cloud.sh, cloud.shStride(), chosen, result.sh);
  return result;
}

}  // namespace stipple
