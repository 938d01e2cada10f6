#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <functional>
#include <vector>

#include "mesh/adapt_meshes.h"

// Shapes that meshes of real scenes have and nobody wants.

namespace stipple {

inline TriMesh meshWithNormals(const AdaptShape& shape) {
  TriMesh mesh = meshOf(shape);
  mesh.corner_normals.assign(mesh.triangles.size() * 3, 0.57735f);
  return mesh;
}

struct BadShape {
  const char* name;
  std::function<void(AdaptShape&)> change;
};

inline std::vector<BadShape> badShapes() {
  const auto each = [](const std::function<void(Vec3d&)>& change) {
    return [change](AdaptShape& shape) {
      for (Vec3d& p : shape.positions) change(p);
    };
  };
  return {
      {"a sphere", [](AdaptShape&) {}},
      {"a disc of no thickness", each([](Vec3d& p) { p[2] = 0; })},
      {"a needle", each([](Vec3d& p) { p = Vec3d(p[0], 1e-6 * p[1], 1e-6 * p[2]); })},
      {"a millionth as large", each([](Vec3d& p) { p *= 1e-6; })},
      {"1e15 times as large", each([](Vec3d& p) { p *= 1e15; })},
      {"1e-15 times as large", each([](Vec3d& p) { p *= 1e-15; })},
      {"1000 times its size away", each([](Vec3d& p) { p += Vec3d(1000, -1000, 0); })},
      {"turned inside out", each([](Vec3d& p) { p = -p; })},
      {"half of it in one point", each([](Vec3d& p) {
         if (p[0] > 0) p = Vec3d(1, 0, 0);
       })},
      {"one vertex pulled away", [](AdaptShape& shape) { shape.positions[7] *= 1e4; }},
      {"every triangle twice",
       [](AdaptShape& shape) {
         const std::vector<uint32_t> once = shape.triangles;
         shape.triangles.insert(shape.triangles.end(), once.begin(), once.end());
       }},
      {"a fan of fins on one edge",
       [](AdaptShape& shape) {
         for (int fin = 0; fin < 20; ++fin) {
           shape.positions.emplace_back(2, 0.1 * fin, 0);
           shape.triangles.insert(shape.triangles.end(),
                                  {shape.triangles[0], shape.triangles[1],
                                   static_cast<uint32_t>(shape.positions.size() - 1)});
         }
       }},
      {"a thousand triangles around one vertex",
       [](AdaptShape& shape) {
         const auto first = static_cast<uint32_t>(shape.positions.size());
         shape.positions.emplace_back(0, 0, 1.5);
         constexpr uint32_t kAround = 1000;
         for (uint32_t i = 0; i < kAround; ++i) {
           const double turn = 6.283185307179586 * i / kAround;
           shape.positions.emplace_back(std::cos(turn), std::sin(turn), 1.2);
           shape.triangles.insert(shape.triangles.end(),
                                  {first, first + 1 + i, first + 1 + (i + 1) % kAround});
         }
       }},
  };
}

inline void requireFinite(const TriMesh& mesh) {
  for (const float value : mesh.positions) EXPECT_TRUE(std::isfinite(value));
  for (const float value : mesh.corner_normals) EXPECT_TRUE(std::isfinite(value));
}

}  // namespace stipple
