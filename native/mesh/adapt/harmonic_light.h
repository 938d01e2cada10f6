#pragma once

#include <span>
#include <vector>

#include "math/vec.h"
#include "mesh/adapt/mesh_links.h"

namespace stipple {

/// Light on surfaces that scatter it evenly, by their normal alone: harmonics of degrees 0 to 2,
/// whose functions have no factors here: 1, y, z, x, xy, yz, 3z^2 - 1, xz, x^2 - y^2.
/// Source: Ramamoorthi, Hanrahan, An Efficient Representation for Irradiance Environment Maps,
/// SIGGRAPH 2001.
struct HarmonicLight {
  static constexpr int kTerms = 9;
  using Terms = Eigen::Matrix<double, kTerms, 1>;

  Eigen::Matrix<double, kTerms, 3> colours = Eigen::Matrix<double, kTerms, 3>::Zero();  ///< linear

  static Terms terms(const Vec3d& normal);
  /// The colour that a white surface shows, linear.
  Vec3d on(const Vec3d& normal) const { return colours.transpose() * terms(normal); }
  /// The derivative by the normal of by_colour . on(normal).
  Vec3d gradient(const Vec3d& normal, const Vec3d& by_colour) const;
};

/// Least squares for the light that gives surfaces their colours.
class LightFit {
 public:
  /// In: terms of a normal, or a mixture of several; the linear colour seen there.
  void add(const HarmonicLight::Terms& terms, const Vec3d& colour);
  void add(const LightFit& other);
  bool isEmpty() const { return !(matrix_.trace() > 0); }
  /// Where what was added leaves the light open it is nearly dark. Not of an empty one.
  HarmonicLight light() const;

 private:
  Eigen::Matrix<double, HarmonicLight::kTerms, HarmonicLight::kTerms> matrix_ =
      Eigen::Matrix<double, HarmonicLight::kTerms, HarmonicLight::kTerms>::Zero();
  Eigen::Matrix<double, HarmonicLight::kTerms, 3> right_ =
      Eigen::Matrix<double, HarmonicLight::kTerms, 3>::Zero();
};

/// Normals of vertices: of the area vectors of their triangles, [n], unit; 0 where they sum up to
/// 0.
std::vector<Vec3d> vertexNormals(const MeshLinks& links, std::span<const Vec3d> positions);

/// Adds the derivatives by positions of by_normal . vertexNormals(). In: floor, lengths of sums of
/// area vectors: shorter ones turn as easily as one of that length, since others would turn without
/// limit. Out: by_position [n], added to.
void addNormalsGradient(const MeshLinks& links, std::span<const Vec3d> positions,
                        std::span<const Vec3d> by_normal, double floor,
                        std::span<Vec3d> by_position);

}  // namespace stipple
