#include "fit/scene_rig.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <string>

#include "base/error.h"
#include "math/camera_rig.h"
#include "math/low_discrepancy.h"

namespace stipple {

namespace {

/// In radii: air between the things and the edge of an image.
constexpr double kAir = 1.05;
/// In radii: between a camera in a room and what is nearest to it.
constexpr double kClearance = 0.05;
/// No walls of a room are smaller than this share of everything.
constexpr double kWallShare = 0.9;
/// A camera stands at this share of the way to what is between it and the things.
constexpr double kShareOfGap = 0.9;
/// Rays outwards begin outside of the ball: what touches it is not between.
constexpr double kOutside = 1.001;
constexpr uint64_t kTriesPerView = 64;
/// Places of different seeds have no number of the sequence in common in the first so many.
constexpr uint64_t kPlacesPerSeed = 7919;
/// Places inside lie within this part of the bounds.
constexpr double kFirstShare = 0.1;
constexpr double kInnerShare = 0.8;
constexpr double kSmallestRadius = 1e-6;
constexpr double kNoLimit = std::numeric_limits<double>::infinity();

/// The axes and the diagonals. A place counts as inside a mesh where more than half of them meet
/// the back of a face first.
constexpr size_t kProbeCount = 14;
constexpr int kProbes[kProbeCount][3] = {
    {1, 0, 0},  {-1, 0, 0}, {0, 1, 0},   {0, -1, 0}, {0, 0, 1},   {0, 0, -1},  {1, 1, 1},
    {1, 1, -1}, {1, -1, 1}, {1, -1, -1}, {-1, 1, 1}, {-1, 1, -1}, {-1, -1, 1}, {-1, -1, -1}};

Vec3d probe(size_t index) {
  const int* p = kProbes[index];
  return Vec3d(p[0], p[1], p[2]).normalized();
}

bool isHit(const SceneHits& hits, size_t ray) {
  return std::isfinite(hits.distances[ray]);
}

/// Rays of askAround() that meet anything. In: first, of them.
size_t hitCount(const SceneHits& hits, size_t first) {
  size_t count = 0;
  for (size_t i = 0; i < kProbeCount; ++i) count += isHit(hits, first + i) ? 1 : 0;
  return count;
}

/// The objects that a place is inside of.
std::set<uint32_t> enclosing(const SceneHits& hits, size_t first) {
  std::map<uint32_t, size_t> backs;
  for (size_t i = 0; i < kProbeCount; ++i) {
    const size_t ray = first + i;
    if (!isHit(hits, ray)) continue;
    const double* normal = &hits.normals[3 * ray];
    const bool is_back = Vec3d(normal[0], normal[1], normal[2]).dot(probe(i)) > 0;
    if (is_back) ++backs[hits.objects[ray]];
  }
  std::set<uint32_t> objects;
  for (const auto& [object, count] : backs) {
    if (2 * count > kProbeCount) objects.insert(object);
  }
  return objects;
}

void validate(const SceneRigOptions& options) {
  if (options.count < 1 || options.count > 4096 || options.size < 1 || options.size > 65536) {
    fail(ErrorCode::kInvalidArgument,
         "the view rig has " + std::to_string(options.count) + " views of " +
             std::to_string(options.size) +
             " pixels; 1 to 4096 views of 1 to 65536 pixels are allowed");
  }
  if (!(options.angle >= 0 && options.angle < std::numbers::pi)) {
    fail(ErrorCode::kInvalidArgument,
         "angle is " + std::to_string(options.angle) + "; 0 to below pi radians is allowed");
  }
  for (int axis = 0; axis < 3; ++axis) {
    requireFinite(options.lowest[axis], "bounds_min");
    requireFinite(options.highest[axis], "bounds_max");
    if (options.viewer) requireFinite((*options.viewer)[axis], "viewer");
    if (options.lowest[axis] <= options.highest[axis]) continue;
    fail(ErrorCode::kInvalidArgument,
         "bounds_min is " + std::to_string(options.lowest[axis]) + " along axis " +
             std::to_string(axis) + ", above bounds_max, " + std::to_string(options.highest[axis]));
  }
}

}  // namespace

SceneRig::SceneRig(const SceneRigOptions& options) : options_(options) {
  validate(options_);
  centre_ = (options_.lowest + options_.highest) / 2;
  radius_ = std::max((options_.highest - options_.lowest).norm() / 2, kSmallestRadius);
  if (options_.rig != ViewRig::kAutomatic) {
    begin(options_.rig);
    return;
  }
  const auto& viewer = options_.viewer;
  const bool is_within = viewer && (viewer->array() >= options_.lowest.array()).all() &&
                         (viewer->array() <= options_.highest.array()).all();
  if (!is_within) {
    begin(ViewRig::kAround);
    return;
  }
  step_ = Step::kChoose;
  askAround(*viewer);
}

void SceneRig::answer(const SceneHits& hits) {
  const size_t count = rays_.size();
  if (hits.distances.size() != count || hits.normals.size() != 3 * count ||
      hits.objects.size() != count) {
    fail(ErrorCode::kInvalidArgument, "there are " + std::to_string(hits.distances.size()) +
                                          " answers; " + std::to_string(count) +
                                          " rays were asked");
  }
  for (size_t i = 0; i < count; ++i) {
    if (!isHit(hits, i) || 3 * size_t{hits.objects[i]} + 2 < hits.object_sizes.size()) continue;
    fail(ErrorCode::kInvalidArgument, "object " + std::to_string(hits.objects[i]) +
                                          " has no size; there are " +
                                          std::to_string(hits.object_sizes.size() / 3));
  }
  switch (step_) {
    case Step::kChoose:
      begin(2 * hitCount(hits, 0) > kProbeCount ? ViewRig::kInside : ViewRig::kAround);
      return;
    case Step::kOutward:
      tellOutward(hits);
      return;
    case Step::kEnclosed:
      tellEnclosed(hits);
      return;
    case Step::kInside:
      tellInside(hits);
      return;
    case Step::kDone:
      return;
  }
}

void SceneRig::begin(ViewRig rig) {
  attempt_ = 0;
  if (rig == ViewRig::kInside) {
    askInside();
  } else {
    askOutward();
  }
}

void SceneRig::ask(const Vec3d& origin, const Vec3d& direction, double farthest) {
  rays_.push_back(
      {{origin[0], origin[1], origin[2]}, {direction[0], direction[1], direction[2]}, farthest});
}

void SceneRig::askAround(const Vec3d& place) {
  for (size_t i = 0; i < kProbeCount; ++i) ask(place, probe(i), kNoLimit);
}

Vec3d SceneRig::directionOf(uint32_t index, uint64_t seed) const {
  const double angle = 2 * std::numbers::pi * radicalInverse(seed, 2);
  const double c = std::cos(angle), s = std::sin(angle);
  const Vec3d d = fibonacciDirection(index, options_.count);
  return {c * d[0] - s * d[1], s * d[0] + c * d[1], d[2]};
}

void SceneRig::askOutward() {
  if (attempt_ == kTriesPerView) {
    fail(ErrorCode::kInvalidArgument,
         "only " + std::to_string(cameras_.size()) + " of " + std::to_string(options_.count) +
             " cameras around the scene find a place outside of every mesh");
  }
  step_ = Step::kOutward;
  rays_.clear();
  places_.clear();
  directions_.clear();
  const double angle = options_.angle > 0 ? options_.angle : kAngleAround;
  const double edge = kOutside * radius_;
  const double distance = kAir * radius_ / std::sin(0.5 * angle);
  for (uint32_t i = 0; i < options_.count; ++i) {
    const Vec3d direction = directionOf(i, options_.seed + attempt_);
    directions_.push_back(direction);
    places_.push_back(centre_ + distance * direction);
    ask(centre_ + edge * direction, direction, distance - edge);
  }
  ++attempt_;
}

void SceneRig::tellOutward(const SceneHits& hits) {
  const double edge = kOutside * radius_;
  std::vector<Vec3d> places, directions;
  for (size_t i = 0; i < places_.size(); ++i) {
    Vec3d place = places_[i];
    if (isHit(hits, i)) {
      const double distance = kShareOfGap * (edge + hits.distances[i]);
      if (distance <= kAir * edge) continue;  // something is too near
      place = centre_ + distance * directions_[i];
    }
    places.push_back(place);
    directions.push_back(directions_[i]);
  }
  if (places.empty()) {
    askOutward();
    return;
  }
  places_ = std::move(places);
  directions_ = std::move(directions);
  step_ = Step::kEnclosed;
  rays_.clear();
  for (size_t i = 0; i < places_.size(); ++i) {
    askAround(places_[i]);
    askAround(centre_ + radius_ * directions_[i]);
  }
}

void SceneRig::tellEnclosed(const SceneHits& hits) {
  const double angle = options_.angle > 0 ? options_.angle : kAngleAround;
  for (size_t i = 0; i < places_.size() && cameras_.size() < options_.count; ++i) {
    const std::set<uint32_t> camera = enclosing(hits, 2 * i * kProbeCount);
    const std::set<uint32_t> things = enclosing(hits, (2 * i + 1) * kProbeCount);
    // A room holds the things and the camera alike.
    const bool is_outside =
        std::includes(things.begin(), things.end(), camera.begin(), camera.end());
    if (is_outside) add(places_[i], -directions_[i], angle);
  }
  if (cameras_.size() < options_.count) {
    askOutward();
    return;
  }
  step_ = Step::kDone;
  rays_.clear();
}

void SceneRig::askInside() {
  const uint64_t last = options_.count * kTriesPerView;
  if (attempt_ >= last) {
    fail(ErrorCode::kInvalidArgument,
         "only " + std::to_string(cameras_.size()) + " of " + std::to_string(options_.count) +
             " cameras find a free place between walls; cameras around the scene, or its own, may "
             "suit it better");
  }
  step_ = Step::kInside;
  rays_.clear();
  places_.clear();
  const Vec3d size = options_.highest - options_.lowest;
  const uint64_t end = std::min<uint64_t>(attempt_ + options_.count, last);
  constexpr uint32_t kBases[3] = {2, 3, 5};
  for (; attempt_ < end; ++attempt_) {
    Vec3d place = options_.lowest;
    for (int axis = 0; axis < 3; ++axis) {
      const uint64_t index = attempt_ + 1 + kPlacesPerSeed * options_.seed;
      place[axis] += (kFirstShare + kInnerShare * radicalInverse(index, kBases[axis])) * size[axis];
    }
    places_.push_back(place);
    askAround(place);
  }
}

bool SceneRig::isFree(const SceneHits& hits, size_t first) const {
  for (size_t i = first; i < first + kProbeCount; ++i) {
    if (hits.distances[i] < kClearance * radius_) return false;
  }
  if (2 * hitCount(hits, first) <= kProbeCount) return false;
  const std::set<uint32_t> objects = enclosing(hits, first);
  const auto is_walls = [&](uint32_t object) {
    double share = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const double whole = std::max(options_.highest[axis] - options_.lowest[axis], 1e-9);
      const size_t side = 3 * size_t{object} + static_cast<size_t>(axis);
      share = std::max(share, hits.object_sizes[side] / whole);
    }
    return share > kWallShare;
  };
  return std::all_of(objects.begin(), objects.end(), is_walls);
}

void SceneRig::tellInside(const SceneHits& hits) {
  const double angle = options_.angle > 0 ? options_.angle : kAngleInside;
  for (size_t i = 0; i < places_.size() && cameras_.size() < options_.count; ++i) {
    if (!isFree(hits, i * kProbeCount)) continue;
    const auto index = static_cast<uint32_t>(cameras_.size());
    add(places_[i], directionOf(index, options_.seed), angle);
  }
  if (cameras_.size() < options_.count) {
    askInside();
    return;
  }
  step_ = Step::kDone;
  rays_.clear();
}

void SceneRig::add(const Vec3d& place, const Vec3d& forward, double angle) {
  Camera camera = cameraAlong(place, forward, Vec3d(0, 0, 1), angle, options_.size);
  camera.near_plane = 1e-3 * radius_;
  camera.far_plane = 2 * ((place - centre_).norm() + radius_);
  cameras_.push_back(camera);
}

}  // namespace stipple
