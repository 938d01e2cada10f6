// Objects in one USD layer: names, places, and splats that several of them show.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <string>
#include <vector>

#include "data/clouds/cloud_transform.h"
#include "io/splats/splat_file.h"
#include "io/usd/usd_scene_writer.h"
#include "math/covariance.h"
#include "random_cloud.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

class UsdScene : public ScratchFolder {
 protected:
  /// Three objects: two show the same splats, the third one others.
  std::vector<UsdObject> objects(const SplatCloud& shared, const SplatCloud& other) {
    const double angle = 0.5;
    Mat4d turned = Mat4d::Identity();
    turned.topLeftCorner<3, 3>() =
        2 * Eigen::AngleAxisd(angle, Vec3d(1, 2, 3).normalized()).toRotationMatrix();
    turned.topRightCorner<3, 1>() = Vec3d(10, -20, 1e-3);
    Mat4d mirrored = Mat4d::Identity();
    mirrored(1, 1) = -1;
    return {{"Tree", &shared, Mat4d::Identity()},
            {"Tree", &shared, turned},
            {"7 \"B\303\244ume\"", &other, mirrored}};
  }

  void expectPlaced(const SplatCloud& seen, size_t first, const SplatCloud& cloud,
                    const Mat4d& matrix) {
    const SplatCloud wanted = transformed(cloud, matrix);
    ASSERT_GE(seen.size(), first + wanted.size());
    for (size_t i = 0; i < wanted.positions.size(); ++i) {
      // float32 of places up to about 30.
      EXPECT_NEAR(seen.positions[first * 3 + i], wanted.positions[i], 4e-6f) << i;
    }
    // Axes may come in another order.
    for (size_t i = 0; i < wanted.size(); ++i) {
      const size_t at = first + i;
      const Mat3d a = covariance<double>(&seen.rotations[at * 4], &seen.scales[at * 3]);
      const Mat3d b = covariance<double>(&wanted.rotations[i * 4], &wanted.scales[i * 3]);
      EXPECT_LT((a - b).norm(), 1e-5 * b.norm()) << i;
    }
    for (size_t i = 0; i < wanted.sh.size(); ++i) {
      EXPECT_NEAR(seen.sh[first * wanted.shStride() + i], wanted.sh[i], 1e-5f) << i;
    }
  }

  size_t countOf(const std::string& text, const std::string& words) {
    size_t count = 0;
    for (size_t at = text.find(words); at != std::string::npos; at = text.find(words, at + 1)) {
      ++count;
    }
    return count;
  }
};

TEST_F(UsdScene, ObjectsStandWhereTheyStood) {
  const SplatCloud shared = randomCloud(50, 1, 1), other = randomCloud(20, 1, 2);
  const std::vector<UsdObject> scene = objects(shared, other);
  for (const char* name : {"a.usda", "a.usdz"}) {
    for (const Frame up : {Frame::kUnknown, Frame::kRFU}) {
      SCOPED_TRACE(std::string(name) + frameName(up));
      writeUsdScene(scene, Frame::kRFU, path(name), {.frame = up});
      SplatCloud seen = readSplatFile(path(name));
      EXPECT_EQ(seen.frame, up == Frame::kUnknown ? Frame::kRUB : Frame::kRFU);
      convertFrame(seen, Frame::kRFU);
      ASSERT_EQ(seen.size(), 120u);
      expectPlaced(seen, 0, shared, scene[0].matrix);
      expectPlaced(seen, 50, shared, scene[1].matrix);
      expectPlaced(seen, 100, other, scene[2].matrix);
    }
  }
}

