#include "io/views/dataset_files.h"

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <utility>

#include "base/error.h"
#include "data/views/view_resample.h"
#include "io/image_file.h"
#include "io/views/numbered_frames.h"
#include "io/views/pose_bounds_files.h"

namespace stipple {

namespace {

namespace fs = std::filesystem;

// How far above a model's folder its pictures may lie: colmap/sparse/0.
constexpr int kMaxLevelsUp = 3;

bool isFile(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

/// The file of this name, which may lack its extension.
std::optional<std::string> pictureFile(const fs::path& path) {
  if (isFile(path)) return path.string();
  for (const char* extension :
       {".png", ".jpg", ".jpeg", ".JPG", ".PNG", ".JPEG", ".exr", ".tif", ".tiff", ".webp"}) {
    const std::string with_extension = path.string() + extension;
    if (isFile(with_extension)) return with_extension;
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
    fs::path as_png = name;
    as_png.replace_extension(".png");
    for (const fs::path& candidate : {fs::path(name.string() + ".png"), name, as_png}) {
      if (isFile(folder_ / candidate)) return (folder_ / candidate).string();
    }
    return {};
  }

 private:
  fs::path folder_;
  bool exists_ = false;
};

/// Files that are not there, told in one sentence at the end: images, which views can do without,
/// or masks and depths, without which a view would be taken for something else.
class Missing {
 public:
  void addImage(const fs::path& path) { images_.add(path); }
  void addOther(const fs::path& path) { others_.add(path); }

  /// In: files, the views that have their images; the note of those that have not is added.
  void settle(const std::string& dataset, DatasetFiles& files) const {
    if (others_.count > 0) {
      fail(ErrorCode::kIo, dataset + ": " + std::to_string(others_.count) +
                               " of the masks and depth images that it names " + others_.tail());
    }
    if (images_.count == 0) return;
    const std::string sentence = dataset + ": " + std::to_string(images_.count) + " of " +
                                 std::to_string(images_.count + files.views.size()) + " images " +
                                 images_.tail();
    if (files.views.size() < kFewestViewsLeft) {
      fail(ErrorCode::kIo,
           sentence + "; at least " + std::to_string(kFewestViewsLeft) + " must be there");
    }
    files.notes.push_back(sentence + "; their views are left out");
  }

 private:
  struct Kind {
    size_t count = 0;
    std::string first;

    void add(const fs::path& path) {
      if (count++ == 0) first = path.string();
    }
    std::string tail() const {
      return (count == 1 ? "is missing: " : "are missing, the first is ") + first;
    }
  };

  Kind images_, others_;
};

/// The folder that the names of a COLMAP model's pictures start from: where any of them is.
fs::path colmapPictures(const std::string& model, const std::vector<CameraView>& cameras) {
  fs::path around = fs::absolute(model).lexically_normal();
  if (!around.has_filename()) around = around.parent_path();
  std::string looked_in;
  for (int up = 0; up <= kMaxLevelsUp; ++up) {
    for (const fs::path& folder : {around / "images", around}) {
      for (const CameraView& camera : cameras) {
        if (isFile(folder / camera.image_path)) return folder;
      }
      if (folder != around || up == 0)
        looked_in += (looked_in.empty() ? "" : ", ") + folder.string();
    }
    around = around.parent_path();
  }
  fail(ErrorCode::kIo,
       model + ": the image '" + cameras.front().image_path +
           "' is missing, and all others are; the model's images are looked for in " + looked_in +
           " and the folders around them");
}

/// The frames that lie beside listed images. Cameras that move list more than one image of a
/// folder, and have no others.
class FrameFolders {
 public:
  /// In: around: the folder that names of images start from.
  FrameFolders(fs::path around, const std::vector<CameraView>& listed, bool is_wanted)
      : around_(std::move(around)), is_wanted_(is_wanted) {
    if (!is_wanted) return;
    for (const CameraView& camera : listed) ++counts_[folderOf(camera)];
  }

  /// Adds all frames of a listed image's camera. In: camera and masks as those of the image.
  /// Returns: false where there is none beside it.
  bool add(const CameraView& camera, const MaskFolder& masks,
           const std::function<fs::path(const std::string&)>& mask_name,
           std::vector<DatasetView>& views) const {
    const fs::path name = fs::path(camera.image_path).filename();
    if (!is_wanted_ || camera.has_time || camera.frame || !frameNumber(name)) return false;
    if (!camera.mask_path.empty() || !camera.depth_path.empty()) return false;
    if (counts_.at(folderOf(camera)) != 1) return false;
    const std::vector<NumberedFrame> frames = numberedFrames(folderOf(camera), name);
    if (frames.size() < 2) return false;
    CameraView sized = camera;
    if (camera.camera.width == 0) {
      const ImageHeader header =
          readImageHeader((folderOf(camera) / frames.front().file_name).string());
      sized.camera = resized(camera.camera, header.width, header.height);
    }
    for (const NumberedFrame& frame : frames) {
      DatasetView view{sized, {}, {}, {}};
      view.view.image_path =
          (fs::path(camera.image_path).parent_path() / frame.file_name).generic_string();
      view.view.frame = frame.number;
      view.image_path = (around_ / view.view.image_path).string();
      view.mask_path = masks.of(mask_name(view.view.image_path));
      view.is_of_folder = true;
      views.push_back(std::move(view));
    }
    return true;
  }

 private:
  fs::path folderOf(const CameraView& camera) const {
    return (around_ / camera.image_path).lexically_normal().parent_path();
  }

  fs::path around_;
  bool is_wanted_;
  std::map<fs::path, size_t> counts_;  ///< listed images of each folder
};

DatasetFiles colmapFiles(const std::string& path, const std::string& model, bool with_frames) {
  const std::vector<CameraView> cameras = readCameraFile(path, Distorted::kKeep);
  const fs::path folder = colmapPictures(model, cameras);
  const MaskFolder masks(folder.parent_path() / "masks");
  const FrameFolders frames(folder, cameras, with_frames);
  const auto as_it_is = [](const std::string& name) { return fs::path(name); };
  DatasetFiles files;
  Missing missing;
  for (const CameraView& camera : cameras) {
    if (frames.add(camera, masks, as_it_is, files.views)) continue;
    const fs::path image = folder / camera.image_path;
    if (isFile(image)) {
      files.views.push_back({camera, image.string(), masks.of(camera.image_path), {}});
    } else {
      missing.addImage(image);
    }
  }
  missing.settle(path, files);
  return files;
}

/// The name of a picture from the folder around it, without the pictures' own folder.
fs::path nameBelowImages(const std::string& image_path) {
  const fs::path name = fs::path(image_path).lexically_normal();
  if (name.begin() == name.end() || *name.begin() != "images") return name;
  return name.lexically_relative("images");
}

void addTransforms(const std::string& path, bool with_frames, std::vector<DatasetView>& views,
                   Missing& missing) {
  const fs::path folder = fs::path(path).parent_path();
  const MaskFolder masks(folder / "masks");
  const std::vector<CameraView> cameras = readCameraFile(path, Distorted::kKeep);
  const FrameFolders frames(folder, cameras, with_frames);
  size_t frame = 0;
  for (const CameraView& camera : cameras) {
    if (camera.image_path.empty()) {
      fail(ErrorCode::kFormat,
           path + ": frame " + std::to_string(frame) + " has no 'file_path'; it has no image");
    }
    ++frame;
    if (frames.add(camera, masks, nameBelowImages, views)) continue;
    DatasetView view{camera, {}, {}, {}};
    const auto image = pictureFile(folder / camera.image_path);
    if (!image) {
      missing.addImage(folder / camera.image_path);
      continue;
    }
    view.image_path = *image;
    const auto named = [&](const std::string& name) -> std::string {
      if (name.empty()) return {};
      if (!isFile(folder / name)) missing.addOther(folder / name);
      return (folder / name).string();
    };
    view.mask_path = named(camera.mask_path);
    view.depth_path = named(camera.depth_path);
    if (view.mask_path.empty()) view.mask_path = masks.of(nameBelowImages(camera.image_path));
    views.push_back(std::move(view));
  }
}

}  // namespace

DatasetFiles findDatasetFiles(const std::string& path, bool with_frames) {
  const CameraFiles cameras = findCameraFiles(path);
  if (!cameras.colmap.empty()) return colmapFiles(path, cameras.colmap, with_frames);
  if (!cameras.pose_bounds.empty()) return findPoseBoundsFiles(cameras.pose_bounds, with_frames);
  DatasetFiles files;
  Missing missing;
  for (const std::string& file : cameras.transforms) {
    addTransforms(file, with_frames, files.views, missing);
  }
  missing.settle(path, files);
  return files;
}

}  // namespace stipple
