// Based on: Cook, Stochastic Sampling in Computer Graphics, TOG 1986 (one jittered sample per equal
// stratum, here of the running area); inside a triangle the additive recurrence of the plastic
// number (Roberts, The Unreasonable Effectiveness of Quasirandom Sequences, 2018) from a random
// start, folded into the triangle.
#include "mesh/surface_sampling.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "data/clouds/splat_cloud.h"
#include "math/colour.h"
#include "mesh/surface_colour.h"
#include "mesh/surface_detail.h"
#include "mesh/view_harmonics.h"

namespace stipple {

namespace {

constexpr size_t kTriangleGrain = 8192;
constexpr size_t kSampleGrain = 4096;
constexpr double kPlastic1 = 0.7548776662466927;  ///< 1/g, g^3 = g + 1
constexpr double kPlastic2 = 0.5698402909980532;  ///< 1/g^2
constexpr double kGolden = 0.6180339887498949;    ///< its multiples lie evenly between integers
constexpr double kMostParts = 4;                  ///< of a sample where there is detail
constexpr double kDetailGain = 4.0;  ///< at detail weight 1, full detail attracts 1 + 4 times more

using Vec = std::array<double, 3>;

Vec vertexOf(const TriMesh& mesh, size_t triangle, size_t corner) {
  const float* p = &mesh.positions[size_t{mesh.triangles[triangle * 3 + corner]} * 3];
  return {static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2])};
}

