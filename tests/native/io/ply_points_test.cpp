#include "io/views/ply_points.h"

#include <gtest/gtest.h>

#include <string>

#include "math/colour.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

class PlyPoints : public ScratchFolder {
 protected:
  /// A file of one point whose red is a float.
  std::string file(const std::string& red) const {
    return store("points.ply",
                 "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
                 "property float z\nproperty float red\nproperty uchar green\nproperty uchar blue\n"
                 "end_header\n1 2 3 " +
                     red + " 255 0\n");
  }
};

TEST_F(PlyPoints, AreSceneLinear) {
  const PointSet points = readPlyPoints(file("0.5"));
  ASSERT_EQ(points.colours.size(), 3u);
  EXPECT_FLOAT_EQ(points.colours[0], srgbToLinear(0.5f));
  EXPECT_FLOAT_EQ(points.colours[1], 1.0f);
  EXPECT_EQ(points.colours[2], 0.0f);
}

/// Finite as it is stored; its light is beyond float32.
TEST_F(PlyPoints, RefuseColoursWhoseLightIsNotFinite) {
  for (const char* red : {"1e30", "inf", "nan"}) {
    expectError(ErrorCode::kFormat, {"points.ply", "colour of vertex 0"},
                [&] { readPlyPoints(file(red)); });
  }
}

TEST_F(PlyPoints, KnowWhenTheyWereSeen) {
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n"
      "property float z\nproperty double time\nend_header\n";
  const PointSet points = readPlyPoints(store("timed.ply", header + "1 2 3 0.25\n4 5 6 -2\n"));
  EXPECT_EQ(points.times, (std::vector<double>{0.25, -2}));
  EXPECT_EQ(points.positions, (std::vector<float>{1, 2, 3, 4, 5, 6}));
  EXPECT_TRUE(readPlyPoints(file("0.5")).times.empty());
  expectError(ErrorCode::kFormat, {"timed.ply", "time of vertex 1"},
              [&] { readPlyPoints(store("timed.ply", header + "1 2 3 0.25\n4 5 6 nan\n")); });
}

}  // namespace
}  // namespace stipple
