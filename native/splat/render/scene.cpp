#include "splat/render/scene.h"

#include <bit>
#include <cstdio>
#include <limits>
#include <string>

#include "base/error.h"
#include "math/affine.h"
#include "splat/render/object_order.h"
#include "splat/render/surface.h"

namespace stipple {

namespace {

void validateOptions(const RenderOptions& options) {
  if (options.sh_degree_limit < 0 || options.sh_degree_limit > kMaxShDegree) {
    fail(ErrorCode::kInvalidArgument,
         "sh_degree_limit is " + std::to_string(options.sh_degree_limit) + "; 0 to 4 is allowed");
  }
  if (static_cast<uint32_t>(options.low_pass) > static_cast<uint32_t>(LowPass::kNone)) {
    fail(ErrorCode::kInvalidArgument, "low_pass is " +
                                          std::to_string(static_cast<uint32_t>(options.low_pass)) +
                                          "; 0 to 3 is allowed");
  }
  if (static_cast<uint32_t>(options.blend_space) >
      static_cast<uint32_t>(BlendSpace::kSceneLinear)) {
    fail(ErrorCode::kInvalidArgument,
         "blend_space is " + std::to_string(static_cast<uint32_t>(options.blend_space)) +
             "; 0 or 1 is allowed");
  }
  if (static_cast<uint32_t>(options.object_order) > static_cast<uint32_t>(ObjectOrder::kApart)) {
    fail(ErrorCode::kInvalidArgument,
         "object_order is " + std::to_string(static_cast<uint32_t>(options.object_order)) +
             "; 0 or 1 is allowed");
  }
  if (!(options.least_alpha > 0 && options.least_alpha < 1)) {
    fail(ErrorCode::kInvalidArgument, "min_alpha is " + std::to_string(options.least_alpha) +
                                          "; a number above 0 and below 1 is allowed");
  }
  for (const double value : options.background) requireFinite(value, "background");
}

LowPass lowPassOf(const SplatCloud& cloud, LowPass chosen) {
  if (chosen != LowPass::kFromCloud) return chosen;
  return cloud.antialias == Antialias::kMip ? LowPass::kMip : LowPass::kClassic;
}

PlacedCloud place(const SplatInstance& instance, const Camera& camera,
                  const RenderOptions& options) {
  const SplatCloud& cloud = *instance.cloud;
  const Mat3d to_view = linearPart(camera.world_to_camera);
  const Mat3d object = linearPart(instance.object_to_world);
  const Vec3d origin = translationPart(instance.object_to_world);
  PlacedCloud placed;
  placed.cloud = &cloud;
  placed.linear = to_view * object;
  placed.translation = to_view * origin + translationPart(camera.world_to_camera);
  const Mat3d to_object = inverse(object);
  placed.eye = camera.model != CameraModel::kOrthographic
                   ? Vec3d(to_object * (cameraCentre(camera) - origin))
                   : Vec3d(to_object * to_view.row(2).transpose());
  placed.instance = 0;
  placed.is_checked = instance.values_are_checked;
  placed.first_index = 0;
  placed.low_pass = lowPassOf(cloud, options.low_pass);
  placed.sh_degree = std::min(cloud.sh_degree, options.sh_degree_limit);
  placed.grades_colour = instance.grade.changesColour();
  placed.grade = instance.grade;
  placed.is_holdout = instance.holdout;
  placed.linearise = options.blend_space == BlendSpace::kSceneLinear &&
                     cloud.colour_space == ColourSpace::kDisplay;
  return placed;
}

std::string nameOf(size_t instance) {
  return "instance " + std::to_string(instance);
}

void placeUnread(std::span<const SplatInstance> instances, const Camera& camera,
                 const RenderOptions& options, PlacedScene& scene) {
  validate(camera);
  validateOptions(options);
  validateSurface(options.surface, camera);
  scene.view = makeView<double>(camera);
  scene.view.least_alpha = options.least_alpha;
  scene.view_to_world = linearPart(camera.world_to_camera).transpose();
  scene.clouds.clear();
  scene.splat_count = 0;
  scene.has_holdouts = false;
  for (size_t i = 0; i < instances.size(); ++i) {
    const SplatInstance& instance = instances[i];
    const std::string name = nameOf(i);
    if (!instance.cloud) fail(ErrorCode::kInvalidArgument, name + " has no cloud");
    char matrix_name[48];  // no string: drawing again allocates nothing
    std::snprintf(matrix_name, sizeof(matrix_name), "%s: matrix", name.c_str());
    validateAffine(instance.object_to_world, matrix_name);
    validateSizes(*instance.cloud, name.c_str());
    validate(instance.grade, name.c_str());
    if (instance.cloud->size() == 0) continue;
    if (options.blend_space == BlendSpace::kAsTrained && !scene.clouds.empty() &&
        scene.clouds.front().cloud->colour_space != instance.cloud->colour_space) {
      fail(ErrorCode::kUnsupported,
           name +
               " stores its colours in another space than the objects before it, which cannot "
               "be composited as trained; choose scene linear blending");
    }
    PlacedCloud placed = place(instance, camera, options);
    placed.instance = i;
    placed.first_index = scene.splat_count;
    scene.splat_count += instance.cloud->size();
    scene.has_holdouts |= instance.holdout;
    scene.clouds.push_back(placed);
  }
  if (scene.splat_count > std::numeric_limits<uint32_t>::max()) {
    fail(ErrorCode::kUnsupported, "the image holds " + std::to_string(scene.splat_count) +
                                      " splats; at most 4294967295 can be drawn together");
  }
  orderObjects(options, scene);
}

void checkClouds(const PlacedScene& scene) {
  const SplatCloud* checked = nullptr;
  for (const PlacedCloud& placed : scene.clouds) {
    // Many copies of one cloud usually follow each other.
    if (placed.cloud != checked) validate(*placed.cloud, nameOf(placed.instance).c_str());
    checked = placed.cloud;
  }
}

}  // namespace

void placeSceneUnread(std::span<const SplatInstance> instances, const Camera& camera,
                      const RenderOptions& options, PlacedScene& scene) {
  requireImagePlane(camera, "the affine projection of splats");
  placeUnread(instances, camera, options, scene);
}

void refuseCloud(const PlacedCloud& placed) {
  validate(*placed.cloud, nameOf(placed.instance).c_str());
  fail(ErrorCode::kInvalidArgument,
       nameOf(placed.instance) + " changed while it was being drawn; it must stay as it is");
}

PlacedScene placeScene(std::span<const SplatInstance> instances, const Camera& camera,
                       const RenderOptions& options) {
  PlacedScene scene;
  placeSceneUnread(instances, camera, options, scene);
  checkClouds(scene);
  return scene;
}

PlacedScene placeSceneForRays(std::span<const SplatInstance> instances, const Camera& camera,
                              const RenderOptions& options) {
  PlacedScene scene;
  placeUnread(instances, camera, options, scene);
  checkClouds(scene);
  return scene;
}

size_t cloudOfSplat(const PlacedScene& scene, uint64_t splat) {
  const auto after = std::upper_bound(
      scene.clouds.begin(), scene.clouds.end(), splat,
      [](uint64_t value, const PlacedCloud& placed) { return value < placed.first_index; });
  return static_cast<size_t>(after - scene.clouds.begin()) - 1;
}

uint32_t depthKey(double depth) {
  // Held inside float32; the largest depths then tie and go by index.
  constexpr double kLargest = static_cast<double>(std::numeric_limits<float>::max());
  const float rounded = static_cast<float>(std::clamp(depth, -kLargest, kLargest)) + 0.0f;
  const uint32_t bits = std::bit_cast<uint32_t>(rounded);
  return (bits & 0x80000000u) ? ~bits : bits | 0x80000000u;
}

}  // namespace stipple
