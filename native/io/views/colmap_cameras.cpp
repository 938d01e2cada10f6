// Based on: the output format of COLMAP (Schönberger and Frahm, Structure-from-Motion Revisited,
// CVPR 2016; colmap.github.io/format.html): cameras and images, binary and text.
#include "io/views/colmap_cameras.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>

#include "base/error.h"
#include "io/views/colmap_models.h"
#include "io/views/colmap_reading.h"
#include "math/quaternion.h"

namespace stipple {

namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxNameBytes = 4096;
constexpr double kMaxSide = 65536;

struct ColmapCamera {
  const ColmapModel* model = nullptr;
  double width = 0;
  double height = 0;
  std::vector<double> parameters;
};

struct ColmapImage {
  uint32_t camera = 0;
  std::array<double, 4> rotation{};  ///< w, x, y, z: world to camera
  std::array<double, 3> translation{};
  std::string name;
};

using Cameras = std::map<uint32_t, ColmapCamera>;

Cameras readBinaryCameras(const std::string& path) {
  ColmapBytes file(path);
  Cameras cameras;
  const auto count = file.take<uint64_t>("the number of cameras");
  for (uint64_t i = 0; i < count; ++i) {
    const auto id = file.take<uint32_t>("a camera's number");
    const auto model = file.take<int32_t>("a camera's model");
    ColmapCamera camera;
    camera.model = colmapModel(model);
    if (camera.model == nullptr) {
      fail(ErrorCode::kUnsupported, path + ": camera " + std::to_string(id) + " has model " +
                                        std::to_string(model) + "; models 0 to 11 are supported");
    }
    camera.width = static_cast<double>(file.take<uint64_t>("a camera's width"));
    camera.height = static_cast<double>(file.take<uint64_t>("a camera's height"));
    for (size_t p = 0; p < camera.model->parameter_count; ++p) {
      camera.parameters.push_back(file.take<double>("a camera's parameters"));
    }
    cameras[id] = std::move(camera);
  }
  return cameras;
}

std::vector<ColmapImage> readBinaryImages(const std::string& path) {
  ColmapBytes file(path);
  std::vector<ColmapImage> images;
  const auto count = file.take<uint64_t>("the number of images");
  for (uint64_t i = 0; i < count; ++i) {
    ColmapImage image;
    file.skip(sizeof(uint32_t), "an image's number");
    for (double& value : image.rotation) value = file.take<double>("an image's rotation");
    for (double& value : image.translation) value = file.take<double>("an image's translation");
    image.camera = file.take<uint32_t>("an image's camera");
    while (const char letter = file.take<char>("an image's name")) {
      image.name.push_back(letter);
      if (image.name.size() > kMaxNameBytes) {
        fail(ErrorCode::kFormat, path + ": the image's name before byte " +
                                     std::to_string(file.offset()) + " is longer than " +
                                     std::to_string(kMaxNameBytes) + " bytes");
      }
    }
    const auto points = file.take<uint64_t>("an image's number of points");
    constexpr uint64_t kPointBytes = 24;
    // Compared by division, because the product of a damaged number may not fit.
    if (points > file.left() / kPointBytes) {
      fail(ErrorCode::kFormat, path + ": image '" + image.name + "' claims " +
                                   std::to_string(points) + " points of 24 bytes at byte " +
                                   std::to_string(file.offset()) + "; " +
                                   std::to_string(file.left()) + " bytes are left");
    }
    file.skip(points * kPointBytes, "an image's points");
    images.push_back(std::move(image));
  }
  return images;
}

Cameras readTextCameras(const std::string& path) {
  ColmapLines file(path);
  Cameras cameras;
  while (file.next(true)) {
    const auto id = file.number<uint32_t>("the camera's number");
    const std::string name(file.word());
    ColmapCamera camera;
    camera.model = colmapModel(name);
    if (camera.model == nullptr) {
      fail(ErrorCode::kUnsupported, path + ": camera " + std::to_string(id) + " has the model '" +
                                        name.substr(0, 60) + "'; " + colmapModelNames() +
                                        " are supported");
    }
    camera.width = file.number<double>("the camera's width");
    camera.height = file.number<double>("the camera's height");
    for (size_t p = 0; p < camera.model->parameter_count; ++p) {
      camera.parameters.push_back(file.number<double>("a camera's parameter"));
    }
    cameras[id] = std::move(camera);
  }
  return cameras;
}

std::vector<ColmapImage> readTextImages(const std::string& path) {
  ColmapLines file(path);
  std::vector<ColmapImage> images;
  while (file.next(true)) {
    ColmapImage image;
    file.number<uint64_t>("the image's number");
    for (double& value : image.rotation) value = file.number<double>("the image's rotation");
    for (double& value : image.translation) {
      value = file.number<double>("the image's translation");
    }
    image.camera = file.number<uint32_t>("the image's camera");
    image.name = std::string(file.rest());
    if (image.name.empty()) file.failHere("has no name of an image");
    images.push_back(std::move(image));
    // The points of the picture, an empty line where it has none.
    file.next(false);
  }
  return images;
}

/// Turns one picture with its camera into ours, or says why that cannot be.
class ViewMaker {
 public:
  ViewMaker(std::string cameras_path, std::string images_path, Cameras cameras, Distorted distorted)
      : cameras_path_(std::move(cameras_path)),
        images_path_(std::move(images_path)),
        cameras_(std::move(cameras)),
        distorted_(distorted) {}

