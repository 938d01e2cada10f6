// Based on: Jung, Kim et al., Mesh Density Adaptation for Template-based Shape Reconstruction,
// SIGGRAPH 2023, the registration of its released code. Differs: see
// docs/methods/mesh_adaptation.md.
#include "fit/registration/registration.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/random.h"
#include "fit/registration/even_sliding.h"
#include "fit/registration/landing.h"
#include "fit/registration/moving_template.h"
#include "fit/registration/registration_report.h"
#include "fit/registration/sliding_surface.h"
#include "mesh/adapt/point_rows.h"
#include "mesh/adapt/unfold.h"

namespace stipple {

namespace {

constexpr uint64_t kMostPoints = uint64_t{1} << 24;
constexpr uint32_t kMostSamplesPerPoint = 64;
/// Of the largest it could be: below it nobody knows inside from outside.
constexpr double kClearlyOutwards = 0.1;
constexpr double kHeldWeight = 0.99;

[[noreturn]] void refuse(const std::string& message) {
  fail(ErrorCode::kInvalidArgument, message);
}

void requireWeight(double value, const char* name) {
  if (std::isfinite(value) && value >= 0 && value <= 1e6) return;
  refuse(std::string(name) + " weight is " + std::to_string(value) + "; 0 to 1000000 is allowed");
}

void requireCount(uint64_t value, uint64_t first, uint64_t last, const char* name) {
  if (value >= first && value <= last) return;
  refuse(std::string(name) + " is " + std::to_string(value) + "; " + std::to_string(first) +
         " to " + std::to_string(last) + " is allowed");
}

double weightOf(const RegistrationTarget& target, size_t i) {
  return target.weights.empty() ? 1.0 : static_cast<double>(target.weights[i]);
}

void requireTarget(const RegistrationTarget& target) {
  if (target.size() == 0) refuse("the target has 0 points; at least one is needed");
  double sum = 0;
  for (const float weight : target.weights) sum += static_cast<double>(weight);
  if (!target.weights.empty() && !(sum > 0)) {
    refuse("the weights of the target's points sum up to 0; more is needed");
  }
}

/// The radius that holds all points, or of weighted ones, among which splats may fly far off,
/// nearly all of the weight.
double radiusOf(const RegistrationTarget& target, const Vec3d& middle) {
  std::vector<std::pair<double, double>> reached;
  double sum = 0;
  for (size_t i = 0; i < target.size(); ++i) {
    reached.emplace_back((rowOf(target.points, i) - middle).norm(), weightOf(target, i));
    sum += reached.back().second;
  }
  std::sort(reached.begin(), reached.end());
  if (target.weights.empty()) return reached.back().first;
  double held = 0;
  for (const auto& [radius, weight] : reached) {
    held += weight;
    if (held >= kHeldWeight * sum) return radius;
  }
  return reached.back().first;
}

UnitBall ballOf(const RegistrationTarget& target) {
  UnitBall ball;
  double sum = 0;
  for (size_t i = 0; i < target.size(); ++i) {
    ball.middle += weightOf(target, i) * rowOf(target.points, i);
    sum += weightOf(target, i);
  }
  ball.middle /= sum;
  ball.radius = radiusOf(target, ball.middle);
  // Nearer together than floats tell apart, all points are one.
  const double finest = 1e-6 * ball.middle.cwiseAbs().maxCoeff();
  if (!(ball.radius > finest)) {
    refuse("the target has no extent: its " + std::to_string(target.size()) +
           " points lie in one place");
  }
  return ball;
}

RegistrationTarget inBall(const RegistrationTarget& target, const UnitBall& ball) {
  RegistrationTarget made;
  made.normals = target.normals;
  made.weights = target.weights;
  made.is_oriented = target.is_oriented;
  made.points.resize(target.points.size());
  for (size_t i = 0; i < target.size(); ++i) {
    setRow(made.points, i, ball.into(rowOf(target.points, i)));
  }
  return made;
}

/// Landmarks in the ball, at places of the merged mesh.
std::vector<Landmark> landmarksIn(const std::vector<Landmark>& given, const UnitBall& ball,
                                  const MergedVertices& merged) {
  std::vector<Landmark> made;
  for (size_t i = 0; i < given.size(); ++i) {
    const std::string name = "landmark " + std::to_string(i) + " is vertex " +
                             std::to_string(given[i].vertex) + " of the template, which ";
    if (given[i].vertex >= merged.place_of.size()) {
      refuse(name + "has " + std::to_string(merged.place_of.size()) + " vertices");
    }
    if (merged.place_of[given[i].vertex] == kLooseVertex) refuse(name + "no triangle uses");
    if (!given[i].place.allFinite()) {
      refuse("the place of landmark " + std::to_string(i) + " is not finite");
    }
    made.push_back({merged.place_of[given[i].vertex], ball.into(given[i].place)});
  }
  return made;
}

/// How much weighted directions look away from the middle of their places, -1 to 1.
class Outwards {
 public:
  explicit Outwards(Vec3d middle) : middle_(std::move(middle)) {}
  void add(const Vec3d& place, const Vec3d& direction, double weight) {
    sum_ += weight * direction.dot(place - middle_);
    most_ += weight * direction.norm() * (place - middle_).norm();
  }
  double share() const { return most_ > 0 ? sum_ / most_ : 0.0; }

