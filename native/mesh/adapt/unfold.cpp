#include "mesh/adapt/unfold.h"

#include <algorithm>

#include "mesh/adapt/moving_samples.h"

namespace stipple {

namespace {

constexpr double kFolded = -0.5;  ///< cosine of 120 degrees
constexpr int kRounds = 40;
constexpr int kRoundsOfRing = 8;  ///< after so many, one more ring of vertices moves with them

Vec3d unitNormal(const MeshLinks& links, std::span<const Vec3d> places, uint32_t triangle) {
  const Vec3d area = areaVector(links.triangles(), places, triangle);
  const double length = area.norm();
  return length > 0 ? (area / length).eval() : Vec3d::Zero().eval();
}

/// The triangle at the other side of an edge of two; the triangle itself where there is none.
uint32_t acrossEdge(const MeshLinks& links, uint32_t triangle, uint32_t a, uint32_t b) {
  uint32_t other = triangle, count = 0;
  for (const uint32_t corner : links.corners(a)) {
    const uint32_t near = corner / 3;
    const uint32_t* const of = &links.triangles()[size_t{near} * 3];
    if (near == triangle || (of[0] != b && of[1] != b && of[2] != b)) continue;
    other = near;
    ++count;
  }
  return count == 1 ? other : triangle;
}

/// Vertices of the triangles, and of `rings` rings around them, that are at no border.
std::vector<uint32_t> verticesOf(const MeshLinks& links, std::span<const uint32_t> triangles,
                                 int rings) {
  std::vector<uint32_t> found;
  for (const uint32_t t : triangles) {
    const auto corners = links.triangles().subspan(size_t{t} * 3, 3);
    found.insert(found.end(), corners.begin(), corners.end());
  }
  const auto tidy = [&] {
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
  };
  tidy();
  for (int ring = 0; ring < rings; ++ring) {
    for (size_t i = 0, count = found.size(); i < count; ++i) {
      const auto around = links.neighbours(found[i]);
      found.insert(found.end(), around.begin(), around.end());
    }
    tidy();
  }
  std::erase_if(found, [&](uint32_t v) { return links.isBorder(v); });
  return found;
}

}  // namespace

std::vector<uint32_t> foldedTriangles(const MeshLinks& links, std::span<const Vec3d> places) {
  const auto count = static_cast<uint32_t>(links.triangleCount());
  std::vector<Vec3d> normals(count);
  for (uint32_t t = 0; t < count; ++t) normals[t] = unitNormal(links, places, t);
  std::vector<uint32_t> folded;
  for (uint32_t t = 0; t < count; ++t) {
    const uint32_t* const of = &links.triangles()[size_t{t} * 3];
    Vec3d around = Vec3d::Zero();
    for (size_t c = 0; c < 3; ++c) {
      const uint32_t other = acrossEdge(links, t, of[c], of[(c + 1) % 3]);
      if (other != t) around += normals[other];
    }
    if (around.norm() > 0 && normals[t].dot(around.normalized()) < kFolded) folded.push_back(t);
  }
  return folded;
}

size_t unfold(const MeshLinks& links, std::span<Vec3d> places) {
  std::vector<uint32_t> folded = foldedTriangles(links, places);
  const size_t before = folded.size();
  size_t fewest = before;
  std::vector<Vec3d> now(places.begin(), places.end());
  for (int round = 0; round < kRounds && !folded.empty(); ++round) {
    const std::vector<uint32_t> moved = verticesOf(links, folded, round / kRoundsOfRing);
    std::vector<Vec3d> middles;
    for (const uint32_t v : moved) {
      Vec3d sum = Vec3d::Zero();
      for (const uint32_t near : links.neighbours(v)) sum += now[near];
      middles.push_back(sum / static_cast<double>(links.neighbours(v).size()));
    }
    for (size_t i = 0; i < moved.size(); ++i) now[moved[i]] = middles[i];
    folded = foldedTriangles(links, now);
    if (folded.size() >= fewest) continue;
    fewest = folded.size();
    std::copy(now.begin(), now.end(), places.begin());
  }
  return before;
}

}  // namespace stipple
