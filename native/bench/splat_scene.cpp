#include "bench/splat_scene.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <string>

namespace stipple::bench {

namespace {

SplatCloud ball(const SplatCase& c) {
  std::mt19937 random(1);
  std::normal_distribution<float> normal;
  std::uniform_real_distribution<float> uniform(0.0f, 1.0f);
  SplatCloud cloud;
  cloud.sh_degree = c.degree;
  cloud.resize(c.splats);
  const float size = static_cast<float>(c.size / std::sqrt(static_cast<double>(c.splats)));
  for (size_t i = 0; i < c.splats; ++i) {
    const float d[3] = {normal(random), normal(random), normal(random)};
    const float length = std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    const float radius = 0.4f + 0.6f * std::cbrt(uniform(random));
    const float base = size * std::exp(0.6f * normal(random));
    for (size_t axis = 0; axis < 3; ++axis) {
      cloud.positions[i * 3 + axis] = radius * d[axis] / length;
      cloud.scales[i * 3 + axis] = base * std::exp(0.5f * normal(random));
    }
    for (size_t k = 0; k < 4; ++k) cloud.rotations[i * 4 + k] = normal(random);
    const float o = uniform(random);
    cloud.opacities[i] = c.faint * (0.02f + 0.97f * o * o);
  }
  for (float& value : cloud.sh) value = 0.3f * normal(random);
  return cloud;
}

}  // namespace

const SplatCloud& cloudOf(const SplatCase& c) {
  static std::map<std::string, SplatCloud> clouds;
  const auto [found, is_new] = clouds.try_emplace(c.name);
  if (is_new) found->second = ball(c);
  return found->second;
}

Camera cameraOf(const SplatCase& c) {
  Camera camera;
  camera.width = c.width;
  camera.height = c.height;
  camera.fx = camera.fy = 1.2 * std::min(c.width, c.height);
  camera.cx = c.width / 2.0;
  camera.cy = c.height / 2.0;
  camera.world_to_camera(2, 3) = 2.6;
  return camera;
}

}  // namespace stipple::bench
