#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
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
};

}  // namespace stipple
