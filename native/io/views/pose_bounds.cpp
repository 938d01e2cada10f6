// Based on: Mildenhall et al., Local Light Field Fusion, ACM TOG 2019: the poses_bounds.npy of its
// released data, as its description of "Using your own poses" has it.
#include "io/views/pose_bounds.h"

#include <cmath>

#include "base/error.h"
#include "base/number_text.h"
#include "io/bytes/npy_array.h"
#include "io/views/camera_pose.h"

namespace stipple {

namespace {

constexpr uint64_t kRowLength = 17;
constexpr double kLargestSide = 65536;

CameraView cameraOf(const double* row, const std::string& name) {
  const auto refuse = [&](const std::string& what) { fail(ErrorCode::kFormat, name + what); };
  for (uint64_t i = 0; i < kRowLength; ++i) {
    if (std::isfinite(row[i])) continue;
    refuse(" has the number " + numberText(row[i]) + " in column " + std::to_string(i) +
           ", counted from 0; every number must be finite");
  }
  const auto at = [row](int r, int c) { return row[r * 5 + c]; };
  Mat3d axes;
  Vec3d centre;
  for (int r = 0; r < 3; ++r) {
    // Down, right and back become right, down and forward.
    axes(r, 0) = at(r, 1);
    axes(r, 1) = at(r, 0);
    axes(r, 2) = -at(r, 2);
    centre[r] = at(r, 3);
  }
  double error = 0;
  if (!takeNearestRotation(axes, error)) {
    refuse(" has a pose whose columns down, right and backwards are no rotation (they differ by " +
           numberText(error) + " from orthonormal; at most 0.005 is allowed, and no mirror image)");
  }
  const double height = at(0, 4), width = at(1, 4), focal = at(2, 4);
  for (const double side : {width, height}) {
    if (side >= 1 && side <= kLargestSide && side == std::floor(side)) continue;
    refuse(" has images of " + numberText(width) + " x " + numberText(height) +
           " pixels; whole numbers from 1 to 65536 are needed");
  }
  if (!(focal > 0)) {
    refuse(" has a focal length of " + numberText(focal) + " pixels; a positive number is needed");
  }
  CameraView view;
  view.camera_model = "SIMPLE_PINHOLE";
  view.camera.width = static_cast<uint32_t>(width);
  view.camera.height = static_cast<uint32_t>(height);
  view.camera.fx = view.camera.fy = focal;
  view.camera.cx = 0.5 * width;
  view.camera.cy = 0.5 * height;
  placeCamera(axes, centre, view.camera);
  return view;
}

}  // namespace

std::vector<CameraView> readPoseBounds(const std::string& path) {
  const NpyArray array = readNpyArray(path);
  if (array.shape.size() != 2 || array.shape[0] < 1 || array.shape[1] != kRowLength) {
    std::string shape;
    for (const uint64_t side : array.shape) {
      shape += (shape.empty() ? "" : " x ") + std::to_string(side);
    }
    fail(ErrorCode::kFormat, path + " holds " + (shape.empty() ? "one" : shape) +
                                 " numbers; a row of 17 for each camera is needed");
  }
  std::vector<CameraView> views;
  for (uint64_t i = 0; i < array.shape[0]; ++i) {
    views.push_back(
        cameraOf(&array.values[i * kRowLength], path + ": camera " + std::to_string(i)));
  }
  return views;
}

}  // namespace stipple
