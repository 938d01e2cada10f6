// Based on: the parameter lists of COLMAP's camera models (colmap.github.io/cameras.html) and, for
// RAD_TAN_THIN_PRISM_FISHEYE, Project Aria's description of its FisheyeRadTanThinPrism model.
#include "io/views/colmap_models.h"

#include <cstring>
#include <iterator>

namespace stipple {

namespace {

// The order is COLMAP's numbering.
constexpr ColmapModel kModels[] = {
    {"SIMPLE_PINHOLE", 3, 1, false},
    {"PINHOLE", 4, 2, false},
    {"SIMPLE_RADIAL", 4, 1, false},
    {"RADIAL", 5, 1, false},
    {"OPENCV", 8, 2, false},
    {"OPENCV_FISHEYE", 8, 2, true},
    {"FULL_OPENCV", 12, 2, false},
    {"FOV", 5, 2, false},
    {"SIMPLE_RADIAL_FISHEYE", 4, 1, true},
    {"RADIAL_FISHEYE", 5, 1, true},
    {"THIN_PRISM_FISHEYE", 12, 2, true},
    {"RAD_TAN_THIN_PRISM_FISHEYE", 16, 2, true},
};

}  // namespace

const ColmapModel* colmapModel(int32_t number) {
  if (number < 0 || static_cast<size_t>(number) >= std::size(kModels)) return nullptr;
  return &kModels[number];
}

const ColmapModel* colmapModel(std::string_view name) {
  for (const ColmapModel& model : kModels) {
    if (name == model.name) return &model;
  }
  return nullptr;
}

std::string colmapModelNames() {
  std::string names;
  for (const ColmapModel& model : kModels)
    names += (names.empty() ? "" : ", ") + std::string(model.name);
  return names;
}

Lens colmapLens(const ColmapModel& model, const std::vector<double>& parameters) {
  Lens lens;
  lens.fisheye = model.fisheye;
  const double* more = parameters.data() + model.focal_count + 2;
  const std::string_view name = model.name;
  if (name == "SIMPLE_RADIAL" || name == "SIMPLE_RADIAL_FISHEYE") {
    lens.radial = {more[0]};
  } else if (name == "RADIAL" || name == "RADIAL_FISHEYE") {
    lens.radial = {more[0], more[1]};
  } else if (name == "OPENCV") {
    lens.radial = {more[0], more[1]};
    lens.tangential = {more[2], more[3]};
  } else if (name == "OPENCV_FISHEYE") {
    lens.radial = {more[0], more[1], more[2], more[3]};
  } else if (name == "FULL_OPENCV") {
    lens.radial = {more[0], more[1], more[4]};
    lens.tangential = {more[2], more[3]};
    lens.divisor = {more[5], more[6], more[7]};
  } else if (name == "FOV") {
    lens.field_of_view = more[0];
  } else if (name == "THIN_PRISM_FISHEYE") {
    lens.radial = {more[0], more[1], more[4], more[5]};
    lens.tangential = {more[2], more[3]};
    lens.prism = {more[6], 0, more[7], 0};
  } else if (name == "RAD_TAN_THIN_PRISM_FISHEYE") {
    for (size_t i = 0; i < 6; ++i) lens.radial[i] = more[i];
    // Its first tangential parameter acts along x, Brown's second.
    lens.tangential = {more[7], more[6]};
    lens.prism = {more[8], more[9], more[10], more[11]};
    lens.tangential_after_radial = true;
  }
  return lens;
}

void setColmapIntrinsics(const ColmapModel& model, const std::vector<double>& parameters,
                         Camera& camera) {
  camera.fx = parameters[0];
  camera.fy = parameters[model.focal_count - 1];
  camera.cx = parameters[model.focal_count];
  camera.cy = parameters[model.focal_count + 1];
}

}  // namespace stipple