 private:
  Vec3d middle_;
  double sum_ = 0, most_ = 0;
};

double outwardsOfTarget(const RegistrationTarget& target) {
  Outwards outwards(Vec3d::Zero());  // The middle of the unit ball.
  for (size_t i = 0; i < target.size() && !target.normals.empty(); ++i) {
    outwards.add(rowOf(target.points, i), rowOf(target.normals, i), weightOf(target, i));
  }
  return outwards.share();
}

double outwardsOfMesh(const MergedVertices& mesh) {
  Vec3d middle = Vec3d::Zero();
  for (const Vec3d& p : mesh.positions) middle += p;
  middle /= static_cast<double>(mesh.positions.size());
  Outwards outwards(middle);
  for (size_t t = 0; t < mesh.triangles.size() / 3; ++t) {
    const uint32_t* corner = &mesh.triangles[t * 3];
    const Vec3d place =
        (mesh.positions[corner[0]] + mesh.positions[corner[1]] + mesh.positions[corner[2]]) / 3;
    outwards.add(place, areaVector(mesh.triangles, mesh.positions, static_cast<uint32_t>(t)), 1);
  }
  return outwards.share();
}

/// Takes the target's normals the other way round where one looks outwards and the other inwards.
bool turnNormals(RegistrationTarget& target, const MergedVertices& mesh) {
  if (!target.is_oriented || target.normals.empty()) return false;
  const double of_target = outwardsOfTarget(target);
  const double of_mesh = outwardsOfMesh(mesh);
  const bool turn = of_target * of_mesh < 0 && std::abs(of_target) > kClearlyOutwards &&
                    std::abs(of_mesh) > kClearlyOutwards;
  for (float& value : target.normals) value = turn ? -value : value;
  return turn;
}

uint64_t seedOfStep(uint64_t seed, uint32_t step) {
  return mixBits(seed) + step;
}

bool isItself(const TriMesh& given, const RegistrationTarget& target) {
  return given.positions == target.positions && given.triangles == target.triangles;
}

RegisteredMesh slideOnItself(const TriMesh& given, const RegistrationTarget& target,
                             const UnitBall& ball, const RegistrationOptions& options,
                             Progress* progress, RegistrationWatch* watch) {
  if (!options.landmarks.empty()) {
    refuse("there are " + std::to_string(options.landmarks.size()) +
           " landmarks, but a mesh that slides on itself stays where it is");
  }
  const MovingTemplate moving(given, ball);
  RegisteredMesh made;
  moving.report(made.report);
  const SlidingSurface surface(moving.links(), moving.merged().positions, options.sharp_angle);
  const EvenSliding slid = slideEvenly(
      moving.links(), moving.merged().positions, surface, options.adapter,
      [&](uint32_t step, std::span<const Vec3d> places) {
        advance(progress, std::min(1.0, static_cast<double>(step) / options.adapter.steps),
                kAdaptingStage);
        if (!watch) return true;
        if (watch->wantsShape()) watch->show(std::make_shared<TriMesh>(moving.mesh(places)));
        return !watch->wantsEnd();
      });
  made.report.step_count = slid.step_count;
  made.mesh = moving.mesh(slid.places);
  measureRegistration(given, target, options, made, progress);
  return made;
}

/// Places in the ball, each brought to the nearest of the target's.
std::vector<Vec3d> landed(const RegistrationTarget& target, const MeshLinks& links,
                          std::span<const Vec3d> given, const UnitBall& ball) {
  std::vector<Vec3d> places(given.begin(), given.end());
  for (Vec3d& p : places) p = ball.outOf(p);
  landOnSurface(target.positions, target.triangles, links, places);
  for (Vec3d& p : places) p = ball.into(p);
  return places;
}

}  // namespace

void validate(const RegistrationOptions& options) {
  validate(options.adapter);
  requireWeight(options.weights.position, "position");
  requireWeight(options.weights.normal, "normal");
  requireWeight(options.weights.landmark, "landmark");
  requireWeight(options.weights.symmetric, "symmetric");
  requireCount(options.target_count, 1, kMostPoints, "number of points of the target");
  requireCount(options.samples_per_point, 1, kMostSamplesPerPoint, "number of samples per point");
  requireCount(options.report_count, 0, kMostPoints, "number of samples of the report");
  if (!(options.sharp_angle >= 0 && options.sharp_angle <= std::numbers::pi)) {
    refuse("sharp angle is " + std::to_string(options.sharp_angle) +
           " radians; 0 to 3.141593 is allowed");
  }
}

RegisteredMesh registerMesh(const TriMesh& given, const RegistrationTarget& target,
                            const RegistrationOptions& options, Progress* progress,
                            RegistrationWatch* watch) {
  validate(options);
  validate(given);
  requireTarget(target);
  if (options.lands_on_target && target.triangles.empty()) {
    refuse("the target has no triangles that vertices could land on; only a mesh has some");
  }
  advance(progress, 0.0, kAdaptingStage);
  const UnitBall ball = ballOf(target);
  if (options.lands_on_target && isItself(given, target)) {
    return slideOnItself(given, target, ball, options, progress, watch);
  }
  MovingTemplate moving(given, ball);
  const std::vector<Landmark> landmarks = landmarksIn(options.landmarks, ball, moving.merged());
  RegistrationTarget aim = inBall(target, ball);
  moving.align(preAligned(moving.merged().triangles, moving.merged().positions, aim, landmarks,
                          options.alignment));

  RegisteredMesh made;
  RegistrationReport& report = made.report;
  report.turned_normals = turnNormals(aim, moving.merged());
  moving.report(report);
  const RegistrationLoss loss(std::move(aim), landmarks, options.weights,
                              options.samples_per_point);
  MeshAdapter adapter(moving.links(), moving.merged().positions, options.adapter);
  report.loss = takeSteps(
      moving, adapter, options.adapter.steps,
      [&](uint32_t step, std::span<Vec3d> gradient) {
        const RegistrationMatches matches = loss.match(
            moving.links().triangles(), adapter.positions(), seedOfStep(options.seed, step));
        if (matches.of_points.empty()) {
          refuse("the template has lost its area at step " + std::to_string(step) +
                 "; a smaller step size or strength is needed");
        }
        return loss.addGradient(moving.links().triangles(), adapter.positions(), matches, gradient);
      },
      progress, watch);
  report.step_count = adapter.stepCount();
  std::vector<Vec3d> places(adapter.positions().begin(), adapter.positions().end());
  unfold(moving.links(), places);
  if (options.lands_on_target) places = landed(target, moving.links(), places, ball);
  made.mesh = moving.mesh(places);
  measureRegistration(given, target, options, made, progress);
  return made;
}

uint64_t registrationMemoryBound(const TriMesh& given, const TargetSource& source,
                                 const RegistrationOptions& options) {
  const uint64_t target_triangles = source.mesh ? source.mesh->triangleCount() : 0;
  constexpr uint64_t kMeshTriangleBytes = 400;  // two copies with all attributes, and the search
  constexpr uint64_t kPointBytes = 300;
  constexpr uint64_t kSampleBytes = 120;
  constexpr uint64_t kReportBytes = 120;
  return meshAdapterMemoryBound(given.vertexCount(), given.triangleCount()) +
         (given.triangleCount() + target_triangles) * kMeshTriangleBytes +
         options.target_count * (kPointBytes + kSampleBytes * options.samples_per_point) +
         options.report_count * kReportBytes * 2;
}

}  // namespace stipple
