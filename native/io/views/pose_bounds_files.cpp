#include "io/views/pose_bounds_files.h"

#include <cmath>
#include <filesystem>

#include "base/error.h"
#include "base/number_text.h"
#include "data/views/view_resample.h"
#include "io/image_file.h"
#include "io/views/numbered_frames.h"
#include "io/views/pose_bounds.h"

namespace stipple {

namespace {

namespace fs = std::filesystem;

/// Sides of smaller images are rounded to whole pixels.
constexpr double kSideTolerance = 0.01;

bool isCameraName(const fs::path& path) {
  std::string begin = path.filename().string().substr(0, 3);
  for (char& c : begin) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return begin == "cam";
}

/// The folder of a camera's images below the data set, and what they are called.
struct FrameFolder {
  fs::path name;
  std::vector<NumberedFrame> frames;
};

FrameFolder framesOf(const fs::path& dataset, const fs::path& folder) {
  const fs::path name = folder.filename();
  FrameFolder found{name, numberedFrames(folder)};
  if (found.frames.empty()) found = {name / "images", numberedFrames(dataset / name / "images")};
  return found;
}

std::vector<FrameFolder> cameraFolders(const fs::path& dataset) {
  std::vector<FrameFolder> named, numbered;
  for (const fs::path& folder : foldersIn(dataset)) {
    const bool is_named = isCameraName(folder);
    FrameFolder found = framesOf(dataset, folder);
    if (found.frames.empty()) {
      if (!is_named) continue;
      fail(ErrorCode::kFormat, folder.string() +
                                   " holds no numbered images; the frames of a camera are called "
                                   "by their numbers, as 0000.png, in its folder or in its images");
    }
    (is_named ? named : numbered).push_back(std::move(found));
  }
  return named.empty() ? numbered : named;
}

[[noreturn]] void refuseVideos(const fs::path& dataset, const std::vector<fs::path>& videos) {
  const fs::path first = videos.front().filename();
  const std::string folder = first.stem().string();
  fail(ErrorCode::kUnsupported,
       dataset.string() + " holds " + std::to_string(videos.size()) + " videos (" + first.string() +
           " is the first), and videos are not decoded; make a folder of numbered images of each, "
           "with ffmpeg: mkdir " +
           folder + " && ffmpeg -i " + first.string() + " -start_number 0 " + folder +
           "/%04d.png, or in Blender: add the video as a strip of the sequencer and render the "
           "animation as PNG into the folder");
}

/// The camera of images of the size that the first one has.
void scaleToImage(Camera& camera, const std::string& image, const std::string& bounds) {
  const ImageHeader header = readImageHeader(image);
  const double by_width = static_cast<double>(header.width) / camera.width;
  const double by_height = static_cast<double>(header.height) / camera.height;
  if (std::abs(by_width - by_height) > kSideTolerance * by_width) {
    fail(ErrorCode::kFormat, image + " is " + sizeText(header.width, header.height) + " pixels; " +
                                 bounds + " says " + sizeText(camera.width, camera.height) +
                                 ", or the same made smaller alike along both sides");
  }
  camera = resized(camera, header.width, header.height);
}

}  // namespace

DatasetFiles findPoseBoundsFiles(const std::string& bounds, bool with_frames) {
  const std::vector<CameraView> cameras = readPoseBounds(bounds);
  const fs::path dataset = fs::path(bounds).parent_path();
  const fs::path listed = dataset.empty() ? fs::path(".") : dataset;
  const std::vector<FrameFolder> folders = cameraFolders(listed);
  if (folders.empty()) {
    const std::vector<fs::path> videos = videosIn(listed);
    if (!videos.empty()) refuseVideos(listed, videos);
  }
  if (folders.size() != cameras.size()) {
    fail(ErrorCode::kFormat,
         bounds + " is of " + std::to_string(cameras.size()) + " cameras, and beside it are " +
             std::to_string(folders.size()) + " folders of numbered images" +
             (folders.empty() ? ""
                              : " (" + folders.front().name.string() + " is the first, " +
                                    folders.back().name.string() + " the last)") +
             "; each camera needs one, in the order of their names");
  }
  DatasetFiles files;
  for (size_t c = 0; c < cameras.size(); ++c) {
    const FrameFolder& folder = folders[c];
    CameraView camera = cameras[c];
    scaleToImage(camera.camera, (dataset / folder.name / folder.frames[0].file_name).string(),
                 bounds);
    for (const NumberedFrame& frame : folder.frames) {
      DatasetView view;
      view.view = camera;
      view.view.image_path = (folder.name / frame.file_name).generic_string();
      view.view.frame = frame.number;
      view.image_path = (dataset / view.view.image_path).string();
      view.is_of_folder = true;
      files.views.push_back(std::move(view));
      if (!with_frames) break;
    }
  }
  return files;
}

}  // namespace stipple
