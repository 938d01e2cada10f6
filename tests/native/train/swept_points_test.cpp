#include "train/prior/swept_points.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "base/error.h"
#include "base/parallel.h"
#include "train/sphere_views.h"

namespace stipple {
namespace {

using namespace stipple::testing;

StartPoints sweep(const MemoryViewSource& views, uint64_t count, uint64_t seed = 0) {
  return sweptPoints(views, allViews(views), {count, seed});
}

Vec3d placeAt(const StartPoints& points, size_t i) {
  return Eigen::Map<const Vec3f>(&points.positions[i * 3]).cast<double>();
}

double shareOf(const StartPoints& points, const std::function<bool(const Vec3d&)>& holds) {
  size_t count = 0;
  for (size_t i = 0; i < points.size(); ++i) count += holds(placeAt(points, i));
  return static_cast<double>(count) / static_cast<double>(points.size());
}

// A pixel is 1/70 of 3.5 m - 1 m, neighbours look from about 40 degrees apart: an error of a pixel
// is one of 0.05 m.
TEST(SweptPoints, StandOnTheSurfaceInItsColours) {
  const auto views = sphereViews(camerasAround(24, 64), Behind::kNothing);
  const StartPoints points = sweep(*views, 2000);
  ASSERT_GT(points.size(), 1900u);
  EXPECT_GT(shareOf(points, [](const Vec3d& p) { return std::abs(p.norm() - 1) < 0.06; }), 0.8);
  // No view sees through them.
  EXPECT_EQ(shareOf(points, [](const Vec3d& p) { return p.norm() < 1.15; }), 1);
  double error = 0;
  for (size_t i = 0; i < points.size(); ++i) {
    const Vec3d colour = Eigen::Map<const Vec3f>(&points.colours[i * 3]).cast<double>();
    error += (colour - pattern(placeAt(points, i).normalized())).cwiseAbs().mean();
  }
  EXPECT_LT(error / static_cast<double>(points.size()), 0.08);
}

TEST(SweptPoints, WithoutAlphaWhatIsBehindIsFarther) {
  const StartPoints points = sweep(*sphereViews(camerasAround(24, 64), Behind::kPattern), 2000);
  ASSERT_EQ(points.size(), 2000u);
  const double near = shareOf(points, [](const Vec3d& p) { return std::abs(p.norm() - 1) < 0.1; });
  const double far = shareOf(points, [](const Vec3d& p) { return p.norm() > 5; });
  // The sphere covers 0.32 of the pictures: (1.1 tan(asin(1/3.5)))^2 pi.
  EXPECT_GT(near, 0.22);
  EXPECT_GT(far, 0.45);
  EXPECT_GT(near + far, 0.8);
}

TEST(SweptPoints, CertainOnesAreFewerAndInTheRightPlace) {
  const auto views = sphereViews(camerasAround(24, 64), Behind::kPattern);
  SweepOptions options;
  options.count = 2000;
  options.only_certain = true;
  const StartPoints points = sweptPoints(*views, allViews(*views), options);
  EXPECT_GT(points.size(), 200u);
  EXPECT_LT(points.size(), 1600u);
  const auto is_right = [](const Vec3d& p) { return std::abs(p.norm() - 1) < 0.1 || p.norm() > 5; };
  EXPECT_GT(shareOf(points, is_right), 0.93);
  EXPECT_LT(shareOf(sweep(*views, 2000), is_right), shareOf(points, is_right));
  // A blank wall tells no depth, but where the ball hides all but the farthest ones. Of all pixels
  // 0.32 show the ball.
  const auto blank = sphereViews(camerasAround(24, 64), Behind::kBlank);
  const StartPoints before = sweptPoints(*blank, allViews(*blank), options);
  EXPECT_GT(shareOf(before, [](const Vec3d& p) { return p.norm() < 1.5; }), 0.7);
}

TEST(SweptPoints, ABlankBackdropHidesNothing) {
  const StartPoints points = sweep(*sphereViews(camerasAround(24, 64), Behind::kBlank), 2000);
  ASSERT_EQ(points.size(), 2000u);
  size_t blank = 0, behind = 0;
  for (size_t i = 0; i < points.size(); ++i) {
    // The picture is kept in 16 bits.
    if (std::abs(points.colours[i * 3] - 0.4f) > 1e-5f) continue;
    if (std::abs(points.colours[i * 3 + 1] - 0.5f) > 1e-5f) continue;
    const double distance = placeAt(points, i).norm();
    ++blank;
    EXPECT_GT(distance, 1);
    // As far as another camera sees; pixels beside the ball may go with it.
    behind += distance > 1.5;
  }
  EXPECT_GT(blank, 1200u);
  EXPECT_GT(behind, blank * 9 / 10);
  EXPECT_GT(shareOf(points, [](const Vec3d& p) { return std::abs(p.norm() - 1) < 0.1; }), 0.2);
}

TEST(SweptPoints, AnEmptyPictureAndMasksProveNothing) {
  const auto whole = sphereViews(camerasAround(24, 64), Behind::kNothing);
  MemoryViewSource views(ColourSpace::kDisplay);
  for (size_t v = 0; v < 24; ++v) {
    ViewPicture picture = whole->load(v);
    const size_t pixels = picture.alpha.size();
    if (v == 3) {
      std::fill(picture.colour.begin(), picture.colour.end(), 0.0f);
      std::fill(picture.alpha.begin(), picture.alpha.end(), 0.0f);
    }
    if (v == 7) {  // its right half is hidden by a mask, and transparent by mistake
      picture.weights.assign(pixels, 1.0f);
      for (size_t i = 0; i < pixels; ++i) {
        if (i % 64 < 32) continue;
        picture.weights[i] = picture.alpha[i] = 0;
        std::fill_n(&picture.colour[i * 3], 3, 0.0f);
      }
    }
    views.add(whole->camera(v), std::move(picture));
  }
  const StartPoints points = sweep(views, 1000);
  EXPECT_GT(points.size(), 900u);
  EXPECT_GT(shareOf(points, [](const Vec3d& p) { return std::abs(p.norm() - 1) < 0.06; }), 0.75);
}

TEST(SweptPoints, SilhouettesThatContradictEachOtherLeaveNothing) {
  MemoryViewSource views(ColourSpace::kDisplay);
  const auto whole = sphereViews(camerasAround(8, 32), Behind::kNothing);
  for (size_t v = 0; v < 8; ++v) {
    // Every picture shows one other side of an object that is nowhere.
    ViewPicture picture = whole->load(v);
    for (size_t i = 0; i < picture.alpha.size(); ++i) {
      const bool is_shown = i % 32 < 4 && (i / 128) % 8 == v;
      picture.alpha[i] = is_shown ? 1.0f : 0.0f;
      std::fill_n(&picture.colour[i * 3], 3, is_shown ? 0.5f : 0.0f);
    }
    views.add(whole->camera(v), std::move(picture));
  }
  EXPECT_LT(sweep(views, 400).size(), 100u);
}

TEST(SweptPoints, DependOnTheSeedAndNotOnThreads) {
  const auto views = sphereViews(camerasAround(12, 32), Behind::kPattern);
  const StartPoints points = sweep(*views, 5000);
  for (const unsigned threads : {1u, 2u}) {
    withThreads(threads, [&] { EXPECT_EQ(sweep(*views, 5000).positions, points.positions); });
  }
  EXPECT_NE(sweep(*views, 5000, 1).positions, points.positions);
}

TEST(SweptPoints, AViewAloneHasAnyDepth) {
  const auto views = sphereViews(camerasAround(1, 32), Behind::kNothing);
  const StartPoints points = sweep(*views, 300);
  EXPECT_EQ(points.size(), 300u);
  // Nothing is known of its distance: one metre will do, and what is around it.
  const Vec3d from = placeOf(views->camera(0));
  for (const double least : {0.0, 0.7, 1.0, 1.3}) {
    EXPECT_GT(shareOf(points, [&](const Vec3d& p) { return (p - from).norm() > least; }), 0.05);
  }
  EXPECT_LT(shareOf(points, [&](const Vec3d& p) { return (p - from).norm() > 1; }), 0.8);
}

TEST(SweptPoints, CanBeCancelled) {
  const auto views = sphereViews(camerasAround(4, 16), Behind::kNothing);
  Progress progress;
  progress.cancel();
  EXPECT_THROW(sweptPoints(*views, allViews(*views), {10}, &progress), Error);
}

}  // namespace
}  // namespace stipple
