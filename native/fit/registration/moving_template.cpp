#include "fit/registration/moving_template.h"

#include <algorithm>
#include <memory>
#include <string>

#include "base/error.h"
#include "mesh/adapt/corner_normals.h"
#include "mesh/adapt/point_rows.h"

namespace stipple {

namespace {

constexpr size_t kFewestTriangles = 4;  ///< those of a tetrahedron

MergedVertices mergedIn(const TriMesh& given, const UnitBall& ball) {
  MergedVertices merged = mergeVertices(given.positions, given.triangles);
  if (merged.triangles.size() / 3 < kFewestTriangles) {
    fail(ErrorCode::kInvalidArgument,
         "the template has " + std::to_string(merged.triangles.size() / 3) +
             " triangles with three corners in different places; at least " +
             std::to_string(kFewestTriangles) + " are needed");
  }
  for (Vec3d& p : merged.positions) p = ball.into(p);
  return merged;
}

}  // namespace

MovingTemplate::MovingTemplate(const TriMesh& given, const UnitBall& ball)
    : given_(given),
      ball_(ball),
      merged_(mergedIn(given, ball)),
      links_(merged_.positions.size(), merged_.triangles) {}

void MovingTemplate::align(const Similarity& alignment) {
  alignment_ = alignment;
  for (Vec3d& p : merged_.positions) p = alignment(p);
}

void MovingTemplate::report(RegistrationReport& report) const {
  report.place_count = merged_.positions.size();
  report.loose_count = static_cast<uint64_t>(
      std::count(merged_.place_of.begin(), merged_.place_of.end(), kLooseVertex));
}

TriMesh MovingTemplate::mesh(std::span<const Vec3d> places) const {
  TriMesh mesh = given_;
  for (size_t v = 0; v < mesh.vertexCount(); ++v) {
    const uint32_t place = merged_.place_of[v];
    const Vec3d in_ball =
        place == kLooseVertex ? alignment_(ball_.into(rowOf(given_.positions, v))) : places[place];
    setRow(mesh.positions, v, ball_.outOf(in_ball));
  }
  renewCornerNormals(mesh, merged_.place_of);
  return mesh;
}

double takeSteps(const MovingTemplate& moving, MeshAdapter& adapter, uint32_t steps,
                 const std::function<double(uint32_t step, std::span<Vec3d> gradient)>& loss,
                 Progress* progress, RegistrationWatch* watch) {
  std::vector<Vec3d> gradient(moving.links().vertexCount());
  double last = 0;
  for (uint32_t step = 0; step < steps; ++step) {
    advance(progress, static_cast<double>(step) / steps, kAdaptingStage);
    if (watch && watch->wantsEnd()) break;
    std::fill(gradient.begin(), gradient.end(), Vec3d::Zero());
    last = loss(step, gradient);
    adapter.step(gradient);
    if (watch && watch->wantsShape()) {
      watch->show(std::make_shared<TriMesh>(moving.mesh(adapter.positions())));
    }
  }
  return last;
}

}  // namespace stipple
