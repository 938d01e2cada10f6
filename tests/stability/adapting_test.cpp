#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "fit/registration/registration.h"
#include "mesh/adapt_meshes.h"

// Templates and targets of bad shape, with traps on: what comes out is finite, has the triangles
// that went in, and stays near the target.

namespace stipple {
namespace {

TriMesh meshWithNormals(const AdaptShape& shape) {
  TriMesh mesh = meshOf(shape);
  mesh.corner_normals.assign(mesh.triangles.size() * 3, 0.57735f);
  return mesh;
}

struct BadShape {
  const char* name;
  std::function<void(AdaptShape&)> change;
};

std::vector<BadShape> badShapes() {
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

RegistrationOptions quick(MeshDensity density) {
  RegistrationOptions options;
  options.adapter.steps = 40;
  options.adapter.density = density;
  options.target_count = 500;
  options.report_count = 500;
  options.weights.symmetric = 0.1;
  return options;
}

void requireFinite(const TriMesh& mesh) {
  for (const float value : mesh.positions) EXPECT_TRUE(std::isfinite(value));
  for (const float value : mesh.corner_normals) EXPECT_TRUE(std::isfinite(value));
}

/// The largest distance of a vertex from their middle.
double radiusOf(const AdaptShape& shape) {
  Vec3d middle = Vec3d::Zero();
  for (const Vec3d& p : shape.positions) middle += p / static_cast<double>(shape.positions.size());
  double radius = 0;
  for (const Vec3d& p : shape.positions) radius = std::max(radius, (p - middle).norm());
  return radius;
}

TEST(Adapting, TemplatesOfBadShapeStayFinite) {
  const RegistrationTarget target = targetOfMesh(meshWithNormals(sphere(3)), 500, 1);
  for (const BadShape& bad : badShapes()) {
    SCOPED_TRACE(bad.name);
    AdaptShape shape = sphere(2);
    bad.change(shape);
    const TriMesh given = meshWithNormals(shape);
    for (const PreAlignment alignment : {PreAlignment::kNone, PreAlignment::kSimilarity}) {
      RegistrationOptions options = quick(MeshDensity::kAdaptive);
      options.alignment = alignment;
      const RegisteredMesh made = registerMesh(given, target, options);
      EXPECT_EQ(made.mesh.triangles, given.triangles);
      requireFinite(made.mesh);
    }
  }
}

TEST(Adapting, TargetsOfBadShapeAreMetOnceTheTemplateIsAsLarge) {
  for (const BadShape& bad : badShapes()) {
    SCOPED_TRACE(bad.name);
    AdaptShape shape = sphere(3);
    bad.change(shape);
    const TriMesh target = meshWithNormals(shape);
    for (const MeshDensity density : {MeshDensity::kUniform, MeshDensity::kAdaptive}) {
      RegistrationOptions options = quick(density);
      options.alignment = PreAlignment::kSize;
      const RegisteredMesh made =
          registerMesh(meshWithNormals(sphere(2)), targetOfMesh(target, 500, 1), options);
      requireFinite(made.mesh);
      // Forty steps are few for a ball to become a needle, and 66 vertices have no room for fins.
      EXPECT_TRUE(made.report.after.distance < 0.2 * radiusOf(shape) ||
                  made.report.after.distance < 0.8 * made.report.before.distance)
          << made.report.before.distance << " became " << made.report.after.distance;
    }
  }
}

TEST(Adapting, StrengthsAndStepsThatAreFarTooLargeStayFinite) {
  const RegistrationTarget target = targetOfMesh(meshWithNormals(sphere(3)), 500, 1);
  for (const double strength : {0.0, 1e-300, 100.0, 1e6}) {
    for (const double step_size : {1e-300, 0.05, 10.0}) {
      for (const double smoothness : {0.0, 10.0, 1e6}) {
        RegistrationOptions options = quick(MeshDensity::kAdaptive);
        options.adapter.strength = strength;
        options.adapter.step_size = step_size;
        options.adapter.smoothness = smoothness;
        requireFinite(registerMesh(meshWithNormals(sphere(2)), target, options).mesh);
      }
    }
  }
}

}  // namespace
}  // namespace stipple
