#include "decode/test_meshes.h"

#include <cmath>
#include <fstream>
#include <numbers>
#include <sstream>
#include <stdexcept>

namespace stipple::test {

namespace {

using std::numbers::pi;

uint32_t addVertex(TriMesh& mesh, double x, double y, double z) {
  for (const double value : {x, y, z}) mesh.positions.push_back(static_cast<float>(value));
  return static_cast<uint32_t>(mesh.vertexCount() - 1);
}

void addTriangle(TriMesh& mesh, uint32_t a, uint32_t b, uint32_t c) {
  for (const uint32_t vertex : {a, b, c}) mesh.triangles.push_back(vertex);
}

void addQuad(TriMesh& mesh, uint32_t a, uint32_t b, uint32_t c, uint32_t d) {
  addTriangle(mesh, a, b, c);
  addTriangle(mesh, a, c, d);
}

Vec3d vertex(const TriMesh& mesh, size_t index) {
  return {static_cast<double>(mesh.positions[index * 3]),
          static_cast<double>(mesh.positions[index * 3 + 1]),
          static_cast<double>(mesh.positions[index * 3 + 2])};
}

Vec3d crossProduct(const Vec3d& a, const Vec3d& b) {
  return {a.y() * b.z() - a.z() * b.y(), a.z() * b.x() - a.x() * b.z(),
          a.x() * b.y() - a.y() * b.x()};
}

}  // namespace

TriMesh uvSphere(double radius, const Vec3d& centre, int rings, int segments) {
  TriMesh mesh;
  mesh.materials.resize(1);
  for (int r = 0; r <= rings; ++r) {
    const double theta = pi * r / rings;
    for (int s = 0; s < segments; ++s) {
      const double phi = 2 * pi * s / segments;
      addVertex(mesh, centre.x() + radius * std::sin(theta) * std::cos(phi),
                centre.y() + radius * std::sin(theta) * std::sin(phi),
                centre.z() + radius * std::cos(theta));
    }
  }
  for (int r = 0; r < rings; ++r) {
    for (int s = 0; s < segments; ++s) {
      const auto at = [&](int ring, int segment) {
        return static_cast<uint32_t>(ring * segments + segment % segments);
      };
      addQuad(mesh, at(r, s), at(r + 1, s), at(r + 1, s + 1), at(r, s + 1));
    }
  }
  smoothNormals(mesh);
  return mesh;
}

TriMesh cube(double side, const Vec3d& centre) {
  TriMesh mesh;
  mesh.materials.resize(1);
  const double h = side / 2;
  for (int k = 0; k < 8; ++k) {
    addVertex(mesh, centre.x() + (k & 1 ? h : -h), centre.y() + (k & 2 ? h : -h),
              centre.z() + (k & 4 ? h : -h));
  }
  addQuad(mesh, 0, 2, 3, 1);
  addQuad(mesh, 4, 5, 7, 6);
  addQuad(mesh, 0, 1, 5, 4);
  addQuad(mesh, 2, 6, 7, 3);
  addQuad(mesh, 0, 4, 6, 2);
  addQuad(mesh, 1, 3, 7, 5);
  return mesh;
}

TriMesh terrain(double side, int cells, double amplitude, const Vec3d& centre) {
  TriMesh mesh;
  mesh.materials.resize(1);
  for (int j = 0; j <= cells; ++j) {
    for (int i = 0; i <= cells; ++i) {
      const double x = side * (static_cast<double>(i) / cells - 0.5);
      const double y = side * (static_cast<double>(j) / cells - 0.5);
      addVertex(mesh, centre.x() + x, centre.y() + y,
                centre.z() + amplitude * std::sin(5 * x / side) * std::cos(7 * y / side));
    }
  }
  const auto at = [&](int i, int j) { return static_cast<uint32_t>(j * (cells + 1) + i); };
  for (int j = 0; j < cells; ++j) {
    for (int i = 0; i < cells; ++i) {
      addQuad(mesh, at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
    }
  }
  smoothNormals(mesh);
  return mesh;
}

TriMesh torus(double major, double minor, int rings, int segments) {
  TriMesh mesh;
  mesh.materials.resize(1);
  for (int r = 0; r < rings; ++r) {
    const double phi = 2 * pi * r / rings;
    for (int s = 0; s < segments; ++s) {
      const double theta = 2 * pi * s / segments;
      const double distance = major + minor * std::cos(theta);
      addVertex(mesh, distance * std::cos(phi), distance * std::sin(phi), minor * std::sin(theta));
    }
  }
  const auto at = [&](int r, int s) {
    return static_cast<uint32_t>((r % rings) * segments + s % segments);
  };
  for (int r = 0; r < rings; ++r) {
    for (int s = 0; s < segments; ++s) {
      addQuad(mesh, at(r, s), at(r + 1, s), at(r + 1, s + 1), at(r, s + 1));
    }
  }
  smoothNormals(mesh);
  return mesh;
}

TriMesh loadObj(const std::string& path) {
  TriMesh mesh;
  mesh.materials.resize(1);
  std::ifstream file(path);
  if (!file) throw std::runtime_error("cannot open " + path);
  std::string line;
  while (std::getline(file, line)) {
    std::istringstream words(line);
    std::string kind;
    words >> kind;
    if (kind == "v") {
      double x = 0, y = 0, z = 0;
      words >> x >> y >> z;
      addVertex(mesh, x, y, z);
    } else if (kind == "f") {
      uint32_t a = 0, b = 0, c = 0;
      words >> a >> b >> c;
      addTriangle(mesh, a - 1, b - 1, c - 1);
    }
  }
  smoothNormals(mesh);
  return mesh;
}

TriMesh joined(TriMesh first, const TriMesh& second) {
  if (first.corner_normals.empty() != second.corner_normals.empty()) {
    first.corner_normals.clear();
  } else {
    first.corner_normals.insert(first.corner_normals.end(), second.corner_normals.begin(),
                                second.corner_normals.end());
  }
  const auto offset = static_cast<uint32_t>(first.vertexCount());
  first.positions.insert(first.positions.end(), second.positions.begin(), second.positions.end());
  for (const uint32_t index : second.triangles) first.triangles.push_back(index + offset);
  return first;
}

void smoothNormals(TriMesh& mesh) {
  std::vector<Vec3d> sums(mesh.vertexCount(), Vec3d::Zero());
  for (size_t t = 0; t < mesh.triangleCount(); ++t) {
    const Vec3d p = vertex(mesh, mesh.triangles[t * 3]);
    const Vec3d normal = crossProduct(vertex(mesh, mesh.triangles[t * 3 + 1]) - p,
                                      vertex(mesh, mesh.triangles[t * 3 + 2]) - p);
    for (size_t corner = 0; corner < 3; ++corner) sums[mesh.triangles[t * 3 + corner]] += normal;
  }
  mesh.corner_normals.clear();
  for (const uint32_t index : mesh.triangles) {
    const Vec3d normal = sums[index] / std::max(sums[index].norm(), 1e-300);
    for (int axis = 0; axis < 3; ++axis) {
      mesh.corner_normals.push_back(static_cast<float>(normal[axis]));
    }
  }
}

}  // namespace stipple::test
