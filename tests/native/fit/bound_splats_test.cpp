#include "fit/registration/bound_splats.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "fit/mesh_images.h"
#include "math/covariance.h"
#include "mesh/adapt_meshes.h"

namespace stipple {
namespace {

std::vector<Vec3d> greys(size_t count) {
  return std::vector<Vec3d>(count, Vec3d(0.5, 0.5, 0.5));
}

/// Random derivatives by all that place() writes.
SplatCloud randomGradients(size_t count) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> any(-1.0f, 1.0f);
  SplatCloud made;
  for (auto* values : {&made.positions, &made.scales, &made.sh}) {
    for (size_t i = 0; i < count * 3; ++i) values->push_back(any(random));
  }
  for (size_t i = 0; i < count * 4; ++i) made.rotations.push_back(any(random));
  return made;
}

double weighed(const std::vector<float>& values, const std::vector<float>& by) {
  double sum = 0;
  for (size_t i = 0; i < values.size(); ++i) {
    sum += static_cast<double>(values[i]) * static_cast<double>(by[i]);
  }
  return sum;
}

TEST(BoundSplats, HasTheDerivativesOfItsFiniteDifferences) {
  AdaptShape shape = sphere(1);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> any(-0.15, 0.15);
  for (Vec3d& p : shape.positions) p += Vec3d(any(random), any(random), any(random));
  std::vector<Vec3d> colours;
  for (const Vec3d& p : shape.positions) colours.push_back(0.5 * (p + Vec3d(1.2, 1.2, 1.2)));
  const MeshLinks links(shape.positions.size(), shape.triangles);
  const BoundSplats splats(links, shape.positions, 0.1);
  ASSERT_GT(splats.count(), links.triangleCount());
  SplatCloud cloud;
  splats.place(shape.positions, colours, cloud);
  // A derivative by a quaternion is perpendicular to it, since its length changes nothing.
  SplatCloud by = randomGradients(splats.count());
  for (size_t i = 0; i < splats.count(); ++i) {
    float* of_splat = &by.rotations[i * 4];
    const float* q = &cloud.rotations[i * 4];
    float along = 0;
    for (int k = 0; k < 4; ++k) along += of_splat[k] * q[k];
    for (int k = 0; k < 4; ++k) of_splat[k] -= along * q[k];
  }
  const auto lossOf = [&](const std::vector<Vec3d>& positions, const std::vector<Vec3d>& shades) {
    SplatCloud moved;
    splats.place(positions, shades, moved);
    for (size_t i = 0; i < moved.rotations.size(); i += 4) {  // q and -q are one rotation
      float along = 0;
      for (size_t k = i; k < i + 4; ++k) along += moved.rotations[k] * cloud.rotations[k];
      for (size_t k = i; k < i + 4 && along < 0; ++k) moved.rotations[k] *= -1;
    }
    return weighed(moved.positions, by.positions) + weighed(moved.rotations, by.rotations) +
           weighed(moved.scales, by.scales) + weighed(moved.sh, by.sh);
  };
  const size_t count = shape.positions.size();
  std::vector<Vec3d> by_position(count, Vec3d::Zero()), by_colour(count, Vec3d::Zero());
  splats.addGradient(shape.positions, by, 2.0, by_position, by_colour);
  // Floats of the cloud round to 1e-7 of 1, some 1e5 of them: 1e-4 of a difference over 1e-3.
  constexpr double kStep = 1e-3;
  double largest = 0;
  for (const Vec3d& each : by_position) largest = std::max(largest, each.cwiseAbs().maxCoeff());
  for (size_t v = 0; v < count; ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<Vec3d> before = shape.positions, after = shape.positions;
      before[v][axis] -= kStep;
      after[v][axis] += kStep;
      const double moved = (lossOf(after, colours) - lossOf(before, colours)) / (2 * kStep);
      EXPECT_NEAR(2.0 * moved, by_position[v][axis], 0.002 * largest) << v << "." << axis;
      before = after = colours;
      before[v][axis] -= kStep;
      after[v][axis] += kStep;
      const double shaded =
          (lossOf(shape.positions, after) - lossOf(shape.positions, before)) / (2 * kStep);
      EXPECT_NEAR(2.0 * shaded, by_colour[v][axis], 0.002 * std::abs(by_colour[v][axis]) + 0.5);
    }
  }
}

TEST(BoundSplats, CoverTheMeshAndEndWhereItEnds) {
  const AdaptShape shape = sphere(4);
  const MeshLinks links(shape.positions.size(), shape.triangles);
  SplatCloud cloud;
  BoundSplats(links, shape.positions, 3.5 / 128)
      .place(shape.positions, greys(shape.positions.size()), cloud);
  validate(cloud, "splats");
  const Camera camera = lookingFrom(Vec3d(0, -3.5, 0), 128);
  const SplatInstance instance{&cloud};
  const RenderResult drawn = renderTiled({&instance, 1}, camera, boundSplatsDrawing());
  const MeshView view =
      MeshRenderer(shape.triangles).draw(camera, shape.positions, greys(shape.positions.size()));
  double of_splats = 0, of_mesh = 0, holes = 1;
  for (size_t pixel = 0; pixel < 128 * 128; ++pixel) {
    const double alpha = static_cast<double>(drawn.colour[pixel * 4 + 3]);
    of_splats += alpha;
    of_mesh += view.pixels[pixel * 4 + 3];
    const double x = static_cast<double>(pixel % 128) - 63.5,
                 y = static_cast<double>(pixel / 128) - 63.5;
    if (x * x + y * y < 30 * 30) holes = std::min(holes, alpha);  // the outline is at 38 pixels
  }
  EXPECT_GT(holes, 0.95);
  // Areas of discs: 2.5 % is half a pixel of the radius of 38.
  EXPECT_NEAR(of_splats / of_mesh, 1.0, 0.025);
}

TEST(BoundSplats, TrianglesWithoutAreaShowNothingAndPullNowhere) {
  AdaptShape shape = tetrahedron();
  shape.positions[3] = shape.positions[2];  // two triangles are lines now
  const MeshLinks links(4, shape.triangles);
  const BoundSplats splats(links, tetrahedron().positions, 0.1);
  SplatCloud cloud;
  splats.place(shape.positions, greys(4), cloud);
  validate(cloud, "splats");
  std::vector<Vec3d> by_position(4, Vec3d::Zero()), by_colour(4, Vec3d::Zero());
  splats.addGradient(shape.positions, randomGradients(splats.count()), 1.0, by_position, by_colour);
  for (const Vec3d& by : by_position) EXPECT_TRUE(by.allFinite());
}

}  // namespace
}  // namespace stipple
