// Based on: the data conventions of nerfstudio (docs/quickstart/data_conventions) and the layout of
// the NeRF-synthetic scenes (Mildenhall et al., NeRF, ECCV 2020).
#include "io/camera_file.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/error.h"
#include "io/colmap_cameras.h"
#include "io/input_file.h"

namespace stipple {

namespace {

using Json = nlohmann::json;

// A thousand frames take about a megabyte.
constexpr uint64_t kMaxFileBytes = uint64_t{1} << 30;
// How far a stored rotation may be from orthonormal: three decimal digits in the file.
constexpr double kRotationTolerance = 5e-3;

/// One frame and the file around it, and how both are called in messages.
class FrameReader {
 public:
  FrameReader(const std::string& path, const Json& file, const Json& frame, size_t index)
      : path_(path), file_(file), frame_(frame), name_("frame " + std::to_string(index)) {
    if (!frame.is_object()) failHere("is not a JSON object");
  }

  CameraView read() const {
    CameraView view;
    view.image_path = text("file_path").value_or("");
    readModel(view.camera);
    readIntrinsics(view.camera);
    readPose(view.camera);
    return view;
  }

 private:
  [[noreturn]] void failHere(const std::string& what, ErrorCode code = ErrorCode::kFormat) const {
    fail(code, path_ + ": " + name_ + " " + what);
  }

  const Json* find(const char* key) const {
    for (const Json* object : {&frame_, &file_}) {
      const auto found = object->find(key);
      if (found != object->end() && !found->is_null()) return &*found;
    }
    return nullptr;
  }

  std::optional<double> number(const char* key) const {
    const Json* value = find(key);
    if (value == nullptr) return std::nullopt;
    if (!value->is_number() || !std::isfinite(value->get<double>())) {
      failHere(std::string("has a '") + key + "' that is not a finite number");
    }
    return value->get<double>();
  }

  std::optional<std::string> text(const char* key) const {
    const Json* value = find(key);
    if (value == nullptr) return std::nullopt;
    if (!value->is_string()) failHere(std::string("has a '") + key + "' that is not a text");
    return value->get<std::string>();
  }

  uint32_t side(const char* key) const {
    const std::optional<double> value = number(key);
    if (!value) return 0;
    if (*value < 1 || *value > 65536 || *value != std::floor(*value)) {
      failHere(std::string("has ") + key + " = " + std::to_string(*value) +
               "; a whole number from 1 to 65536 is needed");
    }
    return static_cast<uint32_t>(*value);
  }

  void readModel(Camera& camera) const {
    const std::string model = text("camera_model").value_or("PINHOLE");
    if (model == "ORTHOGRAPHIC") {
      camera.model = CameraModel::kOrthographic;
    } else if (model != "PINHOLE" && model != "SIMPLE_PINHOLE" && model != "PERSPECTIVE" &&
               model != "OPENCV" && model != "SIMPLE_RADIAL" && model != "RADIAL") {
      failHere("has the camera model '" + model.substr(0, 60) +
                   "'; pinhole and orthographic cameras are supported",
               ErrorCode::kUnsupported);
    }
    const Json* fisheye = find("is_fisheye");
    if (fisheye != nullptr && fisheye->is_boolean() && fisheye->get<bool>()) {
      failHere("is a fisheye camera; pinhole and orthographic cameras are supported",
               ErrorCode::kUnsupported);
    }
    for (const char* key : {"k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"}) {
      const double value = number(key).value_or(0.0);
      if (value != 0.0) {
        failHere(std::string("is distorted (") + key + " = " + std::to_string(value) +
                     "); undistort the images first, then all of k1..k6, p1, p2 are 0",
                 ErrorCode::kUnsupported);
      }
    }
  }

  double positive(const char* key, double value) const {
    if (!(value > 0.0)) {
      failHere(std::string("has ") + key + " = " + std::to_string(value) +
               "; a positive number is needed");
    }
    return value;
  }

  /// Focal length in pixels, or in widths where the width is 0.
  std::optional<double> focal(const char* length_key, const char* angle_key, double size) const {
    if (const std::optional<double> length = number(length_key)) {
      if (size == 0.0) {
        failHere(std::string("has '") + length_key + "' in pixels, but no size 'w' and 'h'");
      }
      return positive(length_key, *length);
    }
    if (const std::optional<double> angle = number(angle_key)) {
      if (!(*angle > 0.0) || !(*angle < M_PI)) {
        failHere(std::string("has ") + angle_key + " = " + std::to_string(*angle) +
                 " rad; more than 0 and less than pi is needed");
      }
      return 0.5 * (size > 0.0 ? size : 1.0) / std::tan(0.5 * *angle);
    }
    return std::nullopt;
  }

