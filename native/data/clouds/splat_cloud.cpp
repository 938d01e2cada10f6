#include "data/clouds/splat_cloud.h"

#include <atomic>
#include <bit>
#include <cmath>
#include <cstdint>
#include <string>

#include "base/error.h"
#include "base/fresh_memory.h"
#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 8192;

void requireSize(size_t seen, size_t expected, const char* what, const char* array) {
  if (seen != expected) {
    fail(ErrorCode::kInvalidArgument, std::string(what) + ": " + array + " holds " +
                                          std::to_string(seen) + " values; " +
                                          std::to_string(expected) + " are needed");
  }
}

}  // namespace

void SplatCloud::resize(size_t count) {
  resizeFresh(positions, count * 3);
  resizeFresh(rotations, count * 4);
  resizeFresh(scales, count * 3);
  resizeFresh(opacities, count);
  resizeFresh(sh, count * shStride());
}

void validateSizes(const SplatCloud& cloud, const char* what) {
  const size_t count = cloud.size();
  if (cloud.sh_degree < 0 || cloud.sh_degree > kMaxShDegree) {
    fail(ErrorCode::kInvalidArgument, std::string(what) + ": harmonic degree is " +
                                          std::to_string(cloud.sh_degree) + "; 0 to 4 is allowed");
  }
  requireSize(cloud.positions.size(), count * 3, what, "positions");
  requireSize(cloud.rotations.size(), count * 4, what, "rotations");
  requireSize(cloud.scales.size(), count * 3, what, "scales");
  requireSize(cloud.sh.size(), count * cloud.shStride(), what, "sh");
}

bool rowsAreValid(const SplatCloud& cloud, size_t begin, size_t end) {
  // Without branches, so that the compiler makes vector code.
  uint32_t wrong = 0;
  const auto requireFiniteRows = [&](const std::vector<float>& values, size_t stride) {
    for (size_t i = begin * stride; i < end * stride; ++i) {
      // Carries into the sign where the exponent is all ones: infinity or NaN.
      wrong |= (std::bit_cast<uint32_t>(values[i]) & 0x7fffffffu) + 0x00800000u;
    }
  };
  requireFiniteRows(cloud.positions, 3);
  requireFiniteRows(cloud.rotations, 4);
  requireFiniteRows(cloud.scales, 3);
  requireFiniteRows(cloud.opacities, 1);
  requireFiniteRows(cloud.sh, cloud.shStride());
  if (wrong & 0x80000000u) return false;
  uint32_t outside = 0;
  for (size_t i = begin * 3; i < end * 3; ++i) outside |= cloud.scales[i] < 0.0f ? 1u : 0u;
  for (size_t i = begin; i < end; ++i) {
    outside |= cloud.opacities[i] < 0.0f ? 1u : 0u;
    outside |= cloud.opacities[i] > 1.0f ? 1u : 0u;
    const float* q = &cloud.rotations[i * 4];
    const uint32_t bits = std::bit_cast<uint32_t>(q[0]) | std::bit_cast<uint32_t>(q[1]) |
                          std::bit_cast<uint32_t>(q[2]) | std::bit_cast<uint32_t>(q[3]);
    outside |= (bits & 0x7fffffffu) == 0 ? 1u : 0u;
  }
  return outside == 0;
}

void validate(const SplatCloud& cloud, const char* what) {
  const std::string name(what);
  const size_t count = cloud.size();
  validateSizes(cloud, what);
  std::atomic<bool> valid{true};
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    if (!rowsAreValid(cloud, begin, end)) valid.store(false, std::memory_order_relaxed);
  });
  if (valid.load(std::memory_order_relaxed)) return;
  // Once more in order, for the first value that is wrong.
  requireFinite(cloud.positions.data(), count * 3, 3, (name + ": position of splat").c_str());
  requireFinite(cloud.rotations.data(), count * 4, 4, (name + ": rotation of splat").c_str());
  requireFinite(cloud.scales.data(), count * 3, 3, (name + ": scale of splat").c_str());
  requireFinite(cloud.opacities.data(), count, 1, (name + ": opacity of splat").c_str());
  requireFinite(cloud.sh.data(), cloud.sh.size(), cloud.shStride(),
                (name + ": colour of splat").c_str());
  for (size_t i = 0; i < count; ++i) {
    const float* q = &cloud.rotations[i * 4];
    if (q[0] == 0 && q[1] == 0 && q[2] == 0 && q[3] == 0) {
      fail(ErrorCode::kInvalidArgument,
           name + ": rotation of splat " + std::to_string(i) + " is the zero quaternion");
    }
    if (cloud.opacities[i] < 0 || cloud.opacities[i] > 1) {
      fail(ErrorCode::kInvalidArgument, name + ": opacity of splat " + std::to_string(i) + " is " +
                                            std::to_string(cloud.opacities[i]) +
                                            "; 0 to 1 is allowed");
    }
    for (size_t axis = 0; axis < 3; ++axis) {
      if (cloud.scales[i * 3 + axis] < 0) {
        fail(ErrorCode::kInvalidArgument, name + ": scale of splat " + std::to_string(i) + " is " +
                                              std::to_string(cloud.scales[i * 3 + axis]) +
                                              " m; it must not be negative");
      }
    }
  }
}

void normaliseRotations(SplatCloud& cloud) {
  parallelFor(cloud.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      float* q = &cloud.rotations[i * 4];
      double squares = 0;
      for (int k = 0; k < 4; ++k) squares += static_cast<double>(q[k]) * static_cast<double>(q[k]);
      const double length = std::sqrt(squares);
      for (int k = 0; k < 4; ++k) q[k] = static_cast<float>(static_cast<double>(q[k]) / length);
    }
  });
}

}  // namespace stipple
