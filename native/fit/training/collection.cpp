#include "fit/training/collection.h"

#include <algorithm>
#include <filesystem>
#include <set>
#include <system_error>
#include <utility>

#include "base/error.h"
#include "io/views/dataset.h"
#include "math/colour.h"

namespace stipple {

namespace {

namespace fs = std::filesystem;

constexpr char kCameraFile[] = "transforms.json";
constexpr char kStage[] = "Reading the collection";
constexpr size_t kMostFiles = size_t{1} << 20;
constexpr float kMiddle = 0.5f;  ///< of the unit cube, which is the origin of views

[[noreturn]] void refuse(const std::string& message) {
  fail(ErrorCode::kInvalidArgument, message);
}

/// Folders with a list of cameras, by name.
std::vector<fs::path> objectFolders(const std::string& folder) {
  std::set<fs::path> found;
  std::error_code error;
  size_t seen = 0;
  fs::recursive_directory_iterator at(folder, error);
  for (const fs::recursive_directory_iterator end; !error && at != end; at.increment(error)) {
    if (++seen > kMostFiles) {
      refuse("'" + folder + "' holds more than " + std::to_string(kMostFiles) +
             " files and folders; choose the folder that the objects are in");
    }
    if (at->path().filename() == kCameraFile) found.insert(at->path().parent_path());
  }
  if (error) fail(ErrorCode::kIo, "'" + folder + "' cannot be read: " + error.message());
  return {found.begin(), found.end()};
}

/// Unlike in fits, where images without alpha are of a whole scene.
ObjectView viewOf(const NormalisedViews& views, size_t view) {
  ViewPicture picture = views.packed(view)->unpacked();
  if (picture.alpha.empty()) {
    refuse("image " + views.name(view) + " has no alpha; objects are learned cut out");
  }
  return {views.camera(view), std::move(picture.colour), std::move(picture.alpha)};
}

bool showsNothing(const ObjectView& view) {
  return std::all_of(view.alpha.begin(), view.alpha.end(), [](float a) { return !(a > 0); });
}

bool isBlack(const ObjectView& view) {
  return std::all_of(view.image.begin(), view.image.end(), [](float c) { return !(c > 0); });
}

}  // namespace

TrainingObject readTrainingPoints(const PointSet& surface, uint64_t points) {
  const size_t count = surface.positions.size() / 3;
  if (surface.colours.size() != surface.positions.size()) {
    refuse("the " + std::to_string(count) + " points of the surface have no colours");
  }
  TrainingObject object;
  object.points.resize(1);
  object.features.resize(1);
  for (const float value : surface.positions) object.surface.push_back(value + kMiddle);
  const size_t wanted = std::min<size_t>(points, count);
  for (size_t i = 0; i < wanted; ++i) {
    const size_t from = i * count / wanted;
    for (size_t c = 0; c < 3; ++c) {
      object.points[0].push_back(object.surface[from * 3 + c]);
      const float shown = std::clamp(linearToSrgb(surface.colours[from * 3 + c]), 0.0f, 1.0f);
      object.features[0].push_back(2 * shown - 1);
    }
  }
  return object;
}

TrainingObject readTrainingObject(const NormalisedViews& views, uint64_t points) {
  TrainingObject object = readTrainingPoints(views.points(), points);
  bool is_empty = true, is_black = true;
  for (size_t view = 0; view < views.count(); ++view) {
    object.views.push_back(viewOf(views, view));
    is_empty = is_empty && showsNothing(object.views.back());
    is_black = is_black && isBlack(object.views.back());
  }
  if (is_empty) refuse("all of its " + std::to_string(views.count()) + " images are empty");
  if (is_black) refuse("all of its " + std::to_string(views.count()) + " images are black");
  return object;
}

Collection::Collection(const std::string& folder, const CollectionOptions& options,
                       Progress* progress)
    : options_(options) {
  if (options.points < 1 || options.points > kMostEncodedPoints) {
    refuse("the number of points of an object is " + std::to_string(options.points) + "; 1 to " +
           std::to_string(kMostEncodedPoints) + " is allowed");
  }
  const std::vector<fs::path> folders = objectFolders(folder);
  DatasetOptions dataset;
  dataset.cache_bytes = options.image_bytes / std::max<size_t>(1, folders.size());
  for (size_t i = 0; i < folders.size(); ++i) {
    advance(progress, static_cast<double>(i) / static_cast<double>(folders.size()), kStage);
    const std::string name = folders[i].lexically_relative(folder).generic_string();
    try {
      auto views =
          std::make_shared<const NormalisedViews>(openDataset(folders[i].string(), dataset));
      if (!objects_.empty() && objects_.front().views->colourSpace() != views->colourSpace()) {
        refuse("its images are of another colour space than those of '" + objects_.front().name +
               "': all have to be 8-bit images, or all float images");
      }
      readTrainingObject(*views, options.points);
      objects_.push_back({name, std::move(views)});
    } catch (const Error& error) {
      if (error.code() == ErrorCode::kCancelled) throw;
      notes_.push_back("Object '" + name + "' is left out: " + error.what() + ".");
    }
  }
  if (!objects_.empty()) return;
  refuse("'" + folder + "' has no object that can be learned from" +
         (notes_.empty() ? std::string(": no folder in it has a ") + kCameraFile
                         : ". " + notes_.front()));
}

std::shared_ptr<const TrainingObject> Collection::object(size_t object) const {
  return std::make_shared<const TrainingObject>(
      readTrainingObject(*objects_[object].views, options_.points));
}

}  // namespace stipple
