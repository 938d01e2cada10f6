#include "data/views/view_check.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include "base/error.h"
#include "base/number_text.h"
#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kValuesPerTask = size_t{1} << 18;
// Names that one sentence lists; ten thousand would hide what it says.
constexpr size_t kNamesInSentence = 3;

enum class ValueRange { kAny, kShare, kPositive };

bool isGood(float value, ValueRange range) {
  // An exponent of all ones is an infinity or NaN.
  const bool finite = (std::bit_cast<uint32_t>(value) & 0x7f800000u) != 0x7f800000u;
  if (range == ValueRange::kAny) return finite;
  return finite && value >= 0.0f && (range == ValueRange::kPositive || value <= 1.0f);
}

/// Index of the first value outside the range, or the count.
size_t firstBad(const std::vector<float>& values, ValueRange range) {
  std::vector<size_t> first(rangeCount(values.size(), kValuesPerTask), values.size());
  parallelFor(values.size(), kValuesPerTask, [&](size_t begin, size_t end) {
    bool good = true;
    for (size_t i = begin; i < end; ++i) good = good & isGood(values[i], range);
    if (good) return;
    while (isGood(values[begin], range)) ++begin;
    first[begin / kValuesPerTask] = begin;
  });
  return first.empty() ? values.size() : *std::min_element(first.begin(), first.end());
}

void checkArray(const ViewPicture& picture, const std::string& name, const char* array,
                const std::vector<float>& values, size_t channels, bool may_be_empty,
                ValueRange range) {
  if (may_be_empty && values.empty()) return;
  const size_t needed = size_t{picture.width} * picture.height * channels;
  if (values.size() != needed) {
    fail(ErrorCode::kInvalidArgument, name + ": " + array + " holds " +
                                          std::to_string(values.size()) + " values; " +
                                          std::to_string(needed) + " are needed");
  }
  const size_t bad = firstBad(values, range);
  if (bad == values.size()) return;
  const size_t pixel = bad / channels;
  fail(ErrorCode::kInvalidArgument,
       name + ": pixel (" + std::to_string(pixel % picture.width) + ", " +
           std::to_string(pixel / picture.width) + ") has " + array + " " +
           std::to_string(values[bad]) + "; " +
           (range == ValueRange::kShare      ? "a number from 0 to 1 is needed"
            : range == ValueRange::kPositive ? "a finite number of at least 0 is needed"
                                             : "a finite number is needed"));
}

enum class Content { kSomething, kBlack, kTransparent, kMasked };

/// What a picture has to show where it counts.
Content contentOf(const ViewPicture& picture) {
  const size_t pixels = size_t{picture.width} * picture.height;
  bool counts = false, covers = false;
  for (size_t i = 0; i < pixels; ++i) {
    if (!picture.weights.empty() && !(picture.weights[i] > 0)) continue;
    counts = true;
    if (!picture.alpha.empty() && !(picture.alpha[i] > 0)) continue;
    covers = true;
    const float* colour = &picture.colour[i * 3];
    if (colour[0] > 0 || colour[1] > 0 || colour[2] > 0) return Content::kSomething;
  }
  return !counts ? Content::kMasked : !covers ? Content::kTransparent : Content::kBlack;
}

bool seesAny(const Camera& camera, const PointSet& points) {
  const size_t count = points.positions.size() / 3;
  // Many more points than needed are in front of any useful camera.
  for (size_t i = 0; i < count; ++i) {
    const Vec4d world(points.positions[i * 3], points.positions[i * 3 + 1],
                      points.positions[i * 3 + 2], 1.0);
    const Vec4d seen = camera.world_to_camera * world;
    if (!(seen.z() > camera.near_plane) || !(seen.z() < camera.far_plane)) continue;
    const double z = camera.model == CameraModel::kPerspective ? seen.z() : 1.0;
    const double x = camera.fx * seen.x() / z + camera.cx;
    const double y = camera.fy * seen.y() / z + camera.cy;
    if (x >= 0 && y >= 0 && x < camera.width && y < camera.height) return true;
  }
  return false;
}

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (size_t i = 0; i < std::min(names.size(), kNamesInSentence); ++i) {
    text += (i == 0 ? "" : ", ") + names[i];
  }
  if (names.size() > kNamesInSentence) {
    text += " and " + std::to_string(names.size() - kNamesInSentence) + " more";
  }
  return text;
}

