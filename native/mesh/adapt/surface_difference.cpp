#include "mesh/adapt/surface_difference.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/parallel.h"
#include "mesh/adapt/moving_samples.h"
#include "mesh/adapt/nearest_points.h"
#include "mesh/adapt/point_rows.h"
#include "mesh/surface_search.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1024;
/// Shorter normals are too unsure of themselves to be compared.
constexpr double kSure = 0.5;

/// The nearest place of a surface, and its normal there (0: none).
class NearestPlace {
 public:
  explicit NearestPlace(const ComparedSurface& surface) : surface_(surface) {
    if (surface.triangles.empty()) {
      points_.emplace(surface.points);
    } else {
      search_.emplace(surface.positions, surface.triangles);
    }
  }

  double squared(const Vec3d& to, Vec3d& normal, std::vector<SurfacePlace>& places) const {
    if (points_) {
      const uint32_t found = points_->nearest(to);
      normal = surface_.normals.empty() ? Vec3d::Zero().eval() : rowOf(surface_.normals, found);
      return (rowOf(surface_.points, found) - to).squaredNorm();
    }
    search_->nearest(to, 1, places);
    const uint32_t* corner = &surface_.triangles[size_t{places[0].triangle} * 3];
    const Vec3d corners[3] = {rowOf(surface_.positions, corner[0]),
                              rowOf(surface_.positions, corner[1]),
                              rowOf(surface_.positions, corner[2])};
    const uint32_t own[3] = {0, 1, 2};
    normal = areaVector(own, corners, 0);
    if (normal.norm() > 0) normal.normalize();
    return places[0].squared;
  }

 private:
  const ComparedSurface& surface_;
  std::optional<NearestPoints> points_;
  std::optional<SurfaceSearch> search_;
};

struct Sums {
  double distance = 0, squared = 0, normals = 0, normal_count = 0;
};

/// Means of what the points of one surface have to the other.
Sums oneWay(const ComparedSurface& from, const ComparedSurface& to) {
  const NearestPlace nearest(to);
  const size_t count = from.points.size() / 3;
  std::vector<Sums> parts(rangeCount(count, kGrain));
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    Sums& sums = parts[begin / kGrain];
    std::vector<SurfacePlace> places;
    for (size_t i = begin; i < end; ++i) {
      Vec3d normal;
      const double squared = nearest.squared(rowOf(from.points, i), normal, places);
      sums.distance += std::sqrt(squared);
      sums.squared += squared;
      if (from.normals.empty()) continue;
      const Vec3d given = rowOf(from.normals, i);
      if (given.norm() < kSure || normal.norm() < kSure) continue;
      const Vec3d own = given.normalized();
      normal.normalize();
      double difference = (own - normal).squaredNorm();
      if (!from.is_oriented || !to.is_oriented) {
        difference = std::min(difference, (own + normal).squaredNorm());
      }
      sums.normals += difference;
      sums.normal_count += 1;
    }
  });
  Sums whole;
  for (const Sums& part : parts) {
    whole.distance += part.distance / static_cast<double>(count);
    whole.squared += part.squared / static_cast<double>(count);
    whole.normals += part.normals;
    whole.normal_count += part.normal_count;
  }
  return whole;
}

}  // namespace

SurfaceDifference surfaceDifference(const ComparedSurface& one, const ComparedSurface& other) {
  const Sums there = oneWay(one, other);
  const Sums back = oneWay(other, one);
  SurfaceDifference made;
  made.distance = 0.5 * (there.distance + back.distance);
  made.squared = 0.5 * (there.squared + back.squared);
  made.has_normals = there.normal_count > 0 && back.normal_count > 0;
  if (made.has_normals) {
    made.normals = 0.5 * (there.normals / there.normal_count + back.normals / back.normal_count);
  }
  return made;
}

}  // namespace stipple
