#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <thread>
#include <vector>

#include "base/error.h"
#include "fit/registration/landing.h"
#include "fit/registration/registration.h"
#include "mesh/adapt/density_energy.h"
#include "mesh/adapt_meshes.h"
#include "mesh/surface_search.h"

namespace stipple {
namespace {

RegistrationOptions quick(uint32_t steps) {
  RegistrationOptions options;
  options.adapter.steps = steps;
  options.target_count = 2000;
  options.report_count = 2000;
  return options;
}

RegistrationTarget eggTarget() {
  AdaptShape egg = sphere(4);
  for (Vec3d& p : egg.positions) p = Vec3d(1.2 * p[0], 0.8 * p[1], 0.6 * p[2]);
  return targetOfMesh(meshOf(egg), 2000, 7);
}

TEST(RegistrationWatch, GivesAShapeOnceAndOnlyWhereOneWasAskedFor) {
  RegistrationWatch watch;
  registerMesh(meshOf(sphere(3)), eggTarget(), quick(3), nullptr, &watch);
  EXPECT_EQ(watch.takeShape(), nullptr);  // nobody had asked; from here on one is wanted
  const RegisteredMesh made =
      registerMesh(meshOf(sphere(3)), eggTarget(), quick(1), nullptr, &watch);
  const std::shared_ptr<TriMesh> shown = watch.takeShape();
  ASSERT_NE(shown, nullptr);
  EXPECT_EQ(shown->positions, made.mesh.positions);
  EXPECT_EQ(shown->triangles, made.mesh.triangles);
  EXPECT_EQ(watch.takeShape(), nullptr);
}

TEST(RegistrationWatch, ChangesNothingByLooking) {
  RegistrationWatch watch;
  watch.takeShape();
  const RegisteredMesh watched =
      registerMesh(meshOf(sphere(3)), eggTarget(), quick(10), nullptr, &watch);
  const RegisteredMesh alone = registerMesh(meshOf(sphere(3)), eggTarget(), quick(10));
  EXPECT_EQ(watched.mesh.positions, alone.mesh.positions);
  EXPECT_EQ(watched.report.step_count, 10u);
}

TEST(RegistrationWatch, EndsTheStepsAndKeepsTheirShape) {
  RegistrationWatch before;
  before.finish();
  const TriMesh given = meshOf(sphere(3));
  const RegisteredMesh none = registerMesh(given, eggTarget(), quick(50), nullptr, &before);
  EXPECT_EQ(none.report.step_count, 0u);
  for (size_t i = 0; i < given.positions.size(); ++i) {
    // Into the unit ball and back, in double precision: one rounding to float.
    EXPECT_NEAR(none.mesh.positions[i], given.positions[i], 2e-7);
  }

  RegistrationWatch watch;
  RegisteredMesh made;
  std::thread work(
      [&] { made = registerMesh(given, eggTarget(), quick(1000000), nullptr, &watch); });
  while (!watch.takeShape()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  watch.finish();
  work.join();
  EXPECT_GE(made.report.step_count, 1u);
  EXPECT_LT(made.report.step_count, 1000000u);
  EXPECT_TRUE(made.report.is_measured);
  EXPECT_NE(made.mesh.positions, given.positions);
}

double squaredFrom(const SurfaceSearch& surface, const float* p) {
  std::vector<SurfacePlace> places;
  surface.nearest(Vec3d(double(p[0]), double(p[1]), double(p[2])), 1, places);
  return places[0].squared;
}

/// Standard deviation of the mean edge lengths at vertices, of their mean.
double unevenness(const TriMesh& mesh) {
  std::vector<Vec3d> places;
  for (size_t v = 0; v < mesh.vertexCount(); ++v) {
    places.push_back(Eigen::Map<const Vec3f>(&mesh.positions[v * 3]).cast<double>());
  }
  const MeshLinks links(places.size(), mesh.triangles);
  const VertexLengths lengths = vertexLengths(links, places);
  double sum = 0;
  for (const double length : lengths.lengths) sum += std::pow(length - lengths.mean, 2);
  return std::sqrt(sum / static_cast<double>(places.size())) / lengths.mean;
}

TEST(Landing, EvensOutASheetOnItsOwnSurfaceAndBorder) {
  const TriMesh given = meshOf(bumpySheet(24, 0.4));
  RegistrationOptions options = quick(200);
  options.adapter.density = MeshDensity::kUniform;
  options.lands_on_target = true;
  const RegisteredMesh made = registerMesh(given, targetOfMesh(given, 4000, 1), options);
  EXPECT_EQ(made.mesh.triangles, given.triangles);
  // The border, which stays in its plane, and the bump's foot keep some of it.
  EXPECT_LT(unevenness(made.mesh), 0.8 * unevenness(given));
  const SurfaceSearch surface(given.positions, given.triangles);
  for (size_t v = 0; v < given.vertexCount(); ++v) {
    const float* p = &made.mesh.positions[v * 3];
    // Positions are floats of about 1: a few units in the last place.
    EXPECT_LT(squaredFrom(surface, p), 1e-12);
    const float* from = &given.positions[v * 3];
    const auto isOnBorder = [](const float* q) {
      return std::min({q[0], q[1], 1 - q[0], 1 - q[1]}) < 1e-6f;
    };
    EXPECT_TRUE(isOnBorder(p) || !isOnBorder(from)) << v;
  }
}

TEST(Landing, FindsBordersThroughSeams) {
  // Two triangles of a square, each with corners of its own: the diagonal is no border.
  const std::vector<float> positions = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 0, 0, 1, 1, 0, 0, 1, 0};
  const std::vector<uint32_t> triangles = {0, 1, 2, 3, 4, 5};
  const std::vector<uint32_t> one = {0, 1, 2};
  const MeshLinks links(3, one);
  std::vector<Vec3d> vertices = {{0.5, 0.45, 1}, {0.5, 0.2, -1}, {2, 2, 2}};
  landOnSurface(positions, triangles, links, vertices);
  // The nearest of the four sides; the diagonal would be nearer to the first.
  EXPECT_NEAR((vertices[0] - Vec3d(0.5, 0, 0)).norm(), 0, 1e-12);
  EXPECT_NEAR((vertices[1] - Vec3d(0.5, 0, 0)).norm(), 0, 1e-12);
  EXPECT_NEAR((vertices[2] - Vec3d(1, 1, 0)).norm(), 0, 1e-12);
}

TEST(Landing, NeedsTriangles) {
  RegistrationOptions options = quick(1);
  options.lands_on_target = true;
  const std::vector<float> points = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  try {
    registerMesh(meshOf(sphere(2)), targetOfPoints(points, {}, 10), options);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    EXPECT_STREQ(error.what(),
                 "the target has no triangles that vertices could land on; only a mesh has some");
  }
}

}  // namespace
}  // namespace stipple
