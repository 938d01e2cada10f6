#include "fit/training/collection.h"

#include <algorithm>
#include <filesystem>
#include <set>
#include <system_error>
#include <utility>

#include "base/error.h"
#include "base/random.h"
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

/// Over black.
class ReadViews final : public ObjectViews {
 public:
  explicit ReadViews(std::shared_ptr<const NormalisedViews> views) : views_(std::move(views)) {}
  size_t count() const override { return views_->count(); }
  ObjectView view(size_t index) const override {
    ViewPicture picture = views_->load(index);
    // Unlike in fits, where images without alpha are of a whole scene.
    if (picture.alpha.empty()) {
      refuse("image " + views_->name(index) + " has no alpha; objects are learned cut out");
    }
    return {views_->camera(index), std::move(picture.colour), std::move(picture.alpha)};
  }

 private:
  std::shared_ptr<const NormalisedViews> views_;
};

/// Refuses an object of which no image shows anything.
void requireShown(const ObjectViews& views) {
  const auto is_nothing = [](const std::vector<float>& values) {
    return std::all_of(values.begin(), values.end(), [](float value) { return !(value > 0); });
  };
  bool is_empty = true, is_black = true;
  for (size_t i = 0; i < views.count(); ++i) {
    const ObjectView view = views.view(i);
    is_empty = is_empty && is_nothing(view.alpha);
    is_black = is_black && is_nothing(view.image);
  }
  const std::string all = "all of its " + std::to_string(views.count()) + " images are ";
  if (is_empty) refuse(all + "empty");
  if (is_black) refuse(all + "black");
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

ObjectSplit splitObjects(size_t count, uint64_t every) {
  ObjectSplit split;
  for (size_t i = 0; i < count; ++i) {
    const bool is_held_out = every > 0 && i % every == every - 1;
    (is_held_out ? split.held_out : split.learned_from).push_back(i);
  }
  return split;
}

std::vector<size_t> evenly(const std::vector<size_t>& of, size_t wanted) {
  std::vector<size_t> chosen;
  const size_t count = std::min(of.size(), wanted);
  for (size_t i = 0; i < count; ++i) chosen.push_back(of[i * of.size() / count]);
  return chosen;
}

Collection::Collection(const std::string& folder, const CollectionOptions& options,
                       Progress* progress) {
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
      auto object =
          std::make_shared<TrainingObject>(readTrainingPoints(views->points(), options.points));
      object->views = std::make_shared<const ReadViews>(views);
      requireShown(*object->views);
      objects_.push_back({name, std::move(views), std::move(object)});
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

void requireSameTraining(GradientExchange& exchange, const std::string& settings,
                         const Collection& collection, uint64_t taken) {
  const auto of = [](const std::string& text) {
    uint64_t bits = 0;
    for (const char letter : text) bits = mixBits(bits ^ static_cast<unsigned char>(letter));
    return bits;
  };
  std::string objects;
  for (size_t i = 0; i < collection.count(); ++i) objects += collection.name(i) + '\n';
  requireSame(exchange, of(settings), "the settings");
  requireSame(exchange, of(objects), "the objects");
  requireSame(exchange, mixBits(taken), "the checkpoints");
}

}  // namespace stipple
