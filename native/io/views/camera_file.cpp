// Based on: the data conventions of nerfstudio (docs/quickstart/data_conventions) and the layout of
// the NeRF-synthetic scenes (Mildenhall et al., NeRF, ECCV 2020).
#include "io/views/camera_file.h"

#include <Eigen/Geometry>
#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <utility>

#include "base/error.h"
#include "io/bytes/input_file.h"
#include "io/bytes/json_text.h"
#include "io/bytes/limits.h"
#include "io/views/camera_pose.h"
#include "io/views/colmap_cameras.h"
#include "io/views/pose_bounds.h"

namespace stipple {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

/// Names of when a frame was taken, in seconds, and as its number.
constexpr const char* kSecondsKeys[] = {"time", "timestamp"};
constexpr const char* kFrameKey = "timestep_index";
// Of a frame's number, as of those in file names.
constexpr double kLargestFrame = 999'999'999;

/// One frame and the file around it, and how both are called in messages.
class FrameReader {
 public:
  FrameReader(const std::string& path, const Json& file, const Json& frame, size_t index,
              Distorted distorted)
      : path_(path),
        file_(file),
        frame_(frame),
        name_("frame " + std::to_string(index)),
        distorted_(distorted) {
    if (!frame.is_object()) failHere("is not a JSON object");
  }

