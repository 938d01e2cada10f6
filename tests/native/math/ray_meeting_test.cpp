#include "math/ray_meeting.h"

#include <gtest/gtest.h>

#include <vector>

namespace stipple {
namespace {

TEST(NearestToLines, IsWhereTheyMeet) {
  const Vec3d meeting(1, -2, 3);
  std::vector<Line> lines;
  for (const Vec3d& direction : {Vec3d(1, 0, 0), Vec3d(0, 0.6, 0.8), Vec3d(0.6, 0, -0.8)}) {
    lines.push_back({meeting - 4 * direction, direction});
  }
  EXPECT_LT((*nearestToLines(lines) - meeting).norm(), 1e-12);
  // Of two that pass by each other, in the middle between both.
  lines = {{{0, 0, 0}, {1, 0, 0}}, {{5, 0, 2}, {0, 1, 0}}};
  EXPECT_LT((*nearestToLines(lines) - Vec3d(5, 0, 1)).norm(), 1e-12);
}

TEST(NearestToLines, ParallelOnesHaveNone) {
  const Vec3d direction = Vec3d(1, 2, 2) / 3;
  const std::vector<Line> lines = {{{0, 0, 0}, direction}, {{1, 0, 0}, direction}};
  EXPECT_FALSE(nearestToLines(lines));
  EXPECT_FALSE(nearestToLines(std::vector<Line>(1)));
}

}  // namespace
}  // namespace stipple
