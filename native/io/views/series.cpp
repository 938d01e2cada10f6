#include "io/views/series.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/number_text.h"
#include "io/views/numbered_frames.h"
#include "io/views/series_choice.h"

namespace stipple {

namespace {

namespace fs = std::filesystem;

constexpr double kLeastFrameRate = 1e-3;
constexpr double kMostFrameRate = 1e6;
// Names that one sentence lists; a hundred cameras would hide what it says.
constexpr size_t kNamesInSentence = 3;

void requireOptions(const SeriesOptions& options) {
  const double rate = options.frame_rate;
  if (rate != 0 && !(rate >= kLeastFrameRate && rate <= kMostFrameRate)) {
    fail(ErrorCode::kInvalidArgument, "the frame rate is " + numberText(rate) +
                                          "; 0.001 to 1000000 frames per second are allowed");
  }
  if (options.frame_step < 1) {
    fail(ErrorCode::kInvalidArgument, "the step of frames is 0; at least 1 is needed");
  }
  if (options.last_frame < options.first_frame) {
    fail(ErrorCode::kInvalidArgument,
         "frames " + std::to_string(options.first_frame) + " to " +
             std::to_string(options.last_frame) +
             " are asked for; the last one may not come before the first");
  }
}

/// Numbers of frames become times. Returns: whether there are any.
void timeFrames(const std::string& dataset, double frame_rate, std::vector<DatasetView>& views) {
  bool has_frames = frame_rate > 0;
  for (const DatasetView& view : views) {
    has_frames = has_frames || view.is_of_folder || view.view.frame.has_value();
  }
  if (!has_frames) return;
  const double rate = frame_rate > 0 ? frame_rate : kDefaultFrameRate;
  for (DatasetView& view : views) {
    CameraView& camera = view.view;
    if (camera.has_time) continue;
    if (!camera.frame) camera.frame = frameNumber(fs::path(camera.image_path).filename());
    if (!camera.frame) {
      fail(ErrorCode::kFormat,
           dataset + ": the name of the image '" + camera.image_path.substr(0, 200) +
               "' does not end in the number of its frame, as those of other images do");
    }
    camera.time = static_cast<double>(*camera.frame) / rate;
  }
}

fs::path folderOf(const DatasetView& view) {
  return fs::path(view.view.image_path).lexically_normal().parent_path();
}

/// "cam00" of "./images/cam00" and of "cam00/images".
std::string labelOf(const fs::path& folder) {
  std::vector<fs::path> parts;
  for (const fs::path& part : folder) {
    if (!part.empty() && part != "." && part != "..") parts.push_back(part);
  }
  if (parts.size() > 1 && parts.front() == "images") parts.erase(parts.begin());
  if (parts.size() > 1 && parts.back() == "images") parts.pop_back();
  fs::path label;
  for (const fs::path& part : parts) label /= part;
  return label.generic_string();
}

/// What views of a camera that stands still share.
using Pose = std::array<double, 22>;

Pose poseOf(const Camera& camera) {
  Pose pose = {};
  std::copy_n(camera.world_to_camera.data(), 16, pose.begin());
  const double more[] = {camera.fx,
                         camera.fy,
                         camera.cx,
                         camera.cy,
                         static_cast<double>(camera.width),
                         static_cast<double>(camera.height)};
  std::copy_n(more, 6, pose.begin() + 16);
  return pose;
}

/// Cameras that stand still, by their pose. A folder is their name where no other view lies in it.
void nameStillCameras(std::vector<DatasetView>& views) {
  std::map<Pose, std::vector<size_t>> by_pose;
  std::map<fs::path, size_t> folder_sizes;
  for (size_t i = 0; i < views.size(); ++i) {
    ++folder_sizes[folderOf(views[i])];
    if (views[i].camera_name.empty()) by_pose[poseOf(views[i].view.camera)].push_back(i);
  }
  for (const auto& [pose, group] : by_pose) {
    std::set<double> times;
    std::set<fs::path> folders;
    for (const size_t i : group) {
      times.insert(views[i].view.time);
      folders.insert(folderOf(views[i]));
    }
    if (times.size() < 2) continue;
    const std::string label = labelOf(*folders.begin());
    const bool has_folder =
        folders.size() == 1 && !label.empty() && folder_sizes.at(*folders.begin()) == group.size();
    const std::string name = has_folder ? label : views[group.front()].view.image_path;
    for (const size_t i : group) views[i].camera_name = name;
  }
}

/// Cameras that move, by their folders, where there are several and nobody says what is held out.
void nameMovingCameras(std::vector<DatasetView>& views) {
  std::set<fs::path> folders;
  std::set<std::string> taken;
  for (const DatasetView& view : views) {
    if (view.view.role != ViewRole::kNone) return;
    folders.insert(folderOf(view));
    taken.insert(view.camera_name);
  }
  if (folders.size() < 2) return;
  for (DatasetView& view : views) {
    if (!view.camera_name.empty()) continue;
    const std::string label = labelOf(folderOf(view));
    if (taken.count(label) == 0) view.camera_name = label;
  }
}

void nameCameras(std::vector<DatasetView>& views) {
  std::set<double> times;
  for (DatasetView& view : views) {
    times.insert(view.view.time);
    if (view.is_of_folder) view.camera_name = labelOf(folderOf(view));
  }
  if (times.size() < 2) return;
  nameStillCameras(views);
  nameMovingCameras(views);
}

/// The number of each view's frame: as its file's name has it, or where a time has none, its place
/// among all times.
std::vector<uint64_t> frameNumbers(const std::vector<DatasetView>& views) {
  std::vector<uint64_t> numbers;
  std::vector<double> times;
  for (const DatasetView& view : views) {
    times.push_back(view.view.time);
    if (view.view.frame) numbers.push_back(*view.view.frame);
  }
  if (numbers.size() == views.size()) return numbers;
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end()), times.end());
  numbers.clear();
  for (const DatasetView& view : views) {
    numbers.push_back(static_cast<uint64_t>(
        std::lower_bound(times.begin(), times.end(), view.view.time) - times.begin()));
  }
  return numbers;
}

