#include "io/views/dataset_files.h"

#include <filesystem>
#include <optional>

#include "base/error.h"

namespace stipple {

namespace {

namespace fs = std::filesystem;

// How far above a model's folder its pictures may lie: colmap/sparse/0.
constexpr int kMaxLevelsUp = 3;

bool isFile(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

/// The file of this name, which may lack its ending.
std::optional<std::string> pictureFile(const fs::path& path) {
  if (isFile(path)) return path.string();
  for (const char* ending :
       {".png", ".jpg", ".jpeg", ".JPG", ".PNG", ".JPEG", ".exr", ".tif", ".tiff", ".webp"}) {
    const std::string with_ending = path.string() + ending;
    if (isFile(with_ending)) return with_ending;
  }
  return std::nullopt;
}

/// Masks in a folder beside the pictures, by the pictures' names.
class MaskFolder {
 public:
  explicit MaskFolder(fs::path folder) : folder_(std::move(folder)) {
    std::error_code ignored;
    exists_ = fs::is_directory(folder_, ignored);
  }

  std::string of(const fs::path& name) const {
    if (!exists_) return {};
    fs::path ending = name;
    ending.replace_extension(".png");
    for (const fs::path& candidate : {fs::path(name.string() + ".png"), name, ending}) {
      if (isFile(folder_ / candidate)) return (folder_ / candidate).string();
    }
    return {};
  }

 private:
  fs::path folder_;
  bool exists_ = false;
};

/// Files that are not there, told in one sentence at the end.
class Missing {
 public:
  void add(const fs::path& path) {
    if (count_++ == 0) first_ = path.string();
  }
  void refuse(const std::string& dataset, size_t of) const {
    if (count_ == 0) return;
    fail(ErrorCode::kIo,
         dataset + ": " + std::to_string(count_) + " of the files of " + std::to_string(of) +
             " views " + (count_ == 1 ? "is missing: " : "are missing, the first is ") + first_);
  }

 private:
  size_t count_ = 0;
  std::string first_;
};

/// The folder that the names of a COLMAP model's pictures start from.
fs::path colmapPictures(const std::string& model, const std::string& name) {
  fs::path around = fs::absolute(model).lexically_normal();
  if (!around.has_filename()) around = around.parent_path();
  std::string looked_in;
  for (int up = 0; up <= kMaxLevelsUp; ++up) {
    for (const fs::path& folder : {around / "images", around}) {
      if (isFile(folder / name)) return folder;
      if (folder != around || up == 0)
        looked_in += (looked_in.empty() ? "" : ", ") + folder.string();
    }
    around = around.parent_path();
  }
  fail(ErrorCode::kIo, model + ": the image '" + name +
                           "' is missing; the model's images are looked for in " + looked_in +
                           " and the folders around them");
}

std::vector<DatasetView> colmapViews(const std::string& path, const std::string& model) {
  const std::vector<CameraView> cameras = readCameraFile(path, Distorted::kKeep);
  const fs::path folder = colmapPictures(model, cameras.front().image_path);
  const MaskFolder masks(folder.parent_path() / "masks");
  std::vector<DatasetView> views;
  Missing missing;
  for (const CameraView& camera : cameras) {
    const fs::path image = folder / camera.image_path;
    if (!isFile(image)) missing.add(image);
    views.push_back({camera, image.string(), masks.of(camera.image_path), {}});
  }
  missing.refuse(path, views.size());
  return views;
}

/// The name of a picture from the folder around it, without the pictures' own folder.
fs::path nameBelowImages(const std::string& image_path) {
  const fs::path name = fs::path(image_path).lexically_normal();
  if (name.begin() == name.end() || *name.begin() != "images") return name;
  return name.lexically_relative("images");
}

void addTransforms(const std::string& path, std::vector<DatasetView>& views, Missing& missing) {
  const fs::path folder = fs::path(path).parent_path();
  const MaskFolder masks(folder / "masks");
  size_t frame = 0;
  for (const CameraView& camera : readCameraFile(path, Distorted::kKeep)) {
    if (camera.image_path.empty()) {
      fail(ErrorCode::kFormat,
           path + ": frame " + std::to_string(frame) + " has no 'file_path'; it has no image");
    }
    ++frame;
    DatasetView view{camera, {}, {}, {}};
    if (const auto image = pictureFile(folder / camera.image_path)) {
      view.image_path = *image;
    } else {
      missing.add(folder / camera.image_path);
    }
    const auto named = [&](const std::string& name) -> std::string {
      if (name.empty()) return {};
      if (!isFile(folder / name)) missing.add(folder / name);
      return (folder / name).string();
    };
    view.mask_path = named(camera.mask_path);
    view.depth_path = named(camera.depth_path);
    if (view.mask_path.empty()) view.mask_path = masks.of(nameBelowImages(camera.image_path));
    views.push_back(std::move(view));
  }
}

}  // namespace

std::vector<DatasetView> findDatasetViews(const std::string& path) {
  const CameraFiles files = findCameraFiles(path);
  if (!files.colmap.empty()) return colmapViews(path, files.colmap);
  std::vector<DatasetView> views;
  Missing missing;
  for (const std::string& file : files.transforms) addTransforms(file, views, missing);
  missing.refuse(path, views.size());
  return views;
}

}  // namespace stipple
