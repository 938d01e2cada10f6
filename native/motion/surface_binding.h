#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"

namespace stipple {

/// How splats are bound to a mesh.
enum class BindingReach : uint32_t {
  kSurface = 0,  ///< to the nearest triangle: splats that lie on the mesh stay where they are on it
  kAround =
      1,  ///< to several near triangles, smoothly: scans and fits inside a cage or near a mesh
};

/// How far a deformation may stretch and shrink what is bound, in any direction. Beyond it, shapes
/// stay as they are at the bound; places follow all the way.
constexpr double kLargestStretch = 10;

/// Triangles that a splat follows where it is bound smoothly.
constexpr uint32_t kAroundTriangles = 8;

/// Splats bound to a mesh at rest.
struct SurfaceBinding {
  uint64_t topology = 0;            ///< topologyOf() the mesh
  std::vector<float> rest;          ///< [V,3] the mesh at rest, metres, in the frame of the splats
  std::vector<uint32_t> triangles;  ///< [T,3]
  uint32_t influences = 1;          ///< M
  std::vector<uint32_t> bound;      ///< [N,M] triangles
  std::vector<float> weights;       ///< [N,M] sum 1

  size_t size() const { return bound.size() / influences; }
};

/// A number that two meshes share where they have as many vertices and the same triangles.
uint64_t topologyOf(size_t vertex_count, std::span<const uint32_t> triangles);

/// Binds splats to the nearest triangles that have an area.
/// In: positions [N,3] finite; rest [V,3]; triangles [T,3].
/// Errors: kInvalidArgument for a mesh without a triangle of some area, indices outside of it,
/// numbers that are not finite; kCancelled.
/// Threads and determinism: parallel; same result for any number of threads.
SurfaceBinding bindToSurface(std::span<const float> positions, std::span<const float> rest,
                             std::span<const uint32_t> triangles, BindingReach reach,
                             Progress* progress = nullptr);

/// Bytes that bindToSurface() holds at most, its result included.
uint64_t bindingMemoryBound(uint64_t splat_count, uint64_t vertex_count, uint64_t triangle_count,
                            BindingReach reach);

/// Refuses bindings that do not belong to so many splats, or lead outside of their own mesh.
/// `what` names it. Errors: kInvalidArgument.
void validate(const SurfaceBinding& binding, size_t splat_count, const char* what);

/// The splats as the deformed mesh carries them. Places follow the triangles, and heights above
/// them grow with the root of their areas; covariances deform likewise; harmonics turn with the
/// rotation of the polar decomposition. Opacities and colours stay.
/// In: a cloud as long as the binding; deformed [V,3], finite, in the frame of the cloud.
/// Errors: kInvalidArgument where numbers do not agree or are not finite.
/// Threads and determinism: parallel; same result for any number of threads.
SplatCloud carriedSplats(const SplatCloud& cloud, const SurfaceBinding& binding,
                         std::span<const float> deformed);

/// Bytes that carriedSplats() holds at most, its result included.
uint64_t carriedMemoryBound(const SplatCloud& cloud, const SurfaceBinding& binding);

}  // namespace stipple
