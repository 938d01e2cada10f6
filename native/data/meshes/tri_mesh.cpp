#include "data/meshes/tri_mesh.h"

#include <cmath>
#include <string>

#include "base/error.h"

namespace stipple {

namespace {

[[noreturn]] void refuse(const std::string& message) {
  fail(ErrorCode::kInvalidArgument, message);
}

void requireCount(size_t seen, size_t expected, const char* array) {
  if (seen != expected) {
    refuse(std::string("mesh: ") + array + " holds " + std::to_string(seen) + " values; " +
           std::to_string(expected) + " are needed");
  }
}

void requireCountOrNone(size_t seen, size_t expected, const char* array) {
  if (seen != 0) requireCount(seen, expected, array);
}

/// Refuses a texture whose array does not match its size, or that holds NaN or infinity.
void requireTexture(const Image& image, size_t index) {
  const std::string name = "mesh: texture " + std::to_string(index);
  if (image.width == 0 || image.height == 0) {
    refuse(name + " is " + std::to_string(image.width) + " x " + std::to_string(image.height) +
           " pixels; at least 1 x 1 is needed");
  }
  if (image.channels != 1 && image.channels != 3 && image.channels != 4) {
    refuse(name + " has " + std::to_string(image.channels) + " channels; 1, 3 or 4 are allowed");
  }
  if (image.pixels.size() != image.pixelCount() * image.channels) {
    refuse(name + " holds " + std::to_string(image.pixels.size()) + " values; " +
           std::to_string(image.pixelCount() * image.channels) + " are needed");
  }
  requireFinite(image.pixels.data(), image.pixels.size(), image.channels,
                (name + ": pixel").c_str());
}

void requireMaterial(const TriMesh& mesh, size_t index) {
  const Material& material = mesh.materials[index];
  const std::string name = "mesh: material " + std::to_string(index);
  requireViewTextures(mesh, material, name);
  if (!material.view_textures.empty() && mesh.corner_uvs.empty()) {
    refuse(name + " has view textures, but the mesh has no UV coordinates");
  }
  requireFinite(material.base_colour, 4, 4, (name + ": base colour").c_str());
  switch (material.colour) {
    case MaterialColour::kConstant:
      return;
    case MaterialColour::kTexture:
      if (mesh.corner_uvs.empty()) {
        refuse(name + " takes its colour from a texture, but the mesh has no UV coordinates");
      }
      if (material.texture >= mesh.textures.size()) {
        refuse(name + " takes its colour from " +
               (material.texture == kNoTexture ? std::string("a texture that is missing")
                                               : "texture " + std::to_string(material.texture)) +
               "; the mesh has " + std::to_string(mesh.textures.size()) + " textures");
      }
      return;
    case MaterialColour::kCorner:
      if (mesh.corner_colours.empty()) {
        refuse(name + " takes its colour from a colour attribute, but the mesh has none");
      }
      return;
  }
  refuse(name + ": colour source is " + std::to_string(static_cast<uint32_t>(material.colour)) +
         "; 0 to 2 is allowed");
}

/// True as soon as one triangle has an area above 0.
bool hasArea(const TriMesh& mesh) {
  for (size_t t = 0; t < mesh.triangleCount(); ++t) {
    double p[3][3];
    for (size_t corner = 0; corner < 3; ++corner) {
      const size_t vertex = mesh.triangles[t * 3 + corner];
      for (size_t axis = 0; axis < 3; ++axis) {
        p[corner][axis] = static_cast<double>(mesh.positions[vertex * 3 + axis]);
      }
    }
    const double a[3] = {p[1][0] - p[0][0], p[1][1] - p[0][1], p[1][2] - p[0][2]};
    const double b[3] = {p[2][0] - p[0][0], p[2][1] - p[0][1], p[2][2] - p[0][2]};
    const double cross[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                             a[0] * b[1] - a[1] * b[0]};
    if (std::hypot(cross[0], cross[1], cross[2]) > 0) return true;
  }
  return false;
}

}  // namespace

void requireViewTextures(const TriMesh& mesh, const Material& material, const std::string& name) {
  if (material.view_textures.empty()) return;
  requireCount(material.view_textures.size(), mesh.view_directions.size() / 3,
               "view textures of a material");
  for (const uint32_t texture : material.view_textures) {
    if (texture < mesh.textures.size() && mesh.textures[texture].channels == 3) continue;
    refuse(name + " has view texture " + std::to_string(texture) + "; one of the " +
           std::to_string(mesh.textures.size()) + " textures with 3 channels is needed");
  }
}

void requireViewDirections(const std::vector<float>& values) {
  requireCount(values.size(), values.size() / 3 * 3, "view directions");
  requireFinite(values.data(), values.size(), 3, "mesh: view direction");
  for (size_t i = 0; i < values.size(); i += 3) {
    const double length =
        std::hypot(static_cast<double>(values[i]), static_cast<double>(values[i + 1]),
                   static_cast<double>(values[i + 2]));
    if (std::abs(length - 1) <= 1e-3) continue;  // rounding of float32 and of callers
    refuse("mesh: view direction " + std::to_string(i / 3) + " has a length of " +
           std::to_string(length) + "; 1 is needed");
  }
}

void validateArrays(const TriMesh& mesh) {
  const size_t triangles = mesh.triangleCount();
  const size_t vertices = mesh.vertexCount();
  requireCount(mesh.positions.size(), vertices * 3, "positions");
  requireCount(mesh.triangles.size(), triangles * 3, "triangles");
  if (triangles == 0) refuse("mesh has 0 triangles; at least 1 is needed");
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    if (mesh.triangles[i] >= vertices) {
      refuse("mesh: triangle " + std::to_string(i / 3) + " uses vertex " +
             std::to_string(mesh.triangles[i]) + "; the mesh has " + std::to_string(vertices) +
             " vertices");
    }
  }
  requireCountOrNone(mesh.corner_normals.size(), triangles * 9, "corner normals");
  requireCountOrNone(mesh.corner_uvs.size(), triangles * 6, "corner UVs");
  requireCountOrNone(mesh.corner_colours.size(), triangles * 12, "corner colours");
  requireCountOrNone(mesh.triangle_materials.size(), triangles, "triangle materials");
  requireFinite(mesh.positions.data(), mesh.positions.size(), 3, "mesh: position of vertex");
  requireFinite(mesh.corner_normals.data(), mesh.corner_normals.size(), 9,
                "mesh: corner normal of triangle");
  requireFinite(mesh.corner_uvs.data(), mesh.corner_uvs.size(), 6, "mesh: corner UV of triangle");
  requireFinite(mesh.corner_colours.data(), mesh.corner_colours.size(), 12,
                "mesh: corner colour of triangle");
  if (mesh.materials.empty()) refuse("mesh has 0 materials; at least 1 is needed");
  for (size_t t = 0; t < mesh.triangle_materials.size(); ++t) {
    if (mesh.triangle_materials[t] >= mesh.materials.size()) {
      refuse("mesh: triangle " + std::to_string(t) + " uses material " +
             std::to_string(mesh.triangle_materials[t]) + "; the mesh has " +
             std::to_string(mesh.materials.size()) + " materials");
    }
  }
  for (size_t i = 0; i < mesh.textures.size(); ++i) requireTexture(mesh.textures[i], i);
  requireViewDirections(mesh.view_directions);
  for (size_t i = 0; i < mesh.materials.size(); ++i) requireMaterial(mesh, i);
}

void validate(const TriMesh& mesh) {
  validateArrays(mesh);
  if (!hasArea(mesh)) {
    refuse("mesh: all faces have zero area (" + std::to_string(mesh.triangleCount()) +
           " triangles); at least 1 needs an area above 0");
  }
}

}  // namespace stipple