void checkPictures(const ViewSource& views, const ViewCheckOptions& options, Progress* progress,
                   std::vector<std::string>& warnings) {
  const size_t looked_at = std::min(std::max<size_t>(options.picture_count, 1), views.count());
  std::vector<std::string> black, transparent, masked;
  for (size_t i = 0; i < looked_at; ++i) {
    advance(progress, static_cast<double>(i) / static_cast<double>(looked_at), "Checking views");
    const size_t view = i * views.count() / looked_at;
    const Content content = contentOf(views.load(view));
    if (content == Content::kBlack) black.push_back(views.name(view));
    if (content == Content::kTransparent) transparent.push_back(views.name(view));
    if (content == Content::kMasked) masked.push_back(views.name(view));
  }
  if (black.size() + transparent.size() + masked.size() == looked_at) {
    const char* how = black.size() == looked_at         ? "black"
                      : transparent.size() == looked_at ? "transparent"
                      : masked.size() == looked_at      ? "masked out"
                                                        : "black, transparent or masked out";
    fail(ErrorCode::kInvalidArgument,
         "all " + std::to_string(looked_at) + " images that were looked at are " + how +
             " everywhere (" + views.name(0) + " is the first); at least one must show something");
  }
  const auto warn = [&warnings](const std::vector<std::string>& names, const char* how) {
    if (names.empty()) return;
    warnings.push_back(std::to_string(names.size()) +
                       (names.size() == 1 ? " image is " : " images are ") + how +
                       " everywhere: " + listed(names));
  };
  warn(black, "black");
  warn(transparent, "transparent");
  warn(masked, "masked out");
}

void checkCameras(const ViewSource& views, std::vector<std::string>& warnings) {
  if (views.count() == 1) {
    warnings.push_back("there is one view (" + views.name(0) +
                       "): what is behind what cannot be learned from it, and none is left to "
                       "judge the result by");
  }
  if (views.points().size() == 0) return;
  std::vector<std::string> blind;
  for (size_t view = 0; view < views.count(); ++view) {
    if (!seesAny(views.camera(view), views.points())) blind.push_back(views.name(view));
  }
  if (blind.size() == views.count()) {
    fail(ErrorCode::kInvalidArgument,
         "none of the " + std::to_string(views.count()) + " cameras sees any of the " +
             std::to_string(views.points().size()) +
             " points of the scene; cameras and points must be in one frame");
  }
  if (blind.empty()) return;
  warnings.push_back(std::to_string(blind.size()) +
                     (blind.size() == 1 ? " camera sees" : " cameras see") +
                     " none of the scene's points: " + listed(blind));
}

}  // namespace

void validateView(const Camera& camera, const ViewPicture& picture, const std::string& name) {
  try {
    validate(camera);
    requireImagePlane(camera, "fitting");
  } catch (const Error& error) {
    fail(error.code(), name + ": " + error.what());
  }
  if (picture.width != camera.width || picture.height != camera.height) {
    fail(ErrorCode::kInvalidArgument,
         name + ": the image is " + sizeText(picture.width, picture.height) +
             " pixels, its camera's is " + sizeText(camera.width, camera.height) + " pixels");
  }
  checkArray(picture, name, "colour", picture.colour, 3, false, ValueRange::kAny);
  checkArray(picture, name, "alpha", picture.alpha, 1, true, ValueRange::kShare);
  checkArray(picture, name, "weight", picture.weights, 1, true, ValueRange::kPositive);
  checkArray(picture, name, "depth", picture.depth, 1, true, ValueRange::kPositive);
  checkArray(picture, name, "normal", picture.normals, 3, true, ValueRange::kAny);
}

void validatePoints(const PointSet& points, const char* what) {
  const size_t count = points.size();
  struct Array {
    const char* name;
    const std::vector<float>& values;
    size_t channels;
    bool may_be_empty;
  };
  for (const Array& array :
       {Array{"positions", points.positions, 3, false}, Array{"colours", points.colours, 3, false},
        Array{"opacities", points.opacities, 1, false}, Array{"normals", points.normals, 3, true},
        Array{"areas", points.areas, 1, true}, Array{"weights", points.weights, 1, true}}) {
    if (array.may_be_empty && array.values.empty()) continue;
    if (array.values.size() != count * array.channels) {
      fail(ErrorCode::kInvalidArgument, std::string(what) + ": " + array.name + " holds " +
                                            std::to_string(array.values.size()) + " values; " +
                                            std::to_string(count * array.channels) +
                                            " are needed for " + std::to_string(count) + " points");
    }
    const std::string name = std::string(what) + ": " + array.name + " of point";
    requireFinite(array.values.data(), array.values.size(), array.channels, name.c_str());
  }
  if (!points.times.empty() && points.times.size() != count) {
    fail(ErrorCode::kInvalidArgument, std::string(what) + ": times holds " +
                                          std::to_string(points.times.size()) + " values; " +
                                          std::to_string(count) + " are needed");
  }
  for (size_t i = 0; i < points.times.size(); ++i) {
    if (std::isnan(points.times[i])) continue;  // at all times
    requireFinite(points.times[i],
                  (std::string(what) + ": time of point " + std::to_string(i)).c_str());
  }
}

std::vector<std::string> checkViews(const ViewSource& views, const ViewCheckOptions& options,
                                    Progress* progress) {
  if (views.count() == 0) {
    fail(ErrorCode::kInvalidArgument, "there are no views; at least one is needed");
  }
  for (size_t view = 0; view < views.count(); ++view) {
    requireFinite(views.time(view), (views.name(view) + ": time").c_str());
  }
  std::vector<std::string> warnings;
  checkCameras(views, warnings);
  checkPictures(views, options, progress, warnings);
  return warnings;
}

}  // namespace stipple