/// Twice the area vector of a triangle.
Vec areaVector(const TriMesh& mesh, size_t triangle) {
  const Vec p = vertexOf(mesh, triangle, 0);
  const Vec q = vertexOf(mesh, triangle, 1);
  const Vec r = vertexOf(mesh, triangle, 2);
  const Vec a = {q[0] - p[0], q[1] - p[1], q[2] - p[2]};
  const Vec b = {r[0] - p[0], r[1] - p[1], r[2] - p[2]};
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

double length(const Vec& v) {
  return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/// Areas summed up to and including each triangle, square metres.
std::vector<double> runningAreas(const TriMesh& mesh) {
  std::vector<double> running(mesh.triangleCount());
  parallelFor(running.size(), kTriangleGrain, [&](size_t begin, size_t end) {
    for (size_t t = begin; t < end; ++t) running[t] = 0.5 * length(areaVector(mesh, t));
  });
  double sum = 0;
  for (double& area : running) {
    sum += area;
    area = sum;
  }
  return running;
}

uint64_t keyOf(uint64_t seed, size_t triangle) {
  return keyedBits(~seed, RandomUse::kSurfaceSample, static_cast<uint64_t>(triangle));
}

Barycentric foldedPoint(double x, double y) {
  if (x + y > 1) {
    x = 1 - x;
    y = 1 - y;
  }
  return {1 - x - y, x, y};
}

Vec unitNormal(const TriMesh& mesh, size_t triangle, const Barycentric& at) {
  const Vec face = areaVector(mesh, triangle);
  const double face_length = length(face);
  Vec normal = {0, 0, 0};
  if (!mesh.corner_normals.empty()) {
    for (size_t corner = 0; corner < 3; ++corner) {
      for (size_t axis = 0; axis < 3; ++axis) {
        normal[axis] +=
            at[corner] * static_cast<double>(mesh.corner_normals[triangle * 9 + corner * 3 + axis]);
      }
    }
  }
  const double normal_length = length(normal);
  // Corner normals that cancel out say nothing; the face does.
  if (normal_length > 1e-6) {
    return {normal[0] / normal_length, normal[1] / normal_length, normal[2] / normal_length};
  }
  return {face[0] / face_length, face[1] / face_length, face[2] / face_length};
}

void requireOptions(const SurfaceSamplingOptions& options) {
  constexpr uint64_t kMaxSampleCount = uint64_t{1} << 28;
  if (options.count == 0 || options.count > kMaxSampleCount) {
    fail(ErrorCode::kInvalidArgument, "surface sample count is " + std::to_string(options.count) +
                                          "; 1 to 268435456 is allowed");
  }
  if (options.harmonic_degree < 0 || options.harmonic_degree > kMaxViewDegree) {
    fail(ErrorCode::kInvalidArgument,
         "harmonic degree is " + std::to_string(options.harmonic_degree) + "; 0 to 3 is allowed");
  }
  if (!std::isfinite(options.detail_weight) || options.detail_weight < 0) {
    fail(ErrorCode::kInvalidArgument,
         "detail weight is " + std::to_string(options.detail_weight) + "; 0 or more is allowed");
  }
}

/// Where a sample lies: the weights of the second and the third corner of its triangle.
struct Place {
  uint32_t triangle = 0;
  double x = 0, y = 0;
};

/// Makes samples of places.
class Sampler {
 public:
  /// views: of the mesh's view directions, or null: colours are those along the normal.
  Sampler(const TriMesh& mesh, const std::vector<double>& running, const ViewHarmonics* views)
      : mesh_(mesh), running_(running), colour_(mesh), views_(views) {}

  double areaOf(size_t triangle) const {
    return running_[triangle] - (triangle == 0 ? 0.0 : running_[triangle - 1]);
  }

  /// area: square metres that the sample stands for.
  void put(const Place& place, double area, uint64_t random, PointSet& samples, size_t i) const {
    const size_t triangle = place.triangle;
    const Barycentric at = {1 - place.x - place.y, place.x, place.y};
    const Vec corners[3] = {vertexOf(mesh_, triangle, 0), vertexOf(mesh_, triangle, 1),
                            vertexOf(mesh_, triangle, 2)};
    const Vec normal = unitNormal(mesh_, triangle, at);
    const std::array<float, 4> colour =
        colour_.at(triangle, at, area / areaOf(triangle), mixBits(random));
    for (size_t axis = 0; axis < 3; ++axis) {
      samples.positions[i * 3 + axis] = static_cast<float>(
          at[0] * corners[0][axis] + at[1] * corners[1][axis] + at[2] * corners[2][axis]);
      samples.normals[i * 3 + axis] = static_cast<float>(normal[axis]);
      samples.colours[i * 3 + axis] = colour[axis];
    }
    samples.opacities[i] = colour[3];
    samples.areas[i] = static_cast<float>(area);
    if (views_ && colour_.changesWithView(triangle)) fitViews(triangle, at, samples, i);
  }

  PointSet emptySamples(size_t count, int harmonic_degree) const;

 private:
  /// Harmonics of sample i, and the mean of its colours in place of that along its normal.
  void fitViews(size_t triangle, const Barycentric& at, PointSet& samples, size_t i) const {
    std::vector<float> added(views_->directionCount() * 3);
    colour_.addedByViews(triangle, at, added);
    std::array<float, 48> fitted;
    const size_t stride = samples.harmonicStride();
    float* colour = &samples.colours[i * 3];
    views_->fit(&samples.normals[i * 3], colour, added, std::span(fitted).first(stride + 3));
    for (size_t c = 0; c < 3; ++c) {
      colour[c] = srgbToLinear(std::max(0.0f, kShC0 * fitted[c] + 0.5f));
    }
    std::copy_n(fitted.begin() + 3, stride, &samples.harmonics[i * stride]);
  }

  const TriMesh& mesh_;
  const std::vector<double>& running_;
  SurfaceColour colour_;
  const ViewHarmonics* views_;
};

/// The harmonics that the options ask for, where anything looks different from different sides.
std::optional<ViewHarmonics> harmonicsOf(const TriMesh& mesh, int degree) {
  const auto changes = [](const Material& material) { return !material.view_textures.empty(); };
  if (degree == 0 || std::ranges::none_of(mesh.materials, changes)) return std::nullopt;
  return ViewHarmonics(mesh.view_directions, degree);
}

PointSet Sampler::emptySamples(size_t count, int harmonic_degree) const {
  PointSet samples;
  if (views_) samples.harmonic_degree = harmonic_degree;
  samples.harmonics.resize(count * samples.harmonicStride(), 0.0f);
  samples.positions.resize(count * 3);
  samples.normals.resize(count * 3);
  samples.colours.resize(count * 3);
  samples.opacities.resize(count);
  samples.areas.resize(count);
  return samples;
}

/// One place for every equal share of the area.
std::vector<Place> evenPlaces(const std::vector<double>& running, size_t count, uint64_t seed,
                              Progress* progress) {
  const double stratum = running.back() / static_cast<double>(count);
  std::vector<Place> places(count);
  const auto heightOf = [&](size_t i) {
    const double jitter = unitDouble(keyedBits(seed, RandomUse::kSurfaceSample, i));
    return (static_cast<double>(i) + jitter) * stratum;
  };
  parallelFor(count, kSampleGrain, [&](size_t begin, size_t end) {
    if (progress) progress->throwIfCancelled();
    size_t triangle = 0;
    size_t first = 0;  // of the samples of `triangle`
    bool fresh = true;
    for (size_t i = begin; i < end; ++i) {
      const double height = heightOf(i);
      if (fresh || height >= running[triangle]) {
        const auto from = running.begin() + static_cast<std::ptrdiff_t>(triangle);
        const auto found = std::upper_bound(from, running.end(), height);
        triangle = static_cast<size_t>(std::min(found, running.end() - 1) - running.begin());
        // Rounding can leave the last height on the total, in a triangle without area.
        while (triangle > 0 && running[triangle] == running[triangle - 1]) --triangle;
        const double low = triangle == 0 ? 0.0 : running[triangle - 1];
        first = static_cast<size_t>(std::max(0.0, std::floor(low / stratum)));
        while (first < i && heightOf(first) < low) ++first;
        fresh = false;
      }
      const uint64_t random = keyOf(seed, triangle);
      const auto ordinal = static_cast<double>(i - std::min(first, i));
      const double x = unitDouble(random) + kPlastic1 * ordinal;
      const double y = unitDouble(mixBits(random)) + kPlastic2 * ordinal;
      const Barycentric at = foldedPoint(x - std::floor(x), y - std::floor(y));
      places[i] = {static_cast<uint32_t>(triangle), at[1], at[2]};
    }
  });
  return places;
}

/// A place of a share of a triangle's area around another, which stays on the triangle.
Place nearPlace(const Place& middle, double share, double u, double v) {
  if (share >= 1) {
    const Barycentric at = foldedPoint(u, v);
    return {middle.triangle, at[1], at[2]};
  }
  // Where the triangle is the lower half of the unit square.
  const double side = std::sqrt(0.5 * share);
  double x = std::abs(middle.x + (u - 0.5) * side);
  double y = std::abs(middle.y + (v - 0.5) * side);
  const double over = x + y - 1;
  if (over > 0) {
    x = std::max(0.0, x - over);
    y = std::max(0.0, y - over);
  }
  return {middle.triangle, x, std::min(y, 1 - x)};
}

/// From which number on the parts of each sample stand, and how many there are in all: more of them
/// where there is detail. A sample's parts are rounded by a number of its own, never by a running
/// sum, so that detail that changes a little changes few samples.
std::vector<size_t> partsOf(const std::vector<float>& detail, uint64_t further) {
  double sum = 0;
  for (const float value : detail) sum += static_cast<double>(value);
  double gain =
      sum > 0 ? std::min<double>(kMostParts - 1, static_cast<double>(further) / sum) : 0.0;
  std::vector<size_t> begins(detail.size() + 1, 0);
  for (;;) {
    for (size_t i = 0; i < detail.size(); ++i) {
      const double turn = kGolden * static_cast<double>(i);
      const double rounding = turn - std::floor(turn);
      const double parts = gain * static_cast<double>(detail[i]) + rounding;
      begins[i + 1] = begins[i] + 1 + static_cast<size_t>(parts);
    }
    const size_t over = begins.back() - detail.size();
    if (over <= further) return begins;
    // The rounding sums to half a part a sample but for a few; these few are taken back.
    gain *= static_cast<double>(further) / static_cast<double>(over) * (1 - 1e-6);
  }
}

/// The samples with parts in the place of each, and the detail of every part.
PointSet split(const Sampler& sampler, const std::vector<Place>& places, const PointSet& even,
               const std::vector<size_t>& begins, uint64_t seed, std::vector<float>& detail) {
  PointSet samples = sampler.emptySamples(begins.back(), even.harmonic_degree);
  std::vector<float> of_parts(samples.size());
  parallelFor(places.size(), kSampleGrain, [&](size_t first, size_t last) {
    for (size_t i = first; i < last; ++i) {
      const size_t count = begins[i + 1] - begins[i];
      const auto area = static_cast<double>(even.areas[i]) / static_cast<double>(count);
      const uint64_t random = keyedBits(seed, RandomUse::kSurfacePart, i);
      const double start[2] = {unitDouble(random), unitDouble(mixBits(random))};
      const double share = static_cast<double>(even.areas[i]) / sampler.areaOf(places[i].triangle);
      for (size_t part = 0; part < count; ++part) {
        const double x = start[0] + kPlastic1 * static_cast<double>(part);
        const double y = start[1] + kPlastic2 * static_cast<double>(part);
        const Place place = count == 1
                                ? places[i]
                                : nearPlace(places[i], share, x - std::floor(x), y - std::floor(y));
        sampler.put(place, area, random + part, samples, begins[i] + part);
        of_parts[begins[i] + part] = detail[i];
      }
    }
  });
  detail = std::move(of_parts);
  return samples;
}

}  // namespace

PointSet sampleSurface(const TriMesh& mesh, const SurfaceSamplingOptions& options,
                       Progress* progress) {
  requireOptions(options);
  validate(mesh);
  advance(progress, 0.0, "Sampling the surface");
  const std::vector<double> running = runningAreas(mesh);
  const size_t count = options.count;
  const double stratum = running.back() / static_cast<double>(count);
  const std::optional<ViewHarmonics> views = harmonicsOf(mesh, options.harmonic_degree);
  const Sampler sampler(mesh, running, views ? &*views : nullptr);
  const std::vector<Place> places = evenPlaces(running, count, options.seed, progress);
  PointSet samples = sampler.emptySamples(count, options.harmonic_degree);
  parallelFor(count, kSampleGrain, [&](size_t begin, size_t end) {
    if (progress) progress->throwIfCancelled();
    for (size_t i = begin; i < end; ++i) {
      sampler.put(places[i], stratum, keyOf(options.seed, places[i].triangle) + i, samples, i);
    }
  });
  advance(progress, 0.5, "Sampling the surface");
  std::vector<float> detail(count, 0.0f);
  if (options.detail_weight > 0) {
    detail = surfaceDetail(samples, nullptr);
    if (options.detail_count > 0) {
      advance(progress, 0.8, "Sampling the surface");
      samples = split(sampler, places, samples, partsOf(detail, options.detail_count), options.seed,
                      detail);
    }
  }
  const double gain = kDetailGain * options.detail_weight;
  samples.weights.resize(samples.size());
  for (size_t i = 0; i < samples.size(); ++i) {
    samples.weights[i] = static_cast<float>(static_cast<double>(samples.areas[i]) *
                                            (1.0 + gain * static_cast<double>(detail[i])));
  }
  advance(progress, 1.0, "Sampling the surface");
  return samples;
}

}  // namespace stipple
