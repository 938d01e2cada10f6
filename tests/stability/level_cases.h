#pragma once

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "data/clouds/splat_cloud.h"
#include "math/camera.h"
#include "splat/random_scene.h"

namespace stipple::testing {

/// A picture that is hard for arithmetic.
struct HardCase {
  std::string name;   ///< as docs/numerical_stability.md has it
  std::string naive;  ///< what goes wrong in the plain form
  std::string ours;   ///< what stands here instead
  std::function<SplatCloud()> cloud;
  Camera camera;
};

inline SplatCloud movedCloud(float distance) {
  SplatCloud cloud = randomCloud({}, 4);
  for (size_t i = 0; i < cloud.size(); ++i) cloud.positions[i * 3] += distance;
  return cloud;
}

inline SplatCloud layeredCloud(size_t count, float opacity, bool at_one_depth) {
  SplatCloud cloud;
  cloud.resize(count);
  for (size_t i = 0; i < count; ++i) {
    cloud.positions[i * 3 + 1] = at_one_depth ? 0.0f : 1e-4f * static_cast<float>(i);
    cloud.rotations[i * 4] = 1;
    for (size_t k = 0; k < 3; ++k) cloud.scales[i * 3 + k] = 0.3f;
    cloud.opacities[i] = opacity;
    for (size_t c = 0; c < 3; ++c) cloud.sh[i * 3 + c] = i % 3 == c ? 1.7f : -1.7f;
  }
  return cloud;
}

inline Camera movedCamera(double distance) {
  Camera camera = frontCamera(64, 48, 50, 3);
  camera.world_to_camera(0, 3) = -distance;
  return camera;
}

/// What design asks of every level (docs/numerical_stability.md is made from this list).
inline std::vector<HardCase> hardCases() {
  const Camera front = frontCamera(64, 48, 50, 3), close = frontCamera(64, 48, 50, 0.5);
  const Camera small = frontCamera(16, 12, 12, 3);  // where each pixel has every splat
  std::vector<HardCase> cases;
  const auto add = [&](const char* name, const char* naive, const char* ours,
                       std::function<SplatCloud()> cloud, const Camera& camera) {
    cases.push_back({name, naive, ours, std::move(cloud), camera});
  };
  add(
      "needles, 1,000,000 : 1", "the inverse covariance loses the square of the ratio",
      "factors by rows made orthogonal; along rays the cross product with the centre",
      [] { return testing::withScales(150, 1.0f, 1e-6f, 1e-6f, 1); }, front);
  add(
      "discs of no thickness", "1/0 in the inverse", "no width below 1e-6 of a pixel divides",
      [] { return testing::withScales(150, 0.2f, 0.2f, 0.0f, 2); }, front);
  add(
      "scales near zero", "squares underflow, log of 0",
      "widths are held to 1e-6 of a pixel, or to the low-pass",
      [] { return testing::withScales(150, 1e-30f, 1e-30f, 1e-30f, 3); }, front);
  add(
      "scales of 1e18", "squares overflow float32", "squares are double",
      [] { return testing::withScales(20, 1e18f, 1e18f, 1e18f, 4); }, small);
  add(
      "screen-filling", "tiles far outside the image overflow integers",
      "boxes are cut to the image before they are whole numbers",
      [] { return testing::withScales(40, 50.0f, 30.0f, 40.0f, 5); }, small);
  add(
      "sub-pixel", "nothing is hit between pixel centres",
      "the low-pass has a variance of 0.3 px^2, with or without compensation",
      [] { return testing::withScales(300, 1e-4f, 1e-4f, 1e-4f, 6); }, front);
  add(
      "at and behind the near plane", "1/z of 0, mirrored ellipses",
      "centres before the plane are left out; along rays so are responses",
      [] { return randomCloud({}, 7); }, close);
  add(
      "1,000,000 from the origin", "float32 differences have steps of 6 cm",
      "object to camera is one matrix in double", [] { return movedCloud(1e6f); },
      movedCamera(1e6));
  add(
      "alpha to 1", "T becomes 0 and is divided by",
      "alpha is held to 0.99; the reference does not divide",
      [] { return layeredCloud(50, 1.0f, false); }, small);
  add(
      "10,000 layers", "float32 sums drift", "a pixel ends at T < 1e-4; sums of rays are double",
      [] { return layeredCloud(10000, 0.02f, false); }, small);
  add(
      "equal depths", "the order is that of a sort, or of rounding",
      "ties go by place in the scene; near places are compared in double",
      [] { return layeredCloud(90, 0.4f, true); }, small);
  add(
      "one pixel", "focal lengths and tiles of nothing", "no special case",
      [] { return randomCloud({}, 8); }, frontCamera(1, 1, 1, 3));
  return cases;
}

}  // namespace stipple::testing
