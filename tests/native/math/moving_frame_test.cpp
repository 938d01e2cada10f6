#include "math/moving_frame.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "math/affine.h"

namespace stipple {
namespace {

Mat4d turned(double angle, double scale, double x) {
  Mat4d matrix = Mat4d::Identity();
  matrix.topLeftCorner<2, 2>() << std::cos(angle), -std::sin(angle), std::sin(angle),
      std::cos(angle);
  matrix.topLeftCorner<3, 3>() *= scale;
  matrix(0, 3) = x;
  return matrix;
}

TEST(MovingFrame, IsTheGivenMatrixAtEveryStep) {
  const std::vector<Mat4d> steps = {turned(0.1, 1, 0), turned(2.0, 3, 1), turned(2.0, 3, 1),
                                    turned(-1.0, 0.2, 5)};
  const MovingFrame frame(steps);
  for (size_t i = 0; i < steps.size(); ++i) {
    EXPECT_EQ(frame.at(static_cast<double>(i) / 3), steps[i]) << i;
  }
  EXPECT_EQ(frame.at(0.5), steps[1]);  // between two that are equal
  EXPECT_EQ(frame.at(-1), steps[0]);
  EXPECT_EQ(frame.at(2), steps[3]);
  EXPECT_EQ(MovingFrame(std::vector<Mat4d>{steps[1]}).at(0.7), steps[1]);
}

TEST(MovingFrame, TurnsEvenlyAndScalesStraight) {
  const MovingFrame frame(std::vector<Mat4d>{turned(0.2, 1, 0), turned(2.2, 2, 4)});
  for (const double time : {0.25, 0.5, 0.9}) {
    const Mat4d expected = turned(0.2 + 2 * time, 1 + time, 4 * time);
    EXPECT_LT((frame.at(time) - expected).cwiseAbs().maxCoeff(), 1e-14) << time;
  }
  // The short way: from 170 to 190 degrees through 180.
  const MovingFrame over(
      std::vector<Mat4d>{turned(170 * M_PI / 180, 1, 0), turned(190 * M_PI / 180, 1, 0)});
  EXPECT_LT((over.at(0.5) - turned(M_PI, 1, 0)).cwiseAbs().maxCoeff(), 1e-14);
}

TEST(MovingFrame, KeepsMirrorsAndShears) {
  Mat4d mirrored = turned(0.3, 1, 0);
  mirrored.col(2) = -mirrored.col(2);
  mirrored(0, 1) += 0.4;
  Mat4d later = turned(1.0, 1, 1);
  later.topLeftCorner<3, 3>() = later.topLeftCorner<3, 3>() *
                                turned(-0.3, 1, 0).topLeftCorner<3, 3>() *
                                mirrored.topLeftCorner<3, 3>();
  const MovingFrame frame(std::vector<Mat4d>{mirrored, later});
  for (const double time : {0.1, 0.5, 0.8}) {
    // Turned by 0.7 radians in all: the same mirror and shear at every moment.
    Mat4d expected = mirrored;
    expected.topLeftCorner<3, 3>() =
        turned(0.7 * time, 1, 0).topLeftCorner<3, 3>() * mirrored.topLeftCorner<3, 3>();
    expected(0, 3) = time;
    EXPECT_LT((frame.at(time) - expected).cwiseAbs().maxCoeff(), 1e-13) << time;
    EXPECT_LT(determinant(linearPart(frame.at(time))), 0);
  }
}

}  // namespace
}  // namespace stipple
