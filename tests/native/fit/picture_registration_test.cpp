#include "fit/registration/picture_registration.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "fit/mesh_images.h"
#include "fit/registration/picture_loss.h"
#include "mesh/adapt_meshes.h"
#include "train/backend/backend_factory.h"

namespace stipple {
namespace {

/// An egg with a spike.
AdaptShape spiked() {
  AdaptShape shape = sphere(4);
  for (Vec3d& p : shape.positions) {
    const double away = (p - Vec3d(0.6, 0.8, 0)).squaredNorm();
    p *= 1 + 0.4 * std::exp(-away / 0.04);
    p = Vec3d(1.2 * p[0], 0.8 * p[1], 0.7 * p[2]) + Vec3d(0.1, -0.2, 0.05);
  }
  return shape;
}

RegistrationOptions quick() {
  RegistrationOptions options;
  options.adapter.steps = 160;
  options.adapter.step_size = 0.02;
  return options;
}

double distanceBetween(const TriMesh& mesh, const AdaptShape& shape) {
  const RegistrationTarget one = targetOfMesh(mesh, 4000, 1),
                           other = targetOfMesh(meshOf(shape), 4000, 2);
  return surfaceDifference({one.points, one.normals, one.positions, one.triangles},
                           {other.points, other.normals, other.positions, other.triangles})
      .distance;
}

TEST(PictureLoss, HasTheDerivativesOfItsFiniteDifferences) {
  const AdaptShape target = spiked(), shape = sphere(2);
  const MeshLinks links(shape.positions.size(), shape.triangles);
  PictureLoss loss(targetPictures(imagesOf(target.positions, target.triangles, 5, 32), 32, nullptr),
                   links);
  std::vector<Vec3d> gradient(shape.positions.size(), Vec3d::Zero()), unknown = gradient;
  loss.addGradient(shape.positions, 1.0, unknown);  // finds the light, which serves ten steps
  PictureLoss(loss).addGradient(shape.positions, 1.0, gradient);
  const auto lossOf = [&](const std::vector<Vec3d>& positions) {
    std::vector<Vec3d> unused(positions.size(), Vec3d::Zero());
    return PictureLoss(loss).addGradient(positions, 1.0, unused);  // a copy keeps its light
  };
  constexpr double kStep = 1e-7;
  double largest = 0;
  for (const Vec3d& each : gradient) largest = std::max(largest, each.cwiseAbs().maxCoeff());
  size_t apart = 0;
  for (size_t v = 0; v < shape.positions.size(); ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<Vec3d> before = shape.positions, after = shape.positions;
      before[v][axis] -= kStep;
      after[v][axis] += kStep;
      const double difference = (lossOf(after) - lossOf(before)) / (2 * kStep);
      if (std::abs(difference - gradient[v][axis]) > 1e-4 * largest) ++apart;
    }
  }
  // Of 198 numbers a few have a pixel whose difference, or whose triangle, changes in between.
  EXPECT_LE(apart, 4u);
  EXPECT_GT(largest, 0.002);
}

TEST(PictureLoss, SplatsHaveDerivativesThatSumUpToWhatTheLossChangesBy) {
  const AdaptShape target = spiked(), shape = sphere(2);
  const MeshLinks links(shape.positions.size(), shape.triangles);
  PictureLoss loss(targetPictures(imagesOf(target.positions, target.triangles, 5, 32), 32, nullptr),
                   links);
  loss.drawSplats(*cpuBackends(), shape.positions);
  std::vector<Vec3d> unused(shape.positions.size(), Vec3d::Zero());
  loss.addGradient(shape.positions, 1.0, unused);  // finds the light, which serves ten steps
  // Each splat ends at an alpha of 1/255, where its image jumps by as much; derivatives know
  // nothing of that. So ways are compared, along which many pixels are passed, not single places.
  constexpr int kPlaces = 64;
  constexpr double kWay = 0.1;
  const auto towards = [](int which, const Vec3d& p) {
    return which == 0 ? p : which == 1 ? Vec3d(0, 1, 0) : Vec3d(std::sin(5 * p[1]) * p);
  };
  for (int which = 0; which < 3; ++which) {
    double sum = 0, first = 0, last = 0;
    for (int place = 0; place <= kPlaces; ++place) {
      std::vector<Vec3d> moved = shape.positions, gradient(moved.size(), Vec3d::Zero());
      for (Vec3d& p : moved) p += kWay * place / kPlaces * towards(which, p);
      last = PictureLoss(loss).addGradient(moved, 1.0, gradient);
      if (place == 0) first = last;
      double slope = 0;
      for (size_t v = 0; v < moved.size(); ++v) {
        slope += gradient[v].dot(towards(which, shape.positions[v]));
      }
      sum += (place == 0 || place == kPlaces ? 0.5 : 1.0) * slope * kWay / kPlaces;
    }
    // The rims of splats are 4 % of what they cover.
    EXPECT_NEAR(sum, last - first, 0.1 * std::abs(last - first)) << which;
    EXPECT_GT(std::abs(last - first), 2e-4) << which;
  }
}

TEST(PictureRegistration, ASphereTakesTheShapeThatImagesShow) {
  const AdaptShape target = spiked();
  AdaptShape start = sphere(3);
  for (Vec3d& p : start.positions) p = 0.3 * p + Vec3d(2, 0, 0);  // elsewhere, and small
  const TriMesh given = meshOf(start);
  RegistrationOptions options = quick();
  options.alignment = PreAlignment::kSize;
  const MemoryViewSource views = imagesOf(target.positions, target.triangles, 10, 64);
  const RegisteredMesh made = registerToPictures(given, views, options, *cpuBackends());
  EXPECT_EQ(made.mesh.triangles, given.triangles);
  EXPECT_LT(made.report.picture_after, 0.1 * made.report.picture_before);
  // Pixels are 0.055 wide where the shape is; a ball of its size is 0.13 away.
  EXPECT_LT(distanceBetween(made.mesh, target), 0.02);
  RegisteredMesh alone;
  withThreads(1, [&] { alone = registerToPictures(given, views, options, *cpuBackends()); });
  EXPECT_EQ(alone.mesh.positions, made.mesh.positions);
  options.picture_drawing = PictureDrawing::kSplats;
  const RegisteredMesh by_splats = registerToPictures(given, views, options, *cpuBackends());
  EXPECT_LT(distanceBetween(by_splats.mesh, target), 0.04);  // outlines are as soft as splats
  withThreads(1, [&] { alone = registerToPictures(given, views, options, *cpuBackends()); });
  EXPECT_EQ(alone.mesh.positions, by_splats.mesh.positions);
}

TEST(PictureRegistration, RefusesWhatImagesDoNotSay) {
  const TriMesh given = meshOf(sphere(1));
  const AdaptShape target = sphere(2);
  const auto messageOf = [&](const ViewSource& views, const RegistrationOptions& options) {
    try {
      registerToPictures(given, views, options, *cpuBackends());
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
      return std::string(error.what());
    }
    return std::string();
  };
  const MemoryViewSource views = imagesOf(target.positions, target.triangles, 4, 16);
  EXPECT_EQ(messageOf(views, quick()), "");
  EXPECT_NE(messageOf(imagesOf(target.positions, target.triangles, 4, 16, false), quick())
                .find("neither alpha nor a mask"),
            std::string::npos);
  EXPECT_NE(
      messageOf(imagesOf(target.positions, target.triangles, 1, 16), quick()).find("at least two"),
      std::string::npos);
  RegistrationOptions options = quick();
  options.landmarks = {{0, Vec3d::Zero()}};
  EXPECT_NE(messageOf(views, options).find("landmarks"), std::string::npos);
  options = quick();
  options.alignment = PreAlignment::kRigid;
  EXPECT_NE(messageOf(views, options).find("by size"), std::string::npos);
  MemoryViewSource same(ColourSpace::kLinear);
  for (int i = 0; i < 2; ++i) same.add(views.camera(0), views.load(0));
  EXPECT_NE(messageOf(same, quick()).find("the same way"), std::string::npos);
  MemoryViewSource empty(ColourSpace::kLinear);
  for (size_t i = 0; i < 4; ++i) {
    ViewPicture picture = views.load(i);
    std::fill(picture.alpha.begin(), picture.alpha.end(), 0.0f);
    std::fill(picture.colour.begin(), picture.colour.end(), 0.0f);
    empty.add(views.camera(i), picture);
  }
  EXPECT_NE(messageOf(empty, quick()).find("empty"), std::string::npos);
}

}  // namespace
}  // namespace stipple
