#include "math/camera_text.h"

namespace stipple {

std::string sizeText(const Camera& camera) {
  return std::to_string(camera.width) + " x " + std::to_string(camera.height) + " pixels";
}

const char* modelName(const Camera& camera) {
  switch (camera.model) {
    case CameraModel::kPerspective:
      return "PINHOLE";
    case CameraModel::kOrthographic:
      return "ORTHOGRAPHIC";
    case CameraModel::kEquirectangular:
      return "EQUIRECTANGULAR";
    case CameraModel::kFisheyeEquidistant:
      return "FISHEYE_EQUIDISTANT";
    case CameraModel::kFisheyeEquisolid:
      return "FISHEYE_EQUISOLID";
  }
  return "PINHOLE";
}

}  // namespace stipple
