#include "motion/surface_binding.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "mesh/surface_search.h"
#include "motion/triangle_motion.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1024;

/// A triangle thinner than this part of its longest edge has no direction to follow.
constexpr double kThinnest = 1e-6;

void requireFinite(std::span<const float> numbers, const char* what) {
  for (const float value : numbers) {
    if (!std::isfinite(value)) {
      fail(ErrorCode::kInvalidArgument, std::string(what) + " has a place that is not finite");
    }
  }
}

void requireTriangles(std::span<const uint32_t> triangles, size_t vertex_count, const char* what) {
  if (triangles.size() % 3 != 0) {
    fail(ErrorCode::kInvalidArgument, std::string(what) + " has " +
                                          std::to_string(triangles.size()) +
                                          " corners of triangles; a multiple of three is needed");
  }
  for (const uint32_t vertex : triangles) {
    if (vertex < vertex_count) continue;
    fail(ErrorCode::kInvalidArgument, std::string(what) + " has a triangle with vertex " +
                                          std::to_string(vertex) + " of " +
                                          std::to_string(vertex_count));
  }
}

/// The triangles that have an area, three corners each, and their numbers.
struct WideTriangles {
  std::vector<uint32_t> corners, numbers;
};

WideTriangles wideTriangles(std::span<const float> rest, std::span<const uint32_t> triangles) {
  WideTriangles wide;
  for (size_t t = 0; t < triangles.size() / 3; ++t) {
    const TriangleFrame frame = triangleFrame(rest, &triangles[3 * t]);
    const double longest =
        std::max({frame.axes.col(0).squaredNorm(), frame.axes.col(1).squaredNorm(),
                  (frame.axes.col(1) - frame.axes.col(0)).squaredNorm()});
    if (!(frame.area > kThinnest * longest)) continue;
    wide.corners.insert(wide.corners.end(), &triangles[3 * t], &triangles[3 * t] + 3);
    wide.numbers.push_back(static_cast<uint32_t>(t));
  }
  return wide;
}

/// Weights that fall to 0 at the first triangle that is left out, so that they have no jumps where
/// another one comes among the nearest: (1 - d / d_last)^2 (Sumner et al., Embedded Deformation for
/// Shape Manipulation, SIGGRAPH 2007). In: places nearest first, one more than are bound.
void weigh(const std::vector<SurfacePlace>& places, uint32_t bound, float* weights) {
  const double last = std::sqrt(places.back().squared);
  double sum = 0;
  std::array<double, kAroundTriangles> shares{};
  for (size_t i = 0; i < bound; ++i) {
    const double near = last > 0 ? 1 - std::sqrt(places[i].squared) / last : 1;
    shares[i] = near * near;
    sum += shares[i];
  }
  // All as far as the one that is left out.
  if (!(sum > 0)) {
    shares.fill(1);
    sum = bound;
  }
  for (size_t i = 0; i < bound; ++i) weights[i] = static_cast<float>(shares[i] / sum);
}

}  // namespace

uint64_t topologyOf(size_t vertex_count, std::span<const uint32_t> triangles) {
  uint64_t hash = mixBits(vertex_count);
  for (const uint32_t vertex : triangles) hash = mixBits(hash ^ vertex);
  return hash;
}

