#include "fit/registration/registration.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "mesh/adapt_meshes.h"

namespace stipple {
namespace {

/// A sphere that is drawn out to half-axes 1.2, 0.8 and 0.6, with a narrow spike.
AdaptShape spikedEgg(int splits) {
  AdaptShape shape = sphere(splits);
  for (Vec3d& p : shape.positions) {
    const double away = (p - Vec3d(0.6, 0.8, 0)).squaredNorm();
    p *= 1 + 0.3 * std::exp(-away / 0.02);
    p = Vec3d(1.2 * p[0], 0.8 * p[1], 0.6 * p[2]);
  }
  return shape;
}

RegistrationOptions quick() {
  RegistrationOptions options;
  options.adapter.steps = 120;
  options.target_count = 3000;
  options.report_count = 5000;
  return options;
}

RegistrationTarget eggTarget() {
  return targetOfMesh(meshOf(spikedEgg(4)), 3000, 7);
}

std::string messageOf(const TriMesh& mesh, const RegistrationTarget& target,
                      const RegistrationOptions& options) {
  try {
    registerMesh(mesh, target, options);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    return error.what();
  }
  return "";
}

double uneven(uint64_t index) {
  return 2 * unitDouble(keyedBits(11, RandomUse::kThinning, index)) - 1;
}

TEST(RegistrationLoss, HasTheDerivativesOfItsFiniteDifferences) {
  const AdaptShape shape = sphere(2);
  RegistrationTarget target = targetOfMesh(meshOf(spikedEgg(3)), 200, 1);
  for (size_t i = 0; i < target.size(); ++i) {
    target.weights.push_back(static_cast<float>(1 + 0.5 * uneven(i)));
    // Some have no normal, some are unsure of theirs, some look the other way.
    const float length = i % 5 == 0 ? 0.0f : i % 5 == 1 ? 0.4f : i % 5 == 2 ? -1.0f : 1.0f;
    for (size_t axis = 0; axis < 3; ++axis) target.normals[i * 3 + axis] *= length;
  }
  const std::vector<Landmark> landmarks = {{3, {0, -1, 0.2}}, {7, {0.5, 0.5, 0.5}}};
  RegistrationWeights weights{1.0, 0.7, 0.5, 0.3};
  for (const bool is_oriented : {true, false}) {
    target.is_oriented = is_oriented;
    const RegistrationLoss loss(target, landmarks, weights, 4);
    const RegistrationMatches matches = loss.match(shape.triangles, shape.positions, 5);
    EXPECT_EQ(matches.samples.size(), 200u);
    std::vector<Vec3d> gradient(shape.positions.size(), Vec3d::Zero());
    const double value = loss.addGradient(shape.triangles, shape.positions, matches, gradient);
    EXPECT_GT(value, 0);
    std::vector<Vec3d> moved = shape.positions, unused(moved.size(), Vec3d::Zero());
    // As of the energies: the error is some 1e-9 of the largest derivative.
    constexpr double kEps = 1e-5;
    double largest = 0;
    for (const Vec3d& g : gradient) largest = std::max(largest, g.norm());
    for (size_t v = 0; v < moved.size(); ++v) {
      for (int axis = 0; axis < 3; ++axis) {
        moved[v][axis] = shape.positions[v][axis] + kEps;
        const double above = loss.addGradient(shape.triangles, moved, matches, unused);
        moved[v][axis] = shape.positions[v][axis] - kEps;
        const double below = loss.addGradient(shape.triangles, moved, matches, unused);
        moved[v][axis] = shape.positions[v][axis];
        EXPECT_NEAR(gradient[v][axis], (above - below) / (2 * kEps), 1e-6 * largest);
      }
    }
  }
}

TEST(Registration, TakesTheShapeAndKeepsTheFaces) {
  TriMesh given = meshOf(sphere(4));
  given.corner_uvs.assign(given.triangles.size() * 2, 0.25f);
  const RegisteredMesh made = registerMesh(given, eggTarget(), quick());
  EXPECT_EQ(made.mesh.triangles, given.triangles);
  EXPECT_EQ(made.mesh.corner_uvs, given.corner_uvs);
  EXPECT_EQ(made.mesh.vertexCount(), given.vertexCount());
  ASSERT_TRUE(made.report.is_measured && made.report.after.has_normals);
  EXPECT_GT(made.report.before.distance, 0.15);
  EXPECT_LT(made.report.after.distance, 0.02);
  EXPECT_LT(made.report.after.normals, 0.3 * made.report.before.normals);
  EXPECT_FALSE(made.report.turned_normals);
}

TEST(Registration, GivesTheSameShapeForAnyNumberOfThreads) {
  RegistrationOptions options = quick();
  options.adapter.steps = 20;
  options.weights.symmetric = 0.5;
  std::vector<float> first;
  for (const unsigned threads : {1u, 2u, 5u}) {
    withThreads(threads, [&] {
      const RegisteredMesh made = registerMesh(meshOf(sphere(4)), eggTarget(), options);
      if (first.empty()) first = made.mesh.positions;
      EXPECT_EQ(made.mesh.positions, first);
    });
  }
}

TEST(Registration, DoesNotDependOnTheUnitOfTheScene) {
  RegistrationOptions options = quick();
  options.adapter.steps = 40;
  const RegisteredMesh metres = registerMesh(meshOf(sphere(3)), eggTarget(), options);
  // Powers of two lose no bits.
  constexpr float kUnit = 1024;
  TriMesh given = meshOf(sphere(3));
  RegistrationTarget target = eggTarget();
  for (float& value : given.positions) value *= kUnit;
  for (float& value : target.points) value *= kUnit;
  for (float& value : target.positions) value *= kUnit;
  const RegisteredMesh other = registerMesh(given, target, options);
  for (size_t i = 0; i < given.positions.size(); ++i) {
    EXPECT_EQ(other.mesh.positions[i], kUnit * metres.mesh.positions[i]);
  }
  EXPECT_NEAR(other.report.after.distance, 1024 * metres.report.after.distance, 1e-3);
}

TEST(Registration, MovesSeamsAsOneAndLeavesLooseVertices) {
  // Every triangle with vertices of its own, in front a loose one.
  const AdaptShape shape = sphere(3);
  const TriMesh whole = meshOf(shape);
  TriMesh split;
  split.materials.resize(1);
  split.positions = {5, 6, 7};
  for (const uint32_t vertex : whole.triangles) {
    split.triangles.push_back(static_cast<uint32_t>(split.vertexCount()));
    for (size_t axis = 0; axis < 3; ++axis) {
      split.positions.push_back(whole.positions[vertex * size_t{3} + axis]);
    }
  }
  const RegisteredMesh made = registerMesh(split, eggTarget(), quick());
  EXPECT_EQ(made.report.place_count, shape.positions.size());
  EXPECT_EQ(made.report.loose_count, 1u);
  for (size_t axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(made.mesh.positions[axis], split.positions[axis], 1e-5);
  }
  EXPECT_LT(made.report.after.distance, 0.03);
  std::vector<std::vector<float>> places(shape.positions.size());
  for (size_t corner = 0; corner < whole.triangles.size(); ++corner) {
    const float* p = &made.mesh.positions[size_t{split.triangles[corner]} * 3];
    std::vector<float>& place = places[whole.triangles[corner]];
    if (place.empty()) place.assign(p, p + 3);
    EXPECT_EQ(place, std::vector<float>(p, p + 3));
  }
}

TEST(Registration, TakesATargetThatIsInsideOutTheOtherWayRound) {
  RegistrationTarget target = eggTarget();
  for (float& value : target.normals) value = -value;
  const RegisteredMesh turned = registerMesh(meshOf(sphere(3)), target, quick());
  EXPECT_TRUE(turned.report.turned_normals);
  const RegisteredMesh usual = registerMesh(meshOf(sphere(3)), eggTarget(), quick());
  EXPECT_EQ(turned.mesh.positions, usual.mesh.positions);
}

TEST(Registration, TakesTheShapeOfSplatsAndOfPointsWithoutNormals) {
  const RegistrationTarget surface = eggTarget();
  SplatCloud cloud;
  cloud.resize(surface.size());
  for (size_t i = 0; i < surface.size(); ++i) {
    const Vec3d z = Eigen::Map<const Vec3f>(&surface.normals[i * 3]).cast<double>();
    // The half-way quaternion from z to the normal.
    Vec4d turn(1 + z[2], -z[1], z[0], 0);
    if (turn.norm() < 1e-6) turn = Vec4d(0, 1, 0, 0);
    turn.normalize();
    for (size_t axis = 0; axis < 3; ++axis) {
      cloud.positions[i * 3 + axis] = surface.points[i * 3 + axis];
      cloud.scales[i * 3 + axis] = axis == 2 ? 1e-4f : 0.02f;
    }
    for (size_t k = 0; k < 4; ++k) {
      cloud.rotations[i * 4 + k] = static_cast<float>(turn[static_cast<Eigen::Index>(k)]);
    }
    // Every tenth lies far off and is not seen.
    cloud.opacities[i] = i % 10 == 0 ? 0.0f : 0.9f;
    if (i % 10 == 0) cloud.positions[i * 3] += 50;
  }
  const RegistrationTarget splats = targetOfSplats(cloud, 3000);
  EXPECT_EQ(splats.size(), 2700u);
  const RegisteredMesh on_splats = registerMesh(meshOf(sphere(4)), splats, quick());
  EXPECT_LT(on_splats.report.after.distance, 0.03);
  EXPECT_LT(on_splats.report.after.normals, 0.1);

  const RegistrationTarget points = targetOfPoints(surface.points, {}, 2000);
  EXPECT_EQ(points.size(), 2000u);
  const RegisteredMesh on_points = registerMesh(meshOf(sphere(4)), points, quick());
  EXPECT_LT(on_points.report.after.distance, 0.04);
  EXPECT_FALSE(on_points.report.after.has_normals);
}

TEST(Registration, PutsLandmarksWhereTheyBelong) {
  RegistrationOptions options = quick();
  // On the side of the egg that is a quarter turn away from where vertex 0 would go.
  options.landmarks = {{0, {0, 0.8, 0}}};
  options.weights.landmark = 0;
  const auto missOf = [&] {
    const RegisteredMesh made = registerMesh(meshOf(sphere(3)), eggTarget(), options);
    return (Eigen::Map<const Vec3f>(made.mesh.positions.data()).cast<double>() -
            options.landmarks[0].place)
        .norm();
  };
  EXPECT_GT(missOf(), 0.5);
  options.weights.landmark = 10;
  // The other points go on pulling the other way.
  EXPECT_LT(missOf(), 0.2);
}

TEST(Registration, StopsWhenCancelled) {
  Progress progress;
  progress.cancel();
  try {
    registerMesh(meshOf(sphere(3)), eggTarget(), quick(), &progress);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCancelled);
  }
}

TEST(Registration, StaysFiniteWithFacesWithoutAreaAndFins) {
  AdaptShape shape = sphere(3);
  for (size_t corner = 1; corner < 3; ++corner) {
    shape.positions[shape.triangles[corner]] =
        shape.positions[shape.triangles[0]] + Vec3d(1e-7 * double(corner), 0, 0);
  }
  shape.positions.emplace_back(0, 0, 2);
  shape.triangles.insert(shape.triangles.end(),
                         {shape.triangles[30], shape.triangles[31],
                          static_cast<uint32_t>(shape.positions.size() - 1)});
  const RegisteredMesh made = registerMesh(meshOf(shape), eggTarget(), quick());
  for (const float value : made.mesh.positions) EXPECT_TRUE(std::isfinite(value));
  EXPECT_LT(made.report.after.distance, 0.06);
}

TEST(Registration, RefusesWhatItCannotUse) {
  const TriMesh given = meshOf(sphere(2));
  const RegistrationTarget target = eggTarget();
  TriMesh one = meshOf(sphere(0));
  one.triangles.resize(3);
  EXPECT_EQ(messageOf(one, target, quick()),
            "the template has 1 triangles with three corners in different places; at least 4 are "
            "needed");
  EXPECT_EQ(messageOf(given, {}, quick()), "the target has 0 points; at least one is needed");
  RegistrationTarget still;
  still.points = {3, 3, 3, 3, 3, 3};
  EXPECT_EQ(messageOf(given, still, quick()),
            "the target has no extent: its 2 points lie in one place");
  RegistrationOptions options = quick();
  options.landmarks = {{999, Vec3d::Zero()}};
  EXPECT_EQ(messageOf(given, target, options),
            "landmark 0 is vertex 999 of the template, which has 66 vertices");
  TriMesh loose = given;
  loose.positions.insert(loose.positions.end(), {9, 9, 9});
  options.landmarks[0].vertex = 66;
  EXPECT_EQ(messageOf(loose, target, options),
            "landmark 0 is vertex 66 of the template, which no triangle uses");
  TriMesh broken = given;
  broken.positions[4] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_NE(messageOf(broken, target, quick()), "");
  options = quick();
  options.target_count = 0;
  EXPECT_EQ(messageOf(given, target, options),
            "number of points of the target is 0; 1 to 16777216 is allowed");
  SplatCloud unseen;
  unseen.resize(2);
  unseen.rotations = {1, 0, 0, 0, 1, 0, 0, 0};
  EXPECT_THROW(targetOfSplats(unseen, 10), Error);
  const std::vector<float> bad = {0, std::numeric_limits<float>::infinity(), 0};
  EXPECT_THROW(targetOfPoints(bad, {}, 10), Error);
  EXPECT_THROW(targetOfPoints({}, {}, 10), Error);
}

TEST(Registration, HasABoundOfItsMemoryThatGrowsWithItsParts) {
  RegistrationOptions options;
  const TriMesh small = meshOf(sphere(2));
  const uint64_t of_points = registrationMemoryBound(small, {}, options);
  EXPECT_GT(of_points, options.target_count * 500);
  EXPECT_GT(registrationMemoryBound(meshOf(sphere(4)), {}, options), of_points);
  TargetSource source;
  source.mesh = std::make_shared<const TriMesh>(meshOf(sphere(4)));
  EXPECT_GT(registrationMemoryBound(small, source, options), of_points);
}

TEST(PreAlignment, FindsTurnScaleAndPlace) {
  const AdaptShape egg = spikedEgg(3);
  // A turn of 25 degrees about an axis, half the size, elsewhere.
  const double half = 0.5 * 25 * 3.14159265358979 / 180;
  const Vec3d axis = Vec3d(1, 2, 2) / 3;
  const double x = axis[0] * std::sin(half), y = axis[1] * std::sin(half),
               z = axis[2] * std::sin(half), w = std::cos(half);
  Mat3d turn;
  turn << 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),  //
      2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),      //
      2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y);
  for (const PreAlignment alignment : {PreAlignment::kRigid, PreAlignment::kSimilarity}) {
    const double scale = alignment == PreAlignment::kRigid ? 1.0 : 0.5;
    AdaptShape moved = egg;
    for (Vec3d& p : moved.positions) p = scale * (turn * p) + Vec3d(3, -1, 0.5);
    RegistrationOptions options = quick();
    options.alignment = alignment;
    options.adapter.steps = 1;
    options.adapter.step_size = 1e-6;
    const RegisteredMesh made =
        registerMesh(meshOf(moved), targetOfMesh(meshOf(egg), 5000, 3), options);
    for (size_t v = 0; v < egg.positions.size(); ++v) {
      for (int k = 0; k < 3; ++k) {
        // Samples of both sides lie some 0.03 apart, and their means are off by a share of that.
        EXPECT_NEAR(static_cast<double>(made.mesh.positions[v * 3 + static_cast<size_t>(k)]),
                    egg.positions[v][k], 0.03);
      }
    }
  }
}

