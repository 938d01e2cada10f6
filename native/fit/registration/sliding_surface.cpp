#include "fit/registration/sliding_surface.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/parallel.h"
#include "mesh/adapt/moving_samples.h"
#include "mesh/adapt/point_rows.h"
#include "mesh/joined_groups.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1024;
constexpr int kMostRounds = 32;

/// Numbers of the groups from 0 on, of each member.
std::vector<uint32_t> numbersOf(JoinedGroups& groups, size_t members, uint32_t& count) {
  std::vector<uint32_t> numbers(members);
  count = 0;
  for (uint32_t i = 0; i < members; ++i) {
    const uint32_t root = groups.root(i);
    numbers[i] = root == i ? count++ : numbers[root];
  }
  return numbers;
}

struct EdgeSide {
  std::pair<uint32_t, uint32_t> ends;
  uint32_t triangle;
};

/// Sides of all triangles, those of one edge next to each other.
std::vector<EdgeSide> sortedSides(std::span<const uint32_t> triangles) {
  std::vector<EdgeSide> sides;
  sides.reserve(triangles.size());
  for (uint32_t corner = 0; corner < triangles.size(); ++corner) {
    const uint32_t next = triangles[corner / 3 * 3 + (corner + 1) % 3];
    sides.push_back({std::minmax(triangles[corner], next), corner / 3});
  }
  std::sort(sides.begin(), sides.end(), [](const EdgeSide& a, const EdgeSide& b) {
    return a.ends != b.ends ? a.ends < b.ends : a.triangle < b.triangle;
  });
  return sides;
}

/// True where two directions differ by more than an angle. One without length differs from none.
bool differ(const Vec3d& a, const Vec3d& b, double least_cosine) {
  return a.dot(b) < least_cosine * a.norm() * b.norm();
}

}  // namespace

SlidingSurface::SlidingSurface(const MeshLinks& links, std::span<const Vec3d> positions,
                               double sharp_angle)
    : links_(links),
      positions_(positions.begin(), positions.end()),
      floats_(positions.size() * 3),
      part_of_(positions.size(), kHeld) {
  for (size_t v = 0; v < positions.size(); ++v) setRow(floats_, v, positions[v]);
  const std::span<const uint32_t> triangles = links.triangles();
  const double least_cosine = std::cos(sharp_angle);
  const std::vector<EdgeSide> sides = sortedSides(triangles);
  JoinedGroups regions(links.triangleCount());
  std::vector<std::pair<uint32_t, uint32_t>> sharp;
  for (size_t i = 0; i < sides.size();) {
    size_t end = i;
    while (end < sides.size() && sides[end].ends == sides[i].ends) ++end;
    const uint32_t first = sides[i].triangle, second = sides[i + 1 < end ? i + 1 : i].triangle;
    const bool is_smooth =
        end - i == 2 && !differ(areaVector(triangles, positions, first),
                                areaVector(triangles, positions, second), least_cosine);
    if (is_smooth) regions.join(first, second);
    if (!is_smooth) sharp.push_back(sides[i].ends);
    i = end;
  }

  // Vertices of two sharp edges that go on straight enough lie on lines.
  std::vector<std::vector<uint32_t>> edges_at(positions.size());
  for (uint32_t e = 0; e < sharp.size(); ++e) {
    edges_at[sharp[e].first].push_back(e);
    edges_at[sharp[e].second].push_back(e);
  }
  JoinedGroups lines(sharp.size());
  std::vector<uint8_t> is_on_line(positions.size(), 0);
  for (uint32_t v = 0; v < positions.size(); ++v) {
    if (edges_at[v].size() != 2) continue;
    const auto along = [&](uint32_t e) {
      const uint32_t other = sharp[e].first == v ? sharp[e].second : sharp[e].first;
      return Vec3d(positions[other] - positions[v]);
    };
    if (differ(along(edges_at[v][0]), -along(edges_at[v][1]), least_cosine)) continue;
    is_on_line[v] = 1;
    lines.join(edges_at[v][0], edges_at[v][1]);
  }

  uint32_t region_count = 0, line_count = 0;
  const std::vector<uint32_t> region_of = numbersOf(regions, links.triangleCount(), region_count);
  const std::vector<uint32_t> line_of = numbersOf(lines, sharp.size(), line_count);
  region_count_ = region_count;
  parts_.resize(size_t{region_count} + line_count);
  for (uint32_t t = 0; t < links.triangleCount(); ++t) {
    std::vector<uint32_t>& faces = parts_[region_of[t]].faces;
    faces.insert(faces.end(), &triangles[size_t{t} * 3], &triangles[size_t{t} * 3] + 3);
  }
  for (uint32_t e = 0; e < sharp.size(); ++e) {
    std::vector<uint32_t>& faces = parts_[region_count + line_of[e]].faces;
    faces.insert(faces.end(), {sharp[e].first, sharp[e].second, sharp[e].second});
  }
  for (uint32_t v = 0; v < positions.size(); ++v) {
    if (is_on_line[v]) part_of_[v] = region_count + line_of[edges_at[v][0]];
    if (!edges_at[v].empty()) continue;
    // Where two sheets touch in a point alone, it stays.
    const std::span<const uint32_t> corners = links.corners(v);
    const uint32_t region = corners.empty() ? kHeld : region_of[corners[0] / 3];
    const bool is_one = std::all_of(corners.begin(), corners.end(), [&](uint32_t corner) {
      return region_of[corner / 3] == region;
    });
    if (is_one) part_of_[v] = region;
  }
  for (Part& part : parts_) {
    part.search = std::make_unique<SurfaceSearch>(floats_, part.faces);
  }
}

