#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "data/meshes/tri_mesh.h"
#include "math/vec.h"

namespace stipple {

/// A surface for tests of adaptation.
struct AdaptShape {
  std::vector<Vec3d> positions;
  std::vector<uint32_t> triangles;

  std::vector<float> floats() const {
    std::vector<float> values;
    for (const Vec3d& p : positions) {
      for (int axis = 0; axis < 3; ++axis) values.push_back(static_cast<float>(p[axis]));
    }
    return values;
  }
};

/// It as a mesh of one material.
inline TriMesh meshOf(const AdaptShape& shape) {
  TriMesh mesh;
  mesh.positions = shape.floats();
  mesh.triangles = shape.triangles;
  mesh.materials.resize(1);
  return mesh;
}

/// The one whose energies and forces the tests know in numbers.
inline AdaptShape tetrahedron() {
  return {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3}};
}

/// A unit sphere: an octahedron whose faces were split in four so many times.
inline AdaptShape sphere(int splits) {
  AdaptShape made = {{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}},
                     {0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5}};
  for (int split = 0; split < splits; ++split) {
    std::map<std::pair<uint32_t, uint32_t>, uint32_t> middles;
    const auto middle = [&](uint32_t a, uint32_t b) {
      const auto [entry, is_new] =
          middles.emplace(std::minmax(a, b), static_cast<uint32_t>(made.positions.size()));
      if (is_new) {
        made.positions.push_back((made.positions[a] + made.positions[b]).normalized());
      }
      return entry->second;
    };
    std::vector<uint32_t> finer;
    for (size_t t = 0; t < made.triangles.size(); t += 3) {
      const uint32_t a = made.triangles[t], b = made.triangles[t + 1], c = made.triangles[t + 2];
      const uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      finer.insert(finer.end(), {a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca});
    }
    made.triangles = finer;
  }
  return made;
}

/// A sheet of (side+1)^2 vertices over the unit square, with a bump in one corner.
inline AdaptShape bumpySheet(uint32_t side, double height) {
  AdaptShape made;
  for (uint32_t y = 0; y <= side; ++y) {
    for (uint32_t x = 0; x <= side; ++x) {
      const double u = double(x) / side, v = double(y) / side;
      const double near = (u - 0.3) * (u - 0.3) + (v - 0.3) * (v - 0.3);
      made.positions.emplace_back(u, v, height * std::exp(-near / 0.01));
      if (x == side || y == side) continue;
      const uint32_t a = y * (side + 1) + x, b = a + 1, c = a + side + 1, d = c + 1;
      made.triangles.insert(made.triangles.end(), {a, b, d, a, d, c});
    }
  }
  return made;
}

}  // namespace stipple
