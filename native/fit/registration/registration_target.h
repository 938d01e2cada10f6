#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "data/clouds/splat_cloud.h"
#include "data/meshes/tri_mesh.h"

namespace stipple {

/// The surface that a template is to take, as points.
struct RegistrationTarget {
  std::vector<float> points;  ///< [N,3] metres
  std::vector<float>
      normals;  ///< [N,3] of length 0..1, how much each counts; or empty: none is known
  std::vector<float> weights;       ///< [N] >= 0, or empty: all the same
  bool is_oriented = true;          ///< false: a normal and its reverse are the same
  std::vector<float> positions;     ///< [V,3] of the mesh that the points are samples of, or empty
  std::vector<uint32_t> triangles;  ///< [F,3] of it

  size_t size() const { return points.size() / 3; }
};

/// Even samples of a mesh. Errors: kInvalidArgument for a mesh that validate() refuses. Same result
/// for any number of threads.
RegistrationTarget targetOfMesh(const TriMesh& mesh, size_t count, uint64_t seed);

/// Splats that one sees, weighted by their opacities, `count` of them at most, chosen evenly in
/// their order. A flat splat has its shortest axis for a normal, whose sign is not known; of round
/// ones and needles the normal counts for less, down to nothing, as its length says. Errors:
/// kInvalidArgument where there are no such splats.
RegistrationTarget targetOfSplats(const SplatCloud& cloud, size_t count);

/// Points as they are, `count` of them at most, chosen evenly in their order. In: points [N,3];
/// normals [N,3] of any length, or empty. Errors: kInvalidArgument for none, for arrays of
/// different sizes, and for values that are not finite.
RegistrationTarget targetOfPoints(std::span<const float> points, std::span<const float> normals,
                                  size_t count);

class ViewSource;

/// What a target is made of, in shares: exactly one of the four, none being points of which there
/// are none.
struct TargetSource {
  std::shared_ptr<const TriMesh> mesh;
  std::shared_ptr<const SplatCloud> cloud;
  std::shared_ptr<const ViewSource> views;
  std::vector<float> points, normals;  ///< as of targetOfPoints()
};

/// The target of whichever it is, views apart, which are no surface. Errors: as above. Options: the
/// count is that of the points, seed of a mesh's.
RegistrationTarget targetOf(const TargetSource& source, size_t count, uint64_t seed);

}  // namespace stipple