void SlidingSurface::land(std::span<Vec3d> vertices) const {
  parallelFor(vertices.size(), kGrain, [&](size_t begin, size_t end) {
    std::vector<SurfacePlace> places;
    for (size_t v = begin; v < end; ++v) {
      if (part_of_[v] == kHeld) {
        vertices[v] = positions_[v];
        continue;
      }
      const Part& part = parts_[part_of_[v]];
      part.search->nearest(vertices[v], 1, places);
      vertices[v].setZero();
      for (size_t corner = 0; corner < 3; ++corner) {
        vertices[v] += places[0].weights[corner] *
                       positions_[part.faces[size_t{places[0].triangle} * 3 + corner]];
      }
    }
  });
}

void SlidingSurface::landUnfolded(std::span<Vec3d> vertices) const {
  land(vertices);
  const std::span<const uint32_t> triangles = links_.triangles();
  for (int round = 0; round < kMostRounds; ++round) {
    std::vector<uint8_t> comes_back(vertices.size(), 0);
    bool is_folded = false;
    for (uint32_t t = 0; t < links_.triangleCount(); ++t) {
      const Vec3d before = areaVector(triangles, positions_, t);
      if (!(before.squaredNorm() > 0) || !differ(areaVector(triangles, vertices, t), before, 0.0)) {
        continue;
      }
      is_folded = true;
      for (size_t k = 0; k < 3; ++k) comes_back[triangles[size_t{t} * 3 + k]] = 1;
    }
    if (!is_folded) return;
    for (size_t v = 0; v < vertices.size(); ++v) {
      if (!comes_back[v]) continue;
      vertices[v] = round + 1 < kMostRounds ? 0.5 * (vertices[v] + positions_[v]) : positions_[v];
    }
    land(vertices);
  }
}

size_t SlidingSurface::heldCount() const {
  return static_cast<size_t>(std::count(part_of_.begin(), part_of_.end(), kHeld));
}

size_t SlidingSurface::lineCount() const {
  return static_cast<size_t>(std::count_if(part_of_.begin(), part_of_.end(), [&](uint32_t part) {
    return part != kHeld && part >= region_count_;
  }));
}

}  // namespace stipple
