#include "data/splat_cloud.h"

#include <string>

#include "base/error.h"

namespace stipple {

namespace {

void requireSize(size_t seen, size_t expected, const char* what, const char* array) {
  if (seen != expected) {
    fail(ErrorCode::kInvalidArgument, std::string(what) + ": " + array + " holds " +
                                          std::to_string(seen) + " values; " +
                                          std::to_string(expected) + " are needed");
  }
}

}  // namespace

void SplatCloud::resize(size_t count) {
  positions.resize(count * 3);
  rotations.resize(count * 4);
  scales.resize(count * 3);
  opacities.resize(count);
  sh.resize(count * shStride());
}

void validate(const SplatCloud& cloud, const char* what) {
  const std::string name(what);
  const size_t count = cloud.size();
  if (cloud.sh_degree < 0 || cloud.sh_degree > kMaxShDegree) {
    fail(ErrorCode::kInvalidArgument, name + ": harmonic degree is " +
                                          std::to_string(cloud.sh_degree) + "; 0 to 4 is allowed");
  }
  requireSize(cloud.positions.size(), count * 3, what, "positions");
  requireSize(cloud.rotations.size(), count * 4, what, "rotations");
  requireSize(cloud.scales.size(), count * 3, what, "scales");
  requireSize(cloud.sh.size(), count * cloud.shStride(), what, "sh");
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
        fail(ErrorCode::kInvalidArgument,
             name + ": scale of splat " + std::to_string(i) + " is " +
                 std::to_string(cloud.scales[i * 3 + axis]) + " m; it must not be negative");
      }
    }
  }
}

}  // namespace stipple
