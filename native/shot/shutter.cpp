#include "shot/shutter.h"

#include <string>

#include "base/error.h"
#include "math/affine.h"

namespace stipple {

namespace {

void validateSteps(const Shutter& shutter, size_t instance_count) {
  if (shutter.step_count == 1 || shutter.step_count > kMaxShutterSteps) {
    fail(ErrorCode::kInvalidArgument,
         "the shutter has " + std::to_string(shutter.step_count) + " steps; 2 to 1025 are allowed");
  }
  if (!shutter.camera.empty() && shutter.camera.size() != shutter.step_count) {
    fail(ErrorCode::kInvalidArgument, "the shutter has " + std::to_string(shutter.camera.size()) +
                                          " cameras; one for each of its " +
                                          std::to_string(shutter.step_count) + " steps is allowed");
  }
  const auto requireEach = [&](size_t count, const char* what) {
    if (count == 0 || count == shutter.step_count * instance_count) return;
    fail(ErrorCode::kInvalidArgument, "the shutter has " + std::to_string(count) + " " + what +
                                          "; one for each of " + std::to_string(instance_count) +
                                          " instances in each of its " +
                                          std::to_string(shutter.step_count) + " steps is allowed");
  };
  requireEach(shutter.instances.size(), "matrices of instances");
  requireEach(shutter.clouds.size(), "clouds");
}

void validateMatrices(const Shutter& shutter, size_t instance_count) {
  Camera somewhere;
  somewhere.width = somewhere.height = 1;
  somewhere.fx = somewhere.fy = 1;
  for (const Mat4d& matrix : shutter.camera) {
    somewhere.world_to_camera = matrix;
    validate(somewhere);
  }
  for (size_t i = 0; i < shutter.instances.size(); ++i) {
    const std::string name = "instance " + std::to_string(i % instance_count) +
                             ": matrix of step " + std::to_string(i / instance_count);
    validateAffine(shutter.instances[i], name.c_str());
    // Between two steps that mirror and do not, an object would be flat for a moment.
    if (i < instance_count) continue;
    const Mat3d before = linearPart(shutter.instances[i - instance_count]);
    if (determinant(before) * determinant(linearPart(shutter.instances[i])) > 0) continue;
    fail(ErrorCode::kInvalidArgument,
         name +
             " mirrors and that of the step before does not, or the other way round; all of an "
             "instance's steps must do the same");
  }
}

void validateClouds(const Shutter& shutter, std::span<const SplatInstance> instances) {
  for (size_t i = 0; i < shutter.clouds.size(); ++i) {
    if (!shutter.clouds[i]) continue;
    const SplatCloud& cloud = *shutter.clouds[i];
    const SplatCloud& own = *instances[i % instances.size()].cloud;
    const std::string name = "instance " + std::to_string(i % instances.size()) +
                             ": the cloud of step " + std::to_string(i / instances.size());
    validateSizes(cloud, name.c_str());
    if (cloud.size() != own.size() || cloud.sh_degree != own.sh_degree) {
      fail(ErrorCode::kInvalidArgument,
           name + " has " + std::to_string(cloud.size()) + " splats of harmonic degree " +
               std::to_string(cloud.sh_degree) + "; those of the instance itself are " +
               std::to_string(own.size()) + " of degree " + std::to_string(own.sh_degree) +
               ", and all of its steps must have the same splats");
    }
    if (cloud.colour_space == own.colour_space && cloud.antialias == own.antialias) continue;
    fail(ErrorCode::kInvalidArgument,
         name +
             " has another colour space or low-pass than the instance's own splats; all of its "
             "steps must have the same");
  }
}

void validateCurve(const Shutter& shutter) {
  double sum = 0;
  for (const double open : shutter.curve) {
    requireFinite(open, "shutter.curve");
    if (open < 0 || open > 1e6) {
      fail(ErrorCode::kInvalidArgument,
           "shutter.curve has " + std::to_string(open) + "; 0 to 1e6 is allowed");
    }
    sum += open;
  }
  if (shutter.curve.size() == 1 || (!shutter.curve.empty() && !(sum > 0))) {
    fail(ErrorCode::kInvalidArgument, "shutter.curve has " + std::to_string(shutter.curve.size()) +
                                          " values of the sum " + std::to_string(sum) +
                                          "; 2 or more, not all 0, are allowed");
  }
}

}  // namespace

void validate(const Shutter& shutter, std::span<const SplatInstance> instances) {
  validateSteps(shutter, instances.size());
  validateMatrices(shutter, instances.size());
  validateClouds(shutter, instances);
  validateCurve(shutter);
}

}  // namespace stipple
