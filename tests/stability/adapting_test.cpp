#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "bad_shapes.h"
#include "fit/registration/registration.h"

// Templates and targets of bad shape, with traps on: what comes out is finite, has the triangles
// that went in, and stays near the target.

namespace stipple {
namespace {

RegistrationOptions quick(MeshDensity density) {
  RegistrationOptions options;
  options.adapter.steps = 40;
  options.adapter.density = density;
  options.target_count = 500;
  options.report_count = 500;
  options.weights.symmetric = 0.1;
  return options;
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

TEST(Adapting, MeshesOfBadShapeSlideOnThemselves) {
  for (const BadShape& bad : badShapes()) {
    SCOPED_TRACE(bad.name);
    AdaptShape shape = sphere(3);
    bad.change(shape);
    const TriMesh given = meshWithNormals(shape);
    for (const MeshDensity density : {MeshDensity::kUniform, MeshDensity::kAdaptive}) {
      for (const double sharp_angle : {0.0, 0.8, 3.141592}) {
        RegistrationOptions options = quick(density);
        options.lands_on_target = true;
        options.sharp_angle = sharp_angle;
        const RegisteredMesh made = registerMesh(given, targetOfMesh(given, 500, 1), options);
        EXPECT_EQ(made.mesh.triangles, given.triangles);
        requireFinite(made.mesh);
        // Chords cut the surface by less than its triangles are long.
        EXPECT_LT(made.report.after.distance, 0.1 * radiusOf(shape));
      }
    }
  }
}

TEST(Adapting, WhatIsFlatButForRoundingHasNoDetail) {
  // A sheet whose heights are those that rounding leaves: to adapt is to even out.
  AdaptShape sheet = bumpySheet(24, 0);
  for (size_t v = 0; v < sheet.positions.size(); ++v) {
    sheet.positions[v].x() *= sheet.positions[v].x();
    sheet.positions[v].z() = 1e-8 * static_cast<double>(v * 7919 % 13);
  }
  const TriMesh given = meshWithNormals(sheet);
  std::vector<std::vector<float>> made;
  for (const MeshDensity density : {MeshDensity::kUniform, MeshDensity::kAdaptive}) {
    RegistrationOptions options = quick(density);
    options.lands_on_target = true;
    made.push_back(registerMesh(given, targetOfMesh(given, 500, 1), options).mesh.positions);
  }
  EXPECT_EQ(made[0], made[1]);
  // Columns of the sheet are as wide as each other now: their last one was twice as wide as the
  // mean.
  for (size_t v = 0; v < sheet.positions.size(); ++v) {
    EXPECT_NEAR(made[0][v * 3], static_cast<double>(v % 25) / 24, 0.01) << v;
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