  CameraView make(const ColmapImage& image) const {
    CameraView view;
    view.image_path = image.name;
    intrinsics(image, view);
    pose(image, view.camera);
    return view;
  }

 private:
  void intrinsics(const ColmapImage& image, CameraView& view) const {
    const auto found = cameras_.find(image.camera);
    if (found == cameras_.end()) {
      fail(ErrorCode::kFormat, images_path_ + ": image '" + image.name + "' uses camera " +
                                   std::to_string(image.camera) + ", which " + cameras_path_ +
                                   " does not hold");
    }
    const ColmapCamera& from = found->second;
    const std::string name = cameras_path_ + ": camera " + std::to_string(image.camera) + " ";
    for (const double side : {from.width, from.height}) {
      if (!(side >= 1) || side > kMaxSide || side != std::floor(side)) {
        fail(ErrorCode::kFormat, name + "has a side of " + std::to_string(side) +
                                     " pixels; a whole number from 1 to 65536 is needed");
      }
    }
    for (const double value : from.parameters) {
      if (!std::isfinite(value)) {
        fail(ErrorCode::kFormat, name + "has a parameter that is not a finite number");
      }
    }
    view.lens = colmapLens(*from.model, from.parameters);
    view.camera_model = from.model->name;
    if (distorted_ == Distorted::kRefuse && view.lens.isDistorted()) {
      fail(ErrorCode::kUnsupported,
           name + "is distorted (model " + from.model->name +
               "); undistort the images first (colmap image_undistorter makes PINHOLE cameras)");
    }
    Camera& camera = view.camera;
    camera.width = static_cast<uint32_t>(from.width);
    camera.height = static_cast<uint32_t>(from.height);
    setColmapIntrinsics(*from.model, from.parameters, camera);
    if (!(camera.fx > 0) || !(camera.fy > 0)) {
      fail(ErrorCode::kFormat, name + "has focal lengths " + std::to_string(camera.fx) + " and " +
                                   std::to_string(camera.fy) + "; positive numbers are needed");
    }
  }

  void pose(const ColmapImage& image, Camera& camera) const {
    const std::string name = images_path_ + ": image '" + image.name + "' ";
    double squares = 0;
    bool finite = true;
    for (const double value : image.rotation) {
      squares += value * value;
      finite = finite && std::isfinite(value);
    }
    for (const double value : image.translation) finite = finite && std::isfinite(value);
    if (!finite || !std::isfinite(squares)) {
      fail(ErrorCode::kFormat, name + "has a pose that is not made of finite numbers");
    }
    if (!(squares > 0)) fail(ErrorCode::kFormat, name + "has the zero quaternion as its rotation");
    camera.world_to_camera = Mat4d::Identity();
    camera.world_to_camera.topLeftCorner<3, 3>() =
        rotationFromQuaternion<double>(image.rotation.data());
    camera.world_to_camera.topRightCorner<3, 1>() =
        Vec3d(image.translation[0], image.translation[1], image.translation[2]);
  }

  std::string cameras_path_;
  std::string images_path_;
  Cameras cameras_;
  Distorted distorted_;
};

bool holdsModel(const fs::path& folder) {
  std::error_code ignored;
  return fs::exists(folder / "images.bin", ignored) || fs::exists(folder / "images.txt", ignored);
}

}  // namespace

std::optional<std::string> findColmapModel(const std::string& path) {
  std::error_code ignored;
  const fs::path given(path);
  if (!fs::is_directory(given, ignored)) {
    const std::string name = given.filename().string();
    for (const char* known : {"cameras.bin", "images.bin", "cameras.txt", "images.txt"}) {
      if (name == known) {
        return given.has_parent_path() ? given.parent_path().string() : std::string(".");
      }
    }
    return std::nullopt;
  }
  for (const char* place : {"", "sparse/0", "sparse", "colmap/sparse/0"}) {
    const fs::path folder = *place == '\0' ? given : given / place;
    if (holdsModel(folder)) return folder.string();
  }
  return std::nullopt;
}

std::vector<CameraView> readColmapCameras(const std::string& folder, Distorted distorted) {
  std::error_code ignored;
  const bool binary = fs::exists(fs::path(folder) / "images.bin", ignored);
  const std::string extension = binary ? ".bin" : ".txt";
  const std::string cameras_path = (fs::path(folder) / ("cameras" + extension)).string();
  const std::string images_path = (fs::path(folder) / ("images" + extension)).string();
  const ViewMaker maker(cameras_path, images_path,
                        binary ? readBinaryCameras(cameras_path) : readTextCameras(cameras_path),
                        distorted);
  const std::vector<ColmapImage> images =
      binary ? readBinaryImages(images_path) : readTextImages(images_path);
  if (images.empty()) {
    fail(ErrorCode::kFormat, images_path + " holds no images; at least one is needed");
  }
  std::vector<CameraView> views;
  for (const ColmapImage& image : images) views.push_back(maker.make(image));
  std::stable_sort(views.begin(), views.end(), [](const CameraView& a, const CameraView& b) {
    return a.image_path < b.image_path;
  });
  return views;
}

}  // namespace stipple
