#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "math/camera.h"
#include "math/lens.h"

namespace stipple {

/// A camera model of COLMAP: focal lengths, the principal point, then what its lens does.
struct ColmapModel {
  const char* name;
  size_t parameter_count;
  size_t focal_count;
  bool fisheye;
};

/// By COLMAP's number or name; null for those that are not known.
const ColmapModel* colmapModel(int32_t number);
const ColmapModel* colmapModel(std::string_view name);

/// "SIMPLE_PINHOLE, PINHOLE, ...": the names that are known.
std::string colmapModelNames();

/// In: parameters [model.parameter_count], finite.
Lens colmapLens(const ColmapModel& model, const std::vector<double>& parameters);
/// Sets focal lengths and principal point.
void setColmapIntrinsics(const ColmapModel& model, const std::vector<double>& parameters,
                         Camera& camera);

}  // namespace stipple
