#include "io/views/pose_bounds.h"

#include <gtest/gtest.h>

#include <limits>

#include "npy_builder.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

class PoseBoundsTest : public ScratchFolder {
 protected:
  std::vector<CameraView> read(const std::string& bytes) const {
    return readPoseBounds(store("poses_bounds.npy", bytes));
  }
  std::string refusal(const std::vector<double>& row) const {
    try {
      read(npyFile(npyHeader("<f8", false, "(1, 17)"), doubles(row)));
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kFormat);
      return error.what();
    }
    return "no error";
  }
};

TEST_F(PoseBoundsTest, TurnsDownRightBackwardsIntoRightDownForward) {
  const std::vector<CameraView> views = read(poseBoundsFile(2, 1014, 1352, 730));
  ASSERT_EQ(views.size(), 2u);
  const Camera& camera = views[1].camera;
  EXPECT_EQ(camera.width, 1352u);
  EXPECT_EQ(camera.height, 1014u);
  EXPECT_EQ(camera.fx, 730);
  EXPECT_EQ(camera.fy, 730);
  EXPECT_EQ(camera.cx, 676);
  EXPECT_EQ(camera.cy, 507);
  EXPECT_TRUE(views[1].image_path.empty());
  // At (1, 0, 4), looking along -z with y up: what is at (2, 3, 0) is 1 to the right, 3 above, 4
  // ahead.
  const Vec4d seen = camera.world_to_camera * Vec4d(2, 3, 0, 1);
  EXPECT_NEAR(seen.x(), 1, 1e-12);
  EXPECT_NEAR(seen.y(), -3, 1e-12);
  EXPECT_NEAR(seen.z(), 4, 1e-12);
}

TEST_F(PoseBoundsTest, ReadsFloatsAndFortransOrder) {
  std::vector<float> columns;
  for (const double value : poseBoundsRow(0.5, 20, 30, 25)) {
    columns.push_back(static_cast<float>(value));
  }
  const auto views = read(npyFile(npyHeader("<f4", true, "(1, 17)"), floats(columns)));
  ASSERT_EQ(views.size(), 1u);
  EXPECT_EQ(views[0].camera.fx, 25);
  EXPECT_EQ(readCameraFile(folder_.string()).size(), 1u);
  EXPECT_EQ(readCameraFile(path("poses_bounds.npy")).size(), 1u);
}

TEST_F(PoseBoundsTest, RefusesOtherShapes) {
  for (const char* shape : {"(17,)", "(1, 1, 17)", "(17, 1)"}) {
    const std::string bytes =
        npyFile(npyHeader("<f8", false, shape), doubles(poseBoundsRow(0, 20, 30, 25)));
    EXPECT_THROW(read(bytes), Error) << shape;
  }
  EXPECT_THROW(read(npyFile(npyHeader("<f8", false, "(0, 17)"), "")), Error);
}

TEST_F(PoseBoundsTest, RefusesNumbersThatNoCameraHas) {
  const auto changed = [](size_t column, double value) {
    std::vector<double> row = poseBoundsRow(0, 20, 30, 25);
    row[column] = value;
    return row;
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  for (size_t column = 0; column < 17; ++column) {
    for (const double value : {nan, infinity}) {
      EXPECT_NE(refusal(changed(column, value)).find("camera 0 has the number"), std::string::npos);
    }
  }
  for (const double side : {0.0, -20.0, 20.5, 1e9}) {
    EXPECT_NE(refusal(changed(4, side)).find("camera 0 has images of 30 x"), std::string::npos);
  }
  EXPECT_NE(refusal(changed(14, 0)).find("a focal length of 0 pixels"), std::string::npos);
  EXPECT_EQ(refusal(changed(15, 0)), "no error");  // converted sets have no depths
  EXPECT_NE(refusal(changed(1, 0)).find("are no rotation"), std::string::npos);
  EXPECT_NE(refusal(changed(1, -1)).find("mirror image"), std::string::npos);
}

}  // namespace
}  // namespace stipple
