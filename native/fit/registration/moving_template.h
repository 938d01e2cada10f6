#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "base/progress.h"
#include "data/meshes/tri_mesh.h"
#include "fit/registration/pre_alignment.h"
#include "fit/registration/registration.h"
#include "fit/registration/registration_watch.h"
#include "mesh/adapt/merged_vertices.h"
#include "mesh/adapt/mesh_adapter.h"

namespace stipple {

constexpr const char* kAdaptingStage = "Adapting the mesh";

/// From metres to the unit ball around a target, and back.
struct UnitBall {
  Vec3d middle = Vec3d::Zero();
  double radius = 1;

  Vec3d into(const Vec3d& p) const { return (p - middle) / radius; }
  Vec3d outOf(const Vec3d& p) const { return radius * p + middle; }
};

/// A template whose vertices are to move, each place once, in the unit ball around its target.
class MovingTemplate {
 public:
  /// In: given, which must outlive this. Errors: kInvalidArgument for fewer than four triangles
  /// with three corners in different places.
  MovingTemplate(const TriMesh& given, const UnitBall& ball);

  const MergedVertices& merged() const { return merged_; }
  const MeshLinks& links() const { return links_; }
  const UnitBall& ball() const { return ball_; }
  /// Moves all of it, loose vertices too. In: of places in the ball; once.
  void align(const Similarity& alignment);
  /// Enters how many vertices move.
  void report(RegistrationReport& report) const;
  /// The template with its vertices where the merged ones are. In: places in the ball.
  TriMesh mesh(std::span<const Vec3d> places) const;

 private:
  const TriMesh& given_;
  UnitBall ball_;
  MergedVertices merged_;
  MeshLinks links_;
  Similarity alignment_;
};

/// Runs all steps, or as many as `watch` lets it, and shows it the shape after each. In: loss: adds
/// the gradient [n] at adapter.positions() and returns the loss. Returns the loss of the last.
double takeSteps(const MovingTemplate& moving, MeshAdapter& adapter, uint32_t steps,
                 const std::function<double(uint32_t step, std::span<Vec3d> gradient)>& loss,
                 Progress* progress, RegistrationWatch* watch);

}  // namespace stipple
