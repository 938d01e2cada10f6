#include "mesh/mesh_part.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "math/affine.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 8192;

/// Corner values of the part behind those of the mesh. Parts without values get zeros as soon as
/// any part has some; nothing reads those.
void appendCorners(std::vector<float>& values, const float* given, size_t old_triangles,
                   size_t new_triangles, size_t per_triangle) {
  if (!given && values.empty()) return;
  values.resize(old_triangles * per_triangle, 0.0f);
  if (given) {
    values.insert(values.end(), given, given + new_triangles * per_triangle);
  } else {
    values.resize((old_triangles + new_triangles) * per_triangle, 0.0f);
  }
}

void appendPositions(TriMesh& mesh, const MeshPart& part) {
  const size_t first = mesh.vertexCount();
  mesh.positions.resize((first + part.vertex_count) * 3);
  parallelFor(part.vertex_count, kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const float* p = part.positions + i * 3;
      const Vec3d world = (part.object_to_world * Vec4d(p[0], p[1], p[2], 1.0)).head<3>();
      for (size_t axis = 0; axis < 3; ++axis) {
        mesh.positions[(first + i) * 3 + axis] =
            static_cast<float>(world[static_cast<Eigen::Index>(axis)]);
      }
    }
  });
}

/// Corner normals in the world: those of the part by the inverse transpose, else face normals.
/// A matrix that mirrors turns triangles inside out; the sign of their face normals is turned back.
void appendNormals(TriMesh& mesh, const MeshPart& part, size_t first_vertex) {
  const size_t first = mesh.triangleCount();
  const Mat3d linear = linearPart(part.object_to_world);
  const Mat3d cofactor = inverse(linear).transpose();
  const double sign = determinant(linear) < 0 ? -1.0 : 1.0;
  const auto vertex = [&](uint32_t index) {
    const float* p = &mesh.positions[(first_vertex + index) * 3];
    return Vec3d(p[0], p[1], p[2]);
  };
  mesh.corner_normals.resize((first + part.triangle_count) * 9);
  parallelFor(part.triangle_count, kGrain, [&](size_t begin, size_t end) {
    for (size_t t = begin; t < end; ++t) {
      const uint32_t* corner = part.triangles + t * 3;
      const Vec3d a = vertex(corner[0]), b = vertex(corner[1]), c = vertex(corner[2]);
      const Vec3d cross = sign * (b - a).cross(c - a);
      const double area = cross.norm();
      const Vec3d face = area > 0 ? Vec3d(cross / area) : Vec3d(0, 0, 1);
      for (size_t k = 0; k < 3; ++k) {
        Vec3d normal = face;
        if (part.corner_normals) {
          const float* n = part.corner_normals + (t * 3 + k) * 3;
          const Vec3d turned = cofactor * Vec3d(n[0], n[1], n[2]);
          if (turned.norm() > 0) normal = turned.normalized();
        }
        for (size_t axis = 0; axis < 3; ++axis) {
          mesh.corner_normals[((first + t) * 3 + k) * 3 + axis] =
              static_cast<float>(normal[static_cast<Eigen::Index>(axis)]);
        }
      }
    }
  });
}

/// Material 0 where a part names none: made when first needed, plain grey.
uint32_t greyMaterial(TriMesh& mesh) {
  for (size_t i = 0; i < mesh.materials.size(); ++i) {
    const Material& material = mesh.materials[i];
    const Material grey;
    if (material.colour == grey.colour &&
        std::equal(material.base_colour, material.base_colour + 4, grey.base_colour)) {
      return static_cast<uint32_t>(i);
    }
  }
  mesh.materials.emplace_back();
  return static_cast<uint32_t>(mesh.materials.size() - 1);
}

}  // namespace

void validate(const MeshPart& part, const TriMesh& mesh) {
  validateAffine(part.object_to_world, "the part's matrix");
  const uint64_t vertex_count = mesh.vertexCount() + part.vertex_count;
  if (vertex_count > UINT32_MAX) {
    fail(ErrorCode::kInvalidArgument, "the mesh would have " + std::to_string(vertex_count) +
                                          " vertices; at most 4294967295 are allowed");
  }
  requireFinite(part.positions, part.vertex_count * 3, 3, "position of vertex");
  for (uint64_t i = 0; i < part.triangle_count * 3; ++i) {
    if (part.triangles[i] >= part.vertex_count) {
      fail(ErrorCode::kInvalidArgument, "triangle " + std::to_string(i / 3) + " uses vertex " +
                                            std::to_string(part.triangles[i]) + "; the part has " +
                                            std::to_string(part.vertex_count) + " vertices");
    }
  }
  if (part.corner_normals) {
    requireFinite(part.corner_normals, part.triangle_count * 9, 9, "normals of triangle");
  }
  if (part.corner_uvs) {
    requireFinite(part.corner_uvs, part.triangle_count * 6, 6, "UVs of triangle");
  }
  if (part.corner_colours) {
    requireFinite(part.corner_colours, part.triangle_count * 12, 12, "colours of triangle");
  }
  if (!part.triangle_materials) return;
  for (uint64_t i = 0; i < part.triangle_count; ++i) {
    const uint32_t index = part.triangle_materials[i];
    if (index >= mesh.materials.size()) {
      fail(ErrorCode::kInvalidArgument, "triangle " + std::to_string(i) + " has material " +
                                            std::to_string(index) + "; the mesh has " +
                                            std::to_string(mesh.materials.size()));
    }
    const MaterialColour colour = mesh.materials[index].colour;
    const bool has_views = !mesh.materials[index].view_textures.empty();
    if ((colour == MaterialColour::kTexture || has_views) && !part.corner_uvs) {
      fail(ErrorCode::kInvalidArgument,
           "the material of triangle " + std::to_string(i) +
               " takes its colour from a texture, but the mesh has no UV map");
    }
    if (colour == MaterialColour::kCorner && !part.corner_colours) {
      fail(ErrorCode::kInvalidArgument,
           "the material of triangle " + std::to_string(i) +
               " takes its colour from a colour attribute that the mesh does not have");
    }
  }
}

void appendPart(TriMesh& mesh, const MeshPart& part) {
  const size_t first_vertex = mesh.vertexCount();
  const size_t first_triangle = mesh.triangleCount();
  const uint64_t count = part.triangle_count;
  appendCorners(mesh.corner_uvs, part.corner_uvs, first_triangle, count, 6);
  appendCorners(mesh.corner_colours, part.corner_colours, first_triangle, count, 12);
  appendPositions(mesh, part);
  appendNormals(mesh, part, first_vertex);
  mesh.triangles.resize((first_triangle + count) * 3);
  std::transform(part.triangles, part.triangles + count * 3, &mesh.triangles[first_triangle * 3],
                 [&](uint32_t index) { return index + static_cast<uint32_t>(first_vertex); });
  if (part.triangle_materials) {
    mesh.triangle_materials.insert(mesh.triangle_materials.end(), part.triangle_materials,
                                   part.triangle_materials + count);
  } else {
    mesh.triangle_materials.resize(first_triangle + count, greyMaterial(mesh));
  }
}

}  // namespace stipple
