#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "data/images/image.h"

namespace stipple {

constexpr uint32_t kNoTexture = UINT32_MAX;

/// Where the colour of a material's triangles comes from.
enum class MaterialColour : uint32_t {
  kConstant = 0,  ///< base_colour
  kTexture = 1,   ///< textures[texture] at the corner UVs, times nothing else
  kCorner = 2,    ///< corner_colours
};

struct Material {
  MaterialColour colour = MaterialColour::kConstant;
  float base_colour[4] = {0.8f, 0.8f, 0.8f, 1.0f};  ///< scene linear, straight alpha
  uint32_t texture = kNoTexture;
  /// For each of the mesh's view_directions a texture at the corner UVs, scene linear, of what
  /// comes to the colour when it is seen along that direction; or empty: it looks alike from
  /// everywhere.
  std::vector<uint32_t> view_textures = {};
};

/// A triangle mesh in one frame (all parts already placed). Attributes are per corner, so that
/// seams and sharp edges need no split vertices.
struct TriMesh {
  std::vector<float> positions;       ///< [V,3] metres
  std::vector<uint32_t> triangles;    ///< [T,3] vertex indices
  std::vector<float> corner_normals;  ///< [T,3,3] unit, or empty: face normals
  std::vector<float> corner_uvs;      ///< [T,3,2] v = 0 at the bottom of the picture, or empty
  std::vector<float> corner_colours;  ///< [T,3,4] scene linear, straight alpha, or empty
  std::vector<uint32_t> triangle_materials;  ///< [T] index into materials, or empty: material 0
  std::vector<Material> materials;           ///< at least one where there are triangles
  std::vector<Image> textures;               ///< straight alpha (unlike other pictures)
  std::vector<float> view_directions;        ///< [M,3] unit, from the eye to the surface, or empty

  size_t vertexCount() const { return positions.size() / 3; }
  size_t triangleCount() const { return triangles.size() / 3; }
};

/// Refuses directions [M,3] that are no unit vectors.
void requireViewDirections(const std::vector<float>& directions);
/// Refuses view textures of a material, called `name`, that are missing, not as many as the mesh's
/// directions or not of 3 channels.
void requireViewTextures(const TriMesh& mesh, const Material& material, const std::string& name);

/// Refuses: no triangle, index out of range, array sizes that disagree, non-finite values, a
/// material that needs UVs, colours or a texture which are not there.
void validate(const TriMesh& mesh);
/// The same, but that triangles without area are let through: what every file gives.
void validateArrays(const TriMesh& mesh);

}  // namespace stipple