  void readIntrinsics(Camera& camera) const {
    camera.width = side("w");
    camera.height = side("h");
    if ((camera.width == 0) != (camera.height == 0)) failHere("has only one of 'w' and 'h'");
    const double width = camera.width;
    const double height = camera.height;
    if (camera.model == CameraModel::kOrthographic) {
      const std::optional<double> scale = number("ortho_scale");
      if (!scale) failHere("is orthographic but has no 'ortho_scale'");
      camera.fx = (width > 0 ? width : 1.0) / positive("ortho_scale", *scale);
      camera.fy = camera.fx;
    } else {
      const std::optional<double> fx = focal("fl_x", "camera_angle_x", width);
      // Without a size an angle over the height says nothing about the width.
      const std::optional<double> fy =
          camera.height > 0 ? focal("fl_y", "camera_angle_y", height) : std::nullopt;
      if (!fx && !fy) failHere("has neither 'fl_x' nor 'camera_angle_x'");
      camera.fx = fx ? *fx : *fy;
      camera.fy = fy ? *fy : *fx;
    }
    if (camera.width == 0) {
      camera.cx = camera.cy = 0.5;
      return;
    }
    camera.cx = number("cx").value_or(0.5 * width);
    camera.cy = number("cy").value_or(0.5 * height);
  }

  void readPose(Camera& camera) const {
    const auto found = frame_.find("transform_matrix");
    if (found == frame_.end()) failHere("has no 'transform_matrix'");
    const auto wrong = [this] {
      failHere("has a 'transform_matrix' that is not 4 x 4 finite numbers");
    };
    // Some writers leave out the last row, which is 0 0 0 1.
    if (!found->is_array() || (found->size() != 4 && found->size() != 3)) wrong();
    Mat4d matrix = Mat4d::Identity();
    for (size_t row = 0; row < found->size(); ++row) {
      const Json& numbers = (*found)[row];
      if (!numbers.is_array() || numbers.size() != 4) wrong();
      for (size_t column = 0; column < 4; ++column) {
        if (!numbers[column].is_number()) wrong();
        const double value = numbers[column].get<double>();
        if (!std::isfinite(value)) wrong();
        matrix(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column)) = value;
      }
    }
    Mat3d rotation = matrix.topLeftCorner<3, 3>();
    // Cameras under a scaled parent carry its scale, which means nothing for a camera.
    for (int axis = 0; axis < 3; ++axis) rotation.col(axis).normalize();
    const double error =
        (rotation.transpose() * rotation - Mat3d::Identity()).cwiseAbs().maxCoeff();
    if (!(error < kRotationTolerance) || !(rotation.determinant() > 0)) {
      failHere("has a 'transform_matrix' that is not a rotation and a translation (it differs by " +
               std::to_string(error) + " from orthonormal; at most 0.005 is allowed)");
    }
    // The nearest rotation: what rounding in the file has taken away.
    const Eigen::JacobiSVD<Mat3d> svd(rotation, Eigen::ComputeFullU | Eigen::ComputeFullV);
    rotation = svd.matrixU() * svd.matrixV().transpose();
    // OpenGL looks along −z with y up, OpenCV along +z with y down.
    rotation.col(1) = -rotation.col(1);
    rotation.col(2) = -rotation.col(2);
    const Vec3d centre = matrix.topRightCorner<3, 1>();
    camera.world_to_camera = Mat4d::Identity();
    camera.world_to_camera.topLeftCorner<3, 3>() = rotation.transpose();
    camera.world_to_camera.topRightCorner<3, 1>() = -(rotation.transpose() * centre);
  }

  const std::string& path_;
  const Json& file_;
  const Json& frame_;
  std::string name_;
};

std::vector<CameraView> readTransforms(const std::string& path) {
  const std::string text = readTextFile(path, kMaxFileBytes);
  Json file;
  try {
    file = Json::parse(text);
  } catch (const Json::exception& error) {
    fail(ErrorCode::kFormat, path + " is not valid JSON: " + error.what());
  }
  if (!file.is_object() || !file.contains("frames") || !file["frames"].is_array() ||
      file["frames"].empty()) {
    fail(ErrorCode::kFormat,
         path + " is not a transforms.json: a list 'frames' with at least one camera is needed");
  }
  std::vector<CameraView> views;
  const Json& frames = file["frames"];
  for (size_t i = 0; i < frames.size(); ++i) {
    views.push_back(FrameReader(path, file, frames[i], i).read());
  }
  return views;
}

/// Refuses what no picture can be made with, such as focal lengths beyond all measure. Cameras of a
/// file without a size of its pictures are in units of the picture.
void requireUsable(const std::vector<CameraView>& views, const std::string& path) {
  for (size_t i = 0; i < views.size(); ++i) {
    Camera camera = views[i].camera;
    if (camera.width == 0 && camera.height == 0) camera.width = camera.height = 1;
    try {
      validate(camera);
    } catch (const Error& error) {
      fail(ErrorCode::kFormat, path + ": view " + std::to_string(i) + ": " + error.what());
    }
  }
}

std::vector<CameraView> readViews(const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) {
    const fs::path transforms = fs::path(path) / "transforms.json";
    if (fs::exists(transforms, ignored)) return readTransforms(transforms.string());
  }
  if (const std::optional<std::string> model = findColmapModel(path)) {
    return readColmapCameras(*model);
  }
  if (fs::is_directory(path, ignored)) {
    fail(ErrorCode::kFormat, path +
                                 " holds no cameras: transforms.json, or images.bin or images.txt "
                                 "of COLMAP (there or in sparse/0) is needed");
  }
  return readTransforms(path);
}

}  // namespace

std::vector<CameraView> readCameraFile(const std::string& path) {
  std::vector<CameraView> views = readViews(path);
  requireUsable(views, path);
  return views;
}

}  // namespace stipple
