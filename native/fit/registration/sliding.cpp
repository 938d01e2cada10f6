#include "fit/registration/sliding.h"

#include <algorithm>
#include <vector>

#include "base/error.h"
#include "fit/registration/moving_template.h"
#include "fit/registration/registration_report.h"
#include "fit/registration/sliding_surface.h"
#include "mesh/adapt/moving_samples.h"
#include "mesh/adapt/point_rows.h"

namespace stipple {

namespace {

/// The middle of all vertices, and the radius that holds them.
UnitBall ballOf(const TriMesh& mesh) {
  UnitBall ball;
  const size_t count = mesh.vertexCount();
  for (size_t v = 0; v < count; ++v) {
    ball.middle += rowOf(mesh.positions, v) / static_cast<double>(std::max<size_t>(count, 1));
  }
  double radius = 0;
  for (size_t v = 0; v < count; ++v) {
    radius = std::max(radius, (rowOf(mesh.positions, v) - ball.middle).norm());
  }
  if (radius > 0) ball.radius = radius;
  return ball;
}

/// Of the mean edge: larger steps lead vertices past each other.
constexpr double kStepOfEdge = 0.2;
constexpr int kMostRounds = 8;

double meanEdge(const MeshLinks& links, std::span<const Vec3d> places) {
  const std::span<const uint32_t> triangles = links.triangles();
  double sum = 0;
  for (size_t corner = 0; corner < triangles.size(); ++corner) {
    const uint32_t next = triangles[corner / 3 * 3 + (corner + 1) % 3];
    sum += (places[next] - places[triangles[corner]]).norm();
  }
  return sum / static_cast<double>(triangles.size());
}

/// Takes vertices back whose triangles a step has turned over, until none is. In: where they were.
void unfold(const MeshLinks& links, std::span<const Vec3d> before, std::span<Vec3d> places) {
  const std::span<const uint32_t> triangles = links.triangles();
  for (int round = 0; round < kMostRounds; ++round) {
    bool is_folded = false;
    std::vector<uint8_t> goes_back(places.size(), 0);
    for (uint32_t t = 0; t < links.triangleCount(); ++t) {
      const Vec3d old = areaVector(triangles, before, t);
      if (!(old.squaredNorm() > 0) || areaVector(triangles, places, t).dot(old) > 0) continue;
      is_folded = true;
      for (size_t k = 0; k < 3; ++k) goes_back[triangles[size_t{t} * 3 + k]] = 1;
    }
    if (!is_folded) return;
    const bool is_last = round + 1 == kMostRounds;
    for (size_t v = 0; v < places.size(); ++v) {
      if (goes_back[v] || is_last) places[v] = before[v];
    }
  }
}

}  // namespace

RegisteredMesh slideOnItself(const TriMesh& given, const RegistrationOptions& options,
                             Progress* progress, RegistrationWatch* watch) {
  validate(options);
  validate(given);
  if (!options.landmarks.empty()) {
    fail(ErrorCode::kInvalidArgument,
         "landmarks are for other targets; a mesh that slides on itself stays where it is");
  }
  const MovingTemplate moving(given, ballOf(given));
  const SlidingSurface surface(moving.links(), moving.merged().positions, options.sharp_angle);
  MeshAdapterOptions steps = options.adapter;
  steps.density_share = 1.0;
  const double edge = meanEdge(moving.links(), moving.merged().positions);
  if (edge > 0) steps.step_size = std::min(steps.step_size, kStepOfEdge * edge);
  MeshAdapter adapter(moving.links(), moving.merged().positions, steps);
  RegisteredMesh made;
  moving.report(made.report);
  std::vector<Vec3d> before(moving.merged().positions), places = before;
  const auto land = [&] {
    std::copy(adapter.positions().begin(), adapter.positions().end(), places.begin());
    surface.land(places);
    unfold(moving.links(), before, places);
    adapter.place(places);
    before = places;
  };
  takeSteps(
      moving, adapter, steps.steps,
      [&](uint32_t step, std::span<Vec3d>) {
        if (step > 0) land();
        return 0.0;
      },
      progress, watch);
  land();
  made.report.step_count = adapter.stepCount();
  made.mesh = moving.mesh(adapter.positions());
  measureRegistration(given, targetOfMesh(given, options.target_count, options.seed), options, made,
                      progress);
  return made;
}

bool isItself(const TriMesh& given, const TriMesh& target) {
  return given.positions == target.positions && given.triangles == target.triangles;
}

}  // namespace stipple