SurfaceBinding bindToSurface(std::span<const float> positions, std::span<const float> rest,
                             std::span<const uint32_t> triangles, BindingReach reach,
                             Progress* progress) {
  requireFinite(positions, "the splats");
  requireFinite(rest, "the mesh");
  requireTriangles(triangles, rest.size() / 3, "the mesh");
  const WideTriangles wide = wideTriangles(rest, triangles);
  if (wide.numbers.empty()) {
    fail(ErrorCode::kInvalidArgument, "the mesh has no triangle with an area among its " +
                                          std::to_string(triangles.size() / 3) +
                                          "; splats need one to follow");
  }
  const auto around = static_cast<uint32_t>(
      std::min<size_t>(kAroundTriangles, std::max<size_t>(wide.numbers.size() - 1, 1)));
  SurfaceBinding binding;
  binding.topology = topologyOf(rest.size() / 3, triangles);
  binding.rest.assign(rest.begin(), rest.end());
  binding.triangles.assign(triangles.begin(), triangles.end());
  binding.influences = reach == BindingReach::kSurface ? 1 : around;
  const size_t count = positions.size() / 3;
  binding.bound.resize(count * binding.influences);
  binding.weights.assign(count * binding.influences, 1.0f);
  const SurfaceSearch search(rest, wide.corners);
  const size_t wanted = reach == BindingReach::kSurface ? 1 : size_t{binding.influences} + 1;
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    if (progress != nullptr) progress->throwIfCancelled();
    std::vector<SurfacePlace> places;
    for (size_t row = begin; row < end; ++row) {
      const float* at = positions.data() + 3 * row;
      search.nearest({at[0], at[1], at[2]}, wanted, places);
      const size_t first = row * binding.influences;
      for (size_t i = 0; i < binding.influences; ++i) {
        binding.bound[first + i] = wide.numbers[places[i].triangle];
      }
      if (binding.influences > 1) weigh(places, binding.influences, &binding.weights[first]);
    }
  });
  return binding;
}

uint64_t bindingMemoryBound(uint64_t splat_count, uint64_t vertex_count, uint64_t triangle_count,
                            BindingReach reach) {
  const uint64_t influences = reach == BindingReach::kSurface ? 1 : kAroundTriangles;
  // Places as they are given and as they are kept. Of a triangle: its corners given, kept, and with
  // its number among those that have an area; SurfaceSearch with the centroids that it is built by.
  constexpr uint64_t kVertexBytes = 2 * 12;
  constexpr uint64_t kTriangleBytes = 3 * 12 + 4 + 60 + 12;
  return splat_count * influences * (sizeof(uint32_t) + sizeof(float)) +
         vertex_count * kVertexBytes + triangle_count * kTriangleBytes;
}

void validate(const SurfaceBinding& binding, size_t splat_count, const char* what) {
  const auto refuse = [what](const std::string& why) {
    fail(ErrorCode::kInvalidArgument, std::string(what) + " " + why);
  };
  if (binding.influences < 1 || binding.influences > kAroundTriangles) {
    refuse("has " + std::to_string(binding.influences) + " triangles for each splat; 1 to " +
           std::to_string(kAroundTriangles) + " are allowed");
  }
  if (binding.bound.size() != splat_count * binding.influences ||
      binding.weights.size() != binding.bound.size()) {
    refuse("is of " + std::to_string(binding.size()) + " splats and " +
           std::to_string(binding.weights.size()) + " weights; there are " +
           std::to_string(splat_count) + " splats");
  }
  if (binding.rest.size() % 3 != 0) refuse("has a mesh with half a vertex");
  requireFinite(binding.rest, what);
  requireTriangles(binding.triangles, binding.rest.size() / 3, what);
  for (const uint32_t triangle : binding.bound) {
    if (triangle < binding.triangles.size() / 3) continue;
    refuse("leads to triangle " + std::to_string(triangle) + " of " +
           std::to_string(binding.triangles.size() / 3));
  }
  for (size_t row = 0; row < splat_count; ++row) {
    double sum = 0;
    for (size_t i = 0; i < binding.influences; ++i) {
      const double weight = binding.weights[row * binding.influences + i];
      if (!(weight >= 0 && weight <= 1)) refuse("has a weight outside 0 to 1");
      sum += weight;
    }
    if (std::abs(sum - 1) > 1e-4) refuse("has weights that do not add up to 1");
  }
  const auto frameHolds = [&](uint32_t triangle) {
    return triangleFrame(binding.rest, &binding.triangles[size_t{3} * triangle]).area > 0;
  };
  for (const uint32_t triangle : binding.bound) {
    if (!frameHolds(triangle)) refuse("leads to a triangle without area");
  }
}

}  // namespace stipple