TEST(PreAlignment, SolvesPairsExactlyAndNeverMirrors) {
  std::vector<Vec3d> from, to;
  Mat3d turn;
  turn << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  for (uint64_t i = 0; i < 10; ++i) {
    from.emplace_back(uneven(3 * i), uneven(3 * i + 1), uneven(3 * i + 2));
    to.push_back(2.5 * (turn * from.back()) + Vec3d(1, 2, 3));
  }
  const std::vector<double> weights(10, 1.0);
  const Similarity found = similarityOf(from, to, weights, true);
  EXPECT_NEAR(found.scale, 2.5, 1e-12);
  EXPECT_LT((found.turn - turn).norm(), 1e-8);
  for (Vec3d& p : to) p[0] = -p[0];
  const Mat3d best = similarityOf(from, to, weights, true).turn;
  const double determinant = best(0, 0) * (best(1, 1) * best(2, 2) - best(1, 2) * best(2, 1)) -
                             best(0, 1) * (best(1, 0) * best(2, 2) - best(1, 2) * best(2, 0)) +
                             best(0, 2) * (best(1, 0) * best(2, 1) - best(1, 1) * best(2, 0));
  EXPECT_NEAR(determinant, 1, 1e-9);
  // One point thrice: nothing is known of the turn.
  const std::vector<Vec3d> same(3, Vec3d(1, 1, 1));
  const Similarity none = similarityOf(same, same, std::vector<double>(3, 1.0), true);
  EXPECT_LT((none.turn - Mat3d::Identity()).norm() + std::abs(none.scale - 1), 1e-12);
}

}  // namespace
}  // namespace stipple
