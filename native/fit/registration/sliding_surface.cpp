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

uint32_t otherEnd(const std::pair<uint32_t, uint32_t>& edge, uint32_t vertex) {
  return edge.first == vertex ? edge.second : edge.first;
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
  for (size_t i = 0; i < sides.size();) {
    size_t end = i;
    while (end < sides.size() && sides[end].ends == sides[i].ends) ++end;
    const uint32_t first = sides[i].triangle, second = sides[i + 1 < end ? i + 1 : i].triangle;
    const bool is_smooth =
        end - i == 2 && !differ(areaVector(triangles, positions, first),
                                areaVector(triangles, positions, second), least_cosine);
    if (is_smooth) regions.join(first, second);
    if (!is_smooth) sharp_.push_back(sides[i].ends);
    i = end;
  }

  // Vertices of two sharp edges that go on straight enough lie on lines.
  std::vector<std::vector<uint32_t>> edges_at(positions.size());
  for (uint32_t e = 0; e < sharp_.size(); ++e) {
    edges_at[sharp_[e].first].push_back(e);
    edges_at[sharp_[e].second].push_back(e);
  }
  JoinedGroups lines(sharp_.size());
  std::vector<uint8_t> is_on_line(positions.size(), 0);
  for (uint32_t v = 0; v < positions.size(); ++v) {
    if (edges_at[v].size() != 2) continue;
    const auto along = [&](uint32_t e) {
      const uint32_t other = otherEnd(sharp_[e], v);
      return Vec3d(positions[other] - positions[v]);
    };
    if (differ(along(edges_at[v][0]), -along(edges_at[v][1]), least_cosine)) continue;
    is_on_line[v] = 1;
    lines.join(edges_at[v][0], edges_at[v][1]);
  }

  uint32_t region_count = 0, line_count = 0;
  region_of_ = numbersOf(regions, links.triangleCount(), region_count);
  const std::vector<uint32_t> line_of = numbersOf(lines, sharp_.size(), line_count);
  region_count_ = region_count;
  parts_.resize(size_t{region_count} + line_count);
  for (uint32_t t = 0; t < links.triangleCount(); ++t) {
    std::vector<uint32_t>& faces = parts_[region_of_[t]].faces;
    faces.insert(faces.end(), &triangles[size_t{t} * 3], &triangles[size_t{t} * 3] + 3);
  }
  for (uint32_t e = 0; e < sharp_.size(); ++e) {
    std::vector<uint32_t>& faces = parts_[region_count + line_of[e]].faces;
    faces.insert(faces.end(), {sharp_[e].first, sharp_[e].second, sharp_[e].second});
  }
  for (uint32_t v = 0; v < positions.size(); ++v) {
    if (is_on_line[v]) part_of_[v] = region_count + line_of[edges_at[v][0]];
    if (!edges_at[v].empty()) continue;
    // Where two sheets touch in a point alone, it stays.
    const std::span<const uint32_t> corners = links.corners(v);
    const uint32_t region = corners.empty() ? kHeld : region_of_[corners[0] / 3];
    const bool is_one = std::all_of(corners.begin(), corners.end(), [&](uint32_t corner) {
      return region_of_[corner / 3] == region;
    });
    if (is_one) part_of_[v] = region;
  }
  makeChains(edges_at, line_of, line_count);
  for (Part& part : parts_) {
    part.search = std::make_unique<SurfaceSearch>(floats_, part.faces);
  }
}

void SlidingSurface::makeChains(std::span<const std::vector<uint32_t>> edges_at,
                                std::span<const uint32_t> line_of, size_t line_count) {
  const auto goesOn = [&](uint32_t v) { return part_of_[v] != kHeld; };
  // Lines with ends begin at one; what is left then is closed.
  std::vector<uint8_t> is_made(line_count, 0);
  for (const bool closed : {false, true}) {
    for (uint32_t e = 0; e < sharp_.size(); ++e) {
      const auto [first, second] = sharp_[e];
      if (is_made[line_of[e]] || (!closed && goesOn(first) && goesOn(second))) continue;
      is_made[line_of[e]] = 1;
      Chain chain;
      chain.is_closed = closed;
      uint32_t v = closed || !goesOn(first) ? first : second, edge = e;
      chain.vertices.push_back(v);
      for (;;) {
        v = otherEnd(sharp_[edge], v);
        if (closed && v == chain.vertices.front()) break;
        chain.vertices.push_back(v);
        if (!goesOn(v)) break;
        edge = edges_at[v][edges_at[v][0] == edge ? 1 : 0];
      }
      if (chain.vertices.size() > 2) chains_.push_back(std::move(chain));
    }
  }
}