TEST_F(UsdScene, SplatsThatObjectsShareAreThereOnce) {
  const SplatCloud shared = randomCloud(50, 0, 1), other = randomCloud(20, 0, 2);
  SplatCloud copy = shared;  // alike, not the same
  std::vector<UsdObject> scene = objects(shared, other);
  scene[1].cloud = &copy;
  writeUsdScene(scene, Frame::kRUB, path("a.usda"), {});
  const std::string text = load(path("a.usda"));
  EXPECT_EQ(countOf(text, "point3f[] positions"), 2u);
  EXPECT_EQ(countOf(text, "instanceable = true"), 2u);
  EXPECT_EQ(countOf(text, "</Tree_splats>"), 2u);
  copy.opacities[7] *= 0.5f;
  writeUsdScene(scene, Frame::kRUB, path("a.usda"), {});
  EXPECT_EQ(countOf(load(path("a.usda")), "point3f[] positions"), 3u);
  EXPECT_EQ(countOf(load(path("a.usda")), "instanceable"), 0u);
}

TEST_F(UsdScene, NamesArePrims) {
  const SplatCloud shared = randomCloud(5, 0, 1), other = randomCloud(5, 0, 2);
  writeUsdScene(objects(shared, other), Frame::kRUB, path("a.usda"), {});
  const std::string text = load(path("a.usda"));
  EXPECT_NE(text.find("def Xform \"Tree\" ("), std::string::npos);
  EXPECT_NE(text.find("def Xform \"Tree_1\" (\n    displayName = \"Tree\""), std::string::npos);
  EXPECT_NE(text.find("def Xform \"_7__B_ume_\" (\n    displayName = \"7 \\\"B\303\244ume\\\"\""),
            std::string::npos)
      << text.substr(0, 1500);
}

TEST_F(UsdScene, OptionsHoldForAllOfIt) {
  const SplatCloud shared = randomCloud(30, 2, 1), other = randomCloud(30, 1, 2);
  const std::vector<UsdObject> scene = objects(shared, other);
  writeUsdScene(scene, Frame::kRUB, path("a.usda"), {.half = true, .sh_degree_limit = 1});
  EXPECT_EQ(countOf(load(path("a.usda")), "quath[] orientationsh"), 2u);
  EXPECT_EQ(readSplatFile(path("a.usda")).sh_degree, 1);
  // A lower degree of one object gets zeros beside the others.
  writeUsdScene(scene, Frame::kRUB, path("a.usda"), {});
  EXPECT_EQ(readSplatFile(path("a.usda")).sh_degree, 2);
}

TEST_F(UsdScene, RefusesWhatNoSceneHolds) {
  const SplatCloud shared = randomCloud(5, 0, 1), other = randomCloud(5, 0, 2);
  const std::vector<UsdObject> scene = objects(shared, other);
  const auto refused = [&](ErrorCode code, const char* words, auto change,
                           const char* name = "a.usda") {
    std::vector<UsdObject> changed = scene;
    change(changed);
    expectError(code, {words}, [&] { writeUsdScene(changed, Frame::kRUB, path(name), {}); });
    EXPECT_EQ(fileCount(), 0u);
  };
  const auto as_it_is = [](std::vector<UsdObject>&) {};
  refused(ErrorCode::kUnsupported, "cannot hold objects", as_it_is, "a.ply");
  refused(ErrorCode::kInvalidArgument, "no objects", [](auto& them) { them.clear(); });
  refused(ErrorCode::kInvalidArgument, "singular", [](auto& them) { them[1].matrix.col(0) *= 0; });
  refused(ErrorCode::kInvalidArgument, "not affine", [](auto& them) { them[1].matrix(3, 0) = 1; });
  refused(ErrorCode::kInvalidArgument, "singular",
          [](auto& them) { them[1].matrix(0, 0) = HUGE_VAL; });
  const SplatCloud none;
  refused(ErrorCode::kUnsupported, "has no splats", [&](auto& them) { them[2].cloud = &none; });
  SplatCloud linear = other;
  linear.colour_space = ColourSpace::kLinear;
  refused(ErrorCode::kUnsupported, "colour space", [&](auto& them) { them[2].cloud = &linear; });
}

}  // namespace
}  // namespace stipple