  CameraView read() const {
    CameraView view;
    view.image_path = text("file_path").value_or("");
    view.mask_path = text("mask_path").value_or("");
    view.depth_path = text("depth_file_path").value_or("");
    readTime(view);
    readModel(view);
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

  void readTime(CameraView& view) const {
    for (const char* key : kSecondsKeys) {
      const std::optional<double> seconds = number(key);
      if (!seconds || view.has_time) continue;
      view.time = *seconds;
      view.has_time = true;
    }
    const std::optional<double> frame = number(kFrameKey);
    if (!frame) return;
    if (*frame < 0 || *frame > kLargestFrame || *frame != std::floor(*frame)) {
      failHere(std::string("has ") + kFrameKey + " = " + std::to_string(*frame) +
               "; a whole number from 0 to 999999999 is needed");
    }
    view.frame = static_cast<uint64_t>(*frame);
  }

  static std::optional<CameraModel> wideModel(const std::string& name) {
    if (name == "EQUIRECTANGULAR") return CameraModel::kEquirectangular;
    if (name == "FISHEYE_EQUIDISTANT") return CameraModel::kFisheyeEquidistant;
    if (name == "FISHEYE_EQUISOLID") return CameraModel::kFisheyeEquisolid;
    return std::nullopt;
  }

  void readModel(CameraView& view) const {
    view.camera_model = text("camera_model").value_or("PINHOLE");
    const std::string& model = view.camera_model;
    bool fisheye = model == "OPENCV_FISHEYE";
    if (const std::optional<CameraModel> wide = wideModel(model)) {
      view.camera.model = *wide;
      if (distorted_ != Distorted::kRefuse) {
        failHere("has the camera model " + model + "; splats are not fitted to its images",
                 ErrorCode::kUnsupported);
      }
    } else if (model == "ORTHOGRAPHIC") {
      view.camera.model = CameraModel::kOrthographic;
    } else if (!fisheye && model != "PINHOLE" && model != "SIMPLE_PINHOLE" &&
               model != "PERSPECTIVE" && model != "OPENCV" && model != "FULL_OPENCV" &&
               model != "SIMPLE_RADIAL" && model != "RADIAL") {
      failHere("has the camera model '" + model.substr(0, 60) +
                   "'; PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, FULL_OPENCV, OPENCV_FISHEYE, "
                   "ORTHOGRAPHIC, EQUIRECTANGULAR, FISHEYE_EQUIDISTANT and FISHEYE_EQUISOLID are "
                   "supported",
               ErrorCode::kUnsupported);
    }
    const Json* flag = find("is_fisheye");
    if (flag != nullptr && flag->is_boolean() && flag->get<bool>()) fisheye = true;
    view.lens.fisheye = fisheye;
    if (fisheye && distorted_ == Distorted::kRefuse) {
      failHere("is a fisheye camera (" + model +
                   "); pinhole and orthographic cameras are supported here",
               ErrorCode::kUnsupported);
    }
    readDistortion(model == "FULL_OPENCV", view.lens);
    if (view.lens.isDistorted() && view.camera.model == CameraModel::kOrthographic) {
      failHere("is orthographic and distorted; one of both is supported", ErrorCode::kUnsupported);
    }
  }

  /// k1..k4 are of r^2 to r^8; with k5 or k6, k4..k6 are OpenCV's divisor.
  void readDistortion(bool rational, Lens& lens) const {
    double k[6] = {};
    const char* names[6] = {"k1", "k2", "k3", "k4", "k5", "k6"};
    for (size_t i = 0; i < 6; ++i) k[i] = distortion(names[i]);
    lens.tangential = {distortion("p1"), distortion("p2")};
    lens.radial = {k[0], k[1], k[2]};
    if (!lens.fisheye && (rational || k[4] != 0.0 || k[5] != 0.0)) {
      lens.divisor = {k[3], k[4], k[5]};
    } else {
      lens.radial[3] = k[3];
    }
  }

  double distortion(const char* key) const {
    const double value = number(key).value_or(0.0);
    if (value != 0.0 && distorted_ == Distorted::kRefuse) {
      failHere(std::string("is distorted (") + key + " = " + std::to_string(value) +
                   "); undistort the images first, then all of k1..k6, p1, p2 are 0",
               ErrorCode::kUnsupported);
    }
    return value;
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
      if (!(*angle > 0.0) || !(*angle < std::numbers::pi)) {
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
    } else if (camera.model == CameraModel::kEquirectangular) {
      // All around, whatever focal lengths say: writers do not agree on theirs.
      camera.fx = (width > 0 ? width : 1.0) / (2 * std::numbers::pi);
      camera.fy = (height > 0 ? height : 0.5) / std::numbers::pi;
    } else {
      const std::optional<double> fx = focal("fl_x", "camera_angle_x", width);
      // Without a size an angle over the height says nothing about the width.
      const std::optional<double> fy =
          camera.height > 0 ? focal("fl_y", "camera_angle_y", height) : std::nullopt;
      if (!fx && !fy) failHere("has neither 'fl_x' nor 'camera_angle_x'");
      camera.fx = fx ? *fx : *fy;
      camera.fy = fy ? *fy : *fx;
    }
    if (!hasImagePlane(camera) && camera.model != CameraModel::kEquirectangular) {
      camera.field_of_view = number("field_of_view").value_or(0.0);
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
    double error = 0;
    if (!takeNearestRotation(rotation, error)) {
      failHere("has a 'transform_matrix' that is not a rotation and a translation (it differs by " +
               std::to_string(error) + " from orthonormal; at most 0.005 is allowed)");
    }
    // OpenGL looks along −z with y up, OpenCV along +z with y down.
    rotation.col(1) = -rotation.col(1);
    rotation.col(2) = -rotation.col(2);
    placeCamera(rotation, matrix.topRightCorner<3, 1>(), camera);
  }

  const std::string& path_;
  const Json& file_;
  const Json& frame_;
  std::string name_;
  Distorted distorted_;
};

Json readJson(const std::string& path) {
  return parseJson(readTextFile(path, kMaxJsonBytes), path);
}

/// What the name of a transforms_*.json says of its views.
ViewRole splitOfName(const std::string& path) {
  const std::string name = fs::path(path).filename().string();
  if (name == "transforms_train.json") return ViewRole::kTrain;
  if (name == "transforms_test.json") return ViewRole::kTest;
  if (name == "transforms_val.json") return ViewRole::kValidation;
  return ViewRole::kNone;
}

/// Lists of file names that nerfstudio writes beside the frames.
std::map<std::string, ViewRole> namedSplits(const Json& file) {
  std::map<std::string, ViewRole> splits;
  const std::pair<const char*, ViewRole> lists[] = {{"train_filenames", ViewRole::kTrain},
                                                    {"test_filenames", ViewRole::kTest},
                                                    {"val_filenames", ViewRole::kValidation}};
  for (const auto& [key, split] : lists) {
    const auto found = file.find(key);
    if (found == file.end() || !found->is_array()) continue;
    for (const Json& name : *found) {
      // A view in two lists is one to train on: what is left out is what must not be seen.
      if (name.is_string()) splits.emplace(name.get<std::string>(), split);
    }
  }
  return splits;
}

std::vector<CameraView> readTransforms(const std::string& path, Distorted distorted) {
  const Json file = readJson(path);
  if (!file.is_object() || !file.contains("frames") || !file["frames"].is_array() ||
      file["frames"].empty()) {
    fail(ErrorCode::kFormat,
         path + " is not a transforms.json: a list 'frames' with at least one camera is needed");
  }
  const std::map<std::string, ViewRole> splits = namedSplits(file);
  std::vector<CameraView> views;
  const Json& frames = file["frames"];
  for (size_t i = 0; i < frames.size(); ++i) {
    views.push_back(FrameReader(path, file, frames[i], i, distorted).read());
    const auto named = splits.find(views.back().image_path);
    views.back().role = named != splits.end() ? named->second : splitOfName(path);
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
      const std::string& image = views[i].image_path;
      fail(ErrorCode::kFormat, path + ": view " + std::to_string(i) +
                                   (image.empty() ? "" : " ('" + image.substr(0, 80) + "')") +
                                   ": " + error.what());
    }
  }
}

}  // namespace

CameraFiles findCameraFiles(const std::string& path) {
  std::error_code ignored;
  const bool is_folder = fs::is_directory(path, ignored);
  CameraFiles files;
  if (is_folder) {
    const auto take = [&](const char* name) {
      const fs::path file = fs::path(path) / name;
      if (fs::exists(file, ignored)) files.transforms.push_back(file.string());
      return !files.transforms.empty();
    };
    if (take("transforms.json")) return files;
    if (take("transforms_train.json")) {
      take("transforms_test.json");
      take("transforms_val.json");
      return files;
    }
  }
  if (const std::optional<std::string> model = findColmapModel(path)) {
    files.colmap = *model;
  } else if (is_folder) {
    const fs::path bounds = fs::path(path) / kPoseBoundsName;
    if (!fs::exists(bounds, ignored)) {
      fail(ErrorCode::kFormat,
           path +
               " holds no cameras: transforms.json, transforms_train.json, images.bin or "
               "images.txt of COLMAP (there or in sparse/0), or poses_bounds.npy is needed");
    }
    files.pose_bounds = bounds.string();
  } else if (fs::path(path).filename() == kPoseBoundsName) {
    files.pose_bounds = path;
  } else {
    files.transforms.push_back(path);
  }
  return files;
}

std::vector<CameraView> readCameraFile(const std::string& path, Distorted distorted) {
  const CameraFiles files = findCameraFiles(path);
  std::vector<CameraView> views;
  if (!files.colmap.empty()) views = readColmapCameras(files.colmap, distorted);
  if (!files.pose_bounds.empty()) views = readPoseBounds(files.pose_bounds);
  for (const std::string& file : files.transforms) {
    const std::vector<CameraView> more = readTransforms(file, distorted);
    views.insert(views.end(), more.begin(), more.end());
  }
  requireUsable(views, path);
  return views;
}

std::string readPointsPath(const std::string& transforms) {
  const Json file = readJson(transforms);
  if (!file.is_object()) return {};
  const auto found = file.find("ply_file_path");
  if (found == file.end() || found->is_null()) return {};
  if (!found->is_string()) {
    fail(ErrorCode::kFormat, transforms + " has a 'ply_file_path' that is not a text");
  }
  return found->get<std::string>();
}

}  // namespace stipple
