#include "mesh/adapt/unfold.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace stipple {
namespace {

constexpr uint32_t kSide = 9;  ///< vertices along each side of a flat grid

std::vector<uint32_t> gridTriangles() {
  std::vector<uint32_t> triangles;
  for (uint32_t y = 0; y + 1 < kSide; ++y) {
    for (uint32_t x = 0; x + 1 < kSide; ++x) {
      const uint32_t a = y * kSide + x, b = a + 1, c = a + kSide, d = c + 1;
      triangles.insert(triangles.end(), {a, b, d, a, d, c});
    }
  }
  return triangles;
}

std::vector<Vec3d> gridPlaces() {
  std::vector<Vec3d> places;
  for (uint32_t y = 0; y < kSide; ++y) {
    for (uint32_t x = 0; x < kSide; ++x) places.emplace_back(x, y, 0.1 * std::sin(x) * y);
  }
  return places;
}

TEST(Unfold, AVertexThatWentOverItsNeighboursComesBack) {
  const MeshLinks links(kSide * kSide, gridTriangles());
  std::vector<Vec3d> places = gridPlaces();
  const std::vector<Vec3d> flat = places;
  const uint32_t strayed = 4 * kSide + 4;
  places[strayed] += Vec3d(2.6, 0.4, 0);
  ASSERT_FALSE(foldedTriangles(links, places).empty());
  EXPECT_GT(unfold(links, places), 0u);
  EXPECT_TRUE(foldedTriangles(links, places).empty());
  for (size_t v = 0; v < places.size(); ++v) {
    EXPECT_LT((places[v] - flat[v]).norm(), v == strayed ? 0.5 : 1.3) << v;
  }
}

TEST(Unfold, WhatIsNotFoldedStaysBitForBit) {
  const MeshLinks links(kSide * kSide, gridTriangles());
  std::vector<Vec3d> places = gridPlaces();
  const std::vector<Vec3d> before = places;
  EXPECT_EQ(unfold(links, places), 0u);
  EXPECT_EQ(places, before);
}

TEST(Unfold, BordersStayAndWhatCannotBeHelpedIsNoWorse) {
  const MeshLinks links(kSide * kSide, gridTriangles());
  std::vector<Vec3d> places = gridPlaces();
  places[3] += Vec3d(0, 3.3, 0);  // at the border, across three rows
  const std::vector<Vec3d> before = places;
  const size_t folded = foldedTriangles(links, places).size();
  ASSERT_GT(folded, 0u);
  EXPECT_EQ(unfold(links, places), folded);
  EXPECT_LE(foldedTriangles(links, places).size(), folded);
  for (uint32_t v = 0; v < kSide * kSide; ++v) {
    if (links.isBorder(v)) {
      EXPECT_EQ(places[v], before[v]) << v;
    }
  }
}

TEST(Unfold, PlacesThatAreAllOneAreHarmless) {
  const MeshLinks links(kSide * kSide, gridTriangles());
  std::vector<Vec3d> places(kSide * kSide, Vec3d(1, 2, 3));
  EXPECT_EQ(unfold(links, places), 0u);
}

}  // namespace
}  // namespace stipple