SurfaceLanding SlidingSurface::landing(const Part& part, const Vec3d& point,
                                       std::vector<SurfacePlace>& places) const {
  part.search->nearest(point, 1, places);
  const uint32_t* corner = &part.faces[size_t{places[0].triangle} * 3];
  return {{corner[0], corner[1], corner[2]}, places[0].weights};
}

std::vector<SurfaceLanding> SlidingSurface::land(std::span<Vec3d> vertices) const {
  std::vector<SurfaceLanding> landings(vertices.size());
  const std::span<const Vec3d> surface = positions_;
  parallelFor(vertices.size(), kGrain, [&](size_t begin, size_t end) {
    std::vector<SurfacePlace> places;
    for (size_t v = begin; v < end; ++v) {
      const auto index = static_cast<uint32_t>(v);
      landings[v] = part_of_[v] == kHeld ? SurfaceLanding{{index, index, index}, {1, 0, 0}}
                                         : landing(parts_[part_of_[v]], vertices[v], places);
      vertices[v] = landings[v].of(surface);
    }
  });
  return landings;
}

void SlidingSurface::divideLines(std::span<Vec3d> vertices, std::span<const double> goals,
                                 double share) const {
  for (const Chain& chain : chains_) {
    const size_t count = chain.vertices.size(), edges = count - (chain.is_closed ? 0 : 1);
    const auto at = [&](size_t i) { return chain.vertices[i % count]; };
    // How far along the line each vertex is, in goals: even steps of that are what is asked for.
    std::vector<double> along(edges + 1, 0.0);
    for (size_t i = 0; i < edges; ++i) {
      const double goal = 0.5 * (goals[at(i)] + goals[at(i + 1)]);
      along[i + 1] = along[i] + (positions_[at(i + 1)] - positions_[at(i)]).norm() / goal;
    }
    const double whole = along[edges], step = whole / static_cast<double>(edges);
    if (!(whole > 0)) continue;
    double offset = 0;  // Of closed lines, so that they do not turn as a whole.
    for (size_t i = 0; chain.is_closed && i < edges; ++i) {
      offset += (along[i] - step * static_cast<double>(i)) / static_cast<double>(edges);
    }
    for (size_t i = chain.is_closed ? 0 : 1; i < edges; ++i) {
      const double even = step * static_cast<double>(i) + offset;
      double place = along[i] + share * (even - along[i]);
      if (place < 0) place += whole;
      if (place >= whole) place -= whole;
      const auto after = std::upper_bound(along.begin(), along.end() - 1, place);
      const auto edge = static_cast<size_t>(after - along.begin()) - 1;
      const double length = along[edge + 1] - along[edge];
      const double part = length > 0 ? (place - along[edge]) / length : 0.0;
      const Vec3d &from = positions_[at(edge)], &to = positions_[at(edge + 1)];
      vertices[at(i)] = from + part * (to - from);
    }
  }
}

std::vector<uint8_t> SlidingSurface::turned(std::span<const Vec3d> vertices) const {
  const std::span<const uint32_t> triangles = links_.triangles();
  std::vector<uint8_t> is_turned(links_.triangleCount(), 0);
  parallelFor(is_turned.size(), kGrain, [&](size_t begin, size_t end) {
    std::vector<SurfacePlace> places;
    for (size_t t = begin; t < end; ++t) {
      const auto index = static_cast<uint32_t>(t);
      const uint32_t* corner = &triangles[t * 3];
      const Vec3d middle = (vertices[corner[0]] + vertices[corner[1]] + vertices[corner[2]]) / 3.0;
      const SurfaceLanding there = landing(parts_[region_of_[t]], middle, places);
      const Vec3d across = areaVector(there.corners, positions_, 0);
      is_turned[t] = areaVector(triangles, vertices, index).dot(across) < 0;
    }
  });
  return is_turned;
}

bool SlidingSurface::isSharp(uint32_t a, uint32_t b) const {
  return std::binary_search(sharp_.begin(), sharp_.end(),
                            std::pair<uint32_t, uint32_t>(std::minmax(a, b)));
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
