#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "fit/registration/sliding_surface.h"
#include "math/vec.h"
#include "mesh/adapt/mesh_adapter.h"
#include "mesh/adapt/mesh_links.h"

namespace stipple {

struct EvenSliding {
  std::vector<Vec3d> places;  ///< [n]
  uint32_t step_count = 0;    ///< that were taken
};

/// How long edges are to be at each place of a surface, in proportion: all 1, or, where the density
/// is adaptive, by the root of how much the surface bends there (the angles between its faces,
/// sharp edges left out, per area), between half and twice of the mean. Out: [n].
std::vector<double> edgeGoals(const MeshLinks& links, std::span<const Vec3d> positions,
                              const SlidingSurface& surface, MeshDensity density, double shortest);

/// Slides the vertices of a mesh along its own surface until triangles and edges are as large as
/// each other, or as the goals at their places say. Lines are divided first; then each implicit
/// step draws each vertex to its neighbours, to those of larger area more, along the plane that
/// touches the surface at it, and lands. A step that makes the mesh clearly less even is taken
/// again with half of the time. What comes out is the most even mesh that was met, in which the
/// vertices of triangles that steps turned over are back where they were before: it is never less
/// even than the given one, and no triangle is turned over that was not. Steps end early once
/// nothing becomes better. In: positions [n], those of the surface; options: density, steps,
/// shortest; goes_on: called before each step with the number of steps so far and the present
/// places; false ends them. Threads and determinism: parallel; same result for any number of
/// threads. Cost: a factor of n rows and O(n log F) a step. docs/methods/mesh_adaptation.md.
EvenSliding slideEvenly(
    const MeshLinks& links, std::span<const Vec3d> positions, const SlidingSurface& surface,
    const MeshAdapterOptions& options,
    const std::function<bool(uint32_t step, std::span<const Vec3d> places)>& goes_on);

}  // namespace stipple