/// Frames that one camera lacks and another has, of cameras with numbered frames.
void noteMissingFrames(const std::string& dataset, DatasetFiles& files) {
  std::map<std::string, std::set<uint64_t>> by_camera;
  std::set<uint64_t> all;
  for (const DatasetView& view : files.views) {
    if (view.camera_name.empty() || !view.view.frame) continue;
    by_camera[view.camera_name].insert(*view.view.frame);
    all.insert(*view.view.frame);
  }
  std::string names;
  size_t lacking = 0;
  for (const auto& [name, frames] : by_camera) {
    if (frames.size() == all.size()) continue;
    if (lacking++ >= kNamesInSentence) continue;
    const auto first = std::find_if(all.begin(), all.end(), [&frames = frames](uint64_t frame) {
      return frames.count(frame) == 0;
    });
    names += (names.empty() ? "" : ", ") + name + " lacks " +
             std::to_string(all.size() - frames.size()) + " (" + std::to_string(*first) +
             " is the first)";
  }
  if (lacking == 0) return;
  if (lacking > kNamesInSentence) {
    names += " and " + std::to_string(lacking - kNamesInSentence) + " cameras more";
  }
  files.notes.push_back(dataset + ": of " + std::to_string(all.size()) +
                        " frames some cameras have not all: " + names +
                        "; the others are at their own times");
}

void keep(const std::vector<size_t>& chosen, std::vector<DatasetView>& views) {
  std::vector<DatasetView> kept;
  for (const size_t i : chosen) kept.push_back(std::move(views[i]));
  views = std::move(kept);
}

bool takesAllFrames(const SeriesOptions& options) {
  return options.first_frame == 0 && options.frame_step == 1 &&
         options.last_frame == SeriesOptions().last_frame;
}

/// The least difference of two times; 0 where all views have one.
double secondsBetween(const std::vector<DatasetView>& views) {
  std::set<double> times;
  for (const DatasetView& view : views) times.insert(view.view.time);
  double least = 0;
  for (auto at = times.begin(); at != times.end() && std::next(at) != times.end(); ++at) {
    const double step = *std::next(at) - *at;
    least = least == 0 ? step : std::min(least, step);
  }
  return least;
}

void chooseFrames(const std::string& dataset, const SeriesOptions& options,
                  std::vector<DatasetView>& views) {
  if (takesAllFrames(options)) return;
  const std::vector<uint64_t> numbers = frameNumbers(views);
  const auto [least, most] = std::minmax_element(numbers.begin(), numbers.end());
  const uint64_t first = std::max(options.first_frame, *least);
  std::vector<size_t> chosen;
  for (size_t i = 0; i < views.size(); ++i) {
    const bool is_inside = numbers[i] >= first && numbers[i] <= options.last_frame;
    if (is_inside && (numbers[i] - first) % options.frame_step == 0) chosen.push_back(i);
  }
  if (chosen.empty()) {
    fail(ErrorCode::kInvalidArgument, dataset + ": frames " + std::to_string(options.first_frame) +
                                          " to " + std::to_string(options.last_frame) +
                                          " are asked for; there are frames " +
                                          std::to_string(*least) + " to " + std::to_string(*most));
  }
  keep(chosen, views);
}

