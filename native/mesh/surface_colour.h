#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "data/meshes/tri_mesh.h"
#include "mesh/texture_lookup.h"

namespace stipple {

/// Weights of a triangle's corners, which add up to 1.
using Barycentric = std::array<double, 3>;

/// Colours of places on the triangles of a mesh, which must outlive it.
class SurfaceColour {
 public:
  explicit SurfaceColour(const TriMesh& mesh);

  /// Scene linear colour and opacity. share: of the triangle's area, what the place stands for;
  /// textures are averaged over it, 0 for none. random: where lookups lie that are averaged.
  std::array<float, 4> at(size_t triangle, const Barycentric& place, double share,
                          uint64_t random) const;

  /// Whether a triangle looks different from different sides.
  bool changesWithView(size_t triangle) const;
  /// Scene linear, [M,3]: what comes to the colour of a place from each of the mesh's view
  /// directions. In: a triangle that changesWithView().
  void addedByViews(size_t triangle, const Barycentric& place, std::span<float> added) const;
  /// The colour of a place seen along a unit direction, between the view directions around it.
  std::array<float, 4> seenAlong(const std::array<float, 3>& direction, size_t triangle,
                                 const Barycentric& place) const;

  /// Whether any place of a triangle may have an opacity below 1.
  bool mayBeTransparent(size_t triangle) const;

 private:
  const Material& materialOf(size_t triangle) const;
  std::array<float, 4> interpolated(size_t triangle, const Barycentric& place) const;
  std::array<float, 4> lookUp(const TextureLookup& texture, size_t triangle,
                              const Barycentric& place) const;
  std::array<float, 4> textured(const TextureLookup& texture, size_t triangle,
                                const Barycentric& place, double share, uint64_t random) const;

  const TriMesh& mesh_;
  std::vector<TextureLookup> textures_;
  float view_sharpness_ = 0;  ///< of the weights of view directions between them
};

}  // namespace stipple