void chooseImages(uint64_t most, std::vector<DatasetView>& views) {
  if (most == 0 || views.size() <= most) return;
  const std::vector<uint64_t> numbers = frameNumbers(views);
  std::map<std::string, size_t> cameras;
  std::vector<SeriesPlace> places;
  for (size_t i = 0; i < views.size(); ++i) {
    const std::string& name = views[i].camera_name;
    // Views without a camera's name are each of a camera of its own, told apart by their pictures.
    const std::string key = name.empty() ? "/" + views[i].image_path : name;
    places.push_back({numbers[i], cameras.emplace(key, cameras.size()).first->second});
  }
  keep(evenChoice(places, most), views);
}

std::string withoutSpacesAround(const std::string& name) {
  const size_t first = name.find_first_not_of(' ');
  if (first == std::string::npos) return {};
  return name.substr(first, name.find_last_not_of(' ') + 1 - first);
}

void holdOut(const std::string& dataset, const std::string& names,
             std::vector<DatasetView>& views) {
  if (names.empty()) return;
  std::set<std::string> known, wanted;
  for (const DatasetView& view : views) {
    if (!view.camera_name.empty()) known.insert(view.camera_name);
  }
  for (size_t begin = 0; begin <= names.size();) {
    const size_t end = std::min(names.find(',', begin), names.size());
    wanted.insert(withoutSpacesAround(names.substr(begin, end - begin)));
    begin = end + 1;
  }
  for (const std::string& name : wanted) {
    if (known.count(name) != 0) continue;
    fail(ErrorCode::kInvalidArgument,
         dataset + ": '" + name.substr(0, 80) + "' is to be held out; " +
             (known.empty() ? "no camera of several images is there"
                            : "cameras are called " + *known.begin() + " to " + *known.rbegin()));
  }
  if (wanted.size() == known.size()) {
    fail(ErrorCode::kInvalidArgument,
         dataset + ": all " + std::to_string(known.size()) +
             " cameras are to be held out; at least one must be left to learn from");
  }
  for (DatasetView& view : views) {
    const bool is_held_out = wanted.count(view.camera_name) != 0;
    view.view.role = is_held_out ? ViewRole::kTest : ViewRole::kTrain;
  }
}

}  // namespace

SeriesSize arrangeSeries(const std::string& dataset, const SeriesOptions& options,
                         DatasetFiles& files) {
  requireOptions(options);
  SeriesSize size;
  size.image_count = files.views.size();
  timeFrames(dataset, options.frame_rate, files.views);
  nameCameras(files.views);
  noteMissingFrames(dataset, files);
  if (!takesAllFrames(options)) size.frame_seconds = secondsBetween(files.views);
  chooseFrames(dataset, options, files.views);
  chooseImages(options.max_images, files.views);
  holdOut(dataset, options.held_out_cameras, files.views);
  std::set<double> times;
  std::set<std::string> cameras;
  for (const DatasetView& view : files.views) {
    times.insert(view.view.time);
    if (!view.camera_name.empty()) cameras.insert(view.camera_name);
  }
  size.frame_count = times.size();
  size.camera_count = cameras.size();
  size.time_begin = times.empty() ? 0 : *times.begin();
  size.time_end = times.empty() ? 0 : *times.rbegin();
  return size;
}

void choosePoints(const SeriesSize& size, PointSet& points) {
  if (size.frame_seconds == 0 || points.times.empty()) return;
  const double begin = size.time_begin - size.frame_seconds / 2;
  const double end = size.time_end + size.frame_seconds / 2;
  const auto distance = [&](double time) {
    return std::max({0.0, begin - time, time - end});  // 0 for NaN, too
  };
  double nearest = HUGE_VAL;
  for (const double time : points.times) {
    if (!std::isnan(time)) nearest = std::min(nearest, distance(time));
  }
  std::vector<size_t> kept;
  for (size_t i = 0; i < points.size(); ++i) {
    const double time = points.times[i];
    if (std::isnan(time) || distance(time) <= nearest) kept.push_back(i);
  }
  const size_t count = points.size();
  const auto choose = [&](auto& values) {
    const size_t row = values.size() / count;
    for (size_t i = 0; i < kept.size() && row > 0; ++i) {
      std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(kept[i] * row), row,
                  values.begin() + static_cast<std::ptrdiff_t>(i * row));
    }
    values.resize(kept.size() * row);
  };
  for (std::vector<float>* values : {&points.positions, &points.normals, &points.colours,
                                     &points.areas, &points.weights, &points.harmonics}) {
    choose(*values);
  }
  choose(points.times);
  choose(points.opacities);  // last, as it tells how many there are
}

}  // namespace stipple
