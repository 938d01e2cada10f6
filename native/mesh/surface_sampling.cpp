// Based on: Cook, Stochastic Sampling in Computer Graphics, TOG 1986 (one jittered sample per equal
// stratum, here of the running area); inside a triangle the additive recurrence of the plastic
// number (Roberts, The Unreasonable Effectiveness of Quasirandom Sequences, 2018) from a random
// start, folded into the triangle.
#include "mesh/surface_sampling.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "mesh/surface_detail.h"
#include "mesh/texture_lookup.h"

namespace stipple {

namespace {

constexpr size_t kTriangleGrain = 8192;
constexpr size_t kSampleGrain = 4096;
constexpr double kPlastic1 = 0.7548776662466927;  ///< 1/g, g^3 = g + 1
constexpr double kPlastic2 = 0.5698402909980532;  ///< 1/g^2
constexpr uint64_t kMaxTapCount = 8;
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

using Barycentric = std::array<double, 3>;

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

/// Colours of places on triangles.
class SurfaceColour {
 public:
  SurfaceColour(const TriMesh& mesh, double sample_area) : mesh_(mesh), sample_area_(sample_area) {
    for (const Image& image : mesh.textures) textures_.emplace_back(image);
  }

  /// Scene linear colour and opacity of the sample `index` at a place of a triangle.
  std::array<float, 4> at(size_t triangle, const Barycentric& place, double triangle_area,
                          uint64_t random) const {
    const size_t index = mesh_.triangle_materials.empty() ? 0 : mesh_.triangle_materials[triangle];
    const Material& material = mesh_.materials[index];
    std::array<float, 4> colour = {material.base_colour[0], material.base_colour[1],
                                   material.base_colour[2], material.base_colour[3]};
    if (material.colour == MaterialColour::kTexture) {
      colour = textured(textures_[material.texture], triangle, place, triangle_area, random);
    } else if (material.colour == MaterialColour::kCorner) {
      colour = interpolated(triangle, place);
    }
    colour[3] = std::clamp(colour[3], 0.0f, 1.0f);
    return colour;
  }

 private:
  std::array<float, 4> interpolated(size_t triangle, const Barycentric& place) const {
    std::array<float, 4> colour = {0, 0, 0, 0};
    for (size_t corner = 0; corner < 3; ++corner) {
      for (size_t c = 0; c < 4; ++c) {
        colour[c] += static_cast<float>(place[corner]) *
                     mesh_.corner_colours[triangle * 12 + corner * 4 + c];
      }
    }
    return colour;
  }

  std::array<float, 4> lookUp(const TextureLookup& texture, size_t triangle,
                              const Barycentric& place) const {
    const float* uv = &mesh_.corner_uvs[triangle * 6];
    float u = 0, v = 0;
    for (size_t corner = 0; corner < 3; ++corner) {
      u += static_cast<float>(place[corner]) * uv[corner * 2];
      v += static_cast<float>(place[corner]) * uv[corner * 2 + 1];
    }
    return texture.at(u, v);
  }

  /// Mean over the piece of the triangle that the sample stands for: one tap per two texels, at
  /// most eight, so that a fine texture does not alias into speckles.
  std::array<float, 4> textured(const TextureLookup& texture, size_t triangle,
                                const Barycentric& place, double triangle_area,
                                uint64_t random) const {
    const float* uv = &mesh_.corner_uvs[triangle * 6];
    const double du[2] = {static_cast<double>(uv[2] - uv[0]), static_cast<double>(uv[4] - uv[0])};
    const double dv[2] = {static_cast<double>(uv[3] - uv[1]), static_cast<double>(uv[5] - uv[1])};
    const double share = std::min(1.0, sample_area_ / triangle_area);
    const double texels =
        0.5 * std::abs(du[0] * dv[1] - du[1] * dv[0]) * texture.width() * texture.height() * share;
    const auto taps = static_cast<uint64_t>(
        std::clamp(std::ceil(texels / 2), 1.0, static_cast<double>(kMaxTapCount)));
    if (taps == 1) return lookUp(texture, triangle, place);
    // Side of the sample's square where the triangle is the lower half of the unit square.
    const double side = std::sqrt(0.5 * share);
    const double start[2] = {unitDouble(mixBits(random)), unitDouble(mixBits(~random))};
    std::array<double, 4> sum = {0, 0, 0, 0};
    for (uint64_t tap = 0; tap < taps; ++tap) {
      double x = start[0] + kPlastic1 * static_cast<double>(tap);
      double y = start[1] + kPlastic2 * static_cast<double>(tap);
      x = place[1] + (x - std::floor(x) - 0.5) * side;
      y = place[2] + (y - std::floor(y) - 0.5) * side;
      Barycentric at = {std::max(0.0, 1 - x - y), std::max(0.0, x), std::max(0.0, y)};
      const double total = at[0] + at[1] + at[2];
      for (double& weight : at) weight /= total;
      const std::array<float, 4> colour = lookUp(texture, triangle, at);
      // Colour weighted by alpha: transparent texels do not bleed theirs.
      for (size_t c = 0; c < 3; ++c) sum[c] += static_cast<double>(colour[c] * colour[3]);
      sum[3] += static_cast<double>(colour[3]);
    }
    if (sum[3] <= 0) {
      std::array<float, 4> colour = lookUp(texture, triangle, place);
      colour[3] = 0;
      return colour;
    }
    return {static_cast<float>(sum[0] / sum[3]), static_cast<float>(sum[1] / sum[3]),
            static_cast<float>(sum[2] / sum[3]),
            static_cast<float>(sum[3] / static_cast<double>(taps))};
  }

  const TriMesh& mesh_;
  double sample_area_;
  std::vector<TextureLookup> textures_;
};

void requireOptions(const SurfaceSamplingOptions& options) {
  constexpr uint64_t kMaxSampleCount = uint64_t{1} << 28;
  if (options.count == 0 || options.count > kMaxSampleCount) {
    fail(ErrorCode::kInvalidArgument, "surface sample count is " + std::to_string(options.count) +
                                          "; 1 to 268435456 is allowed");
  }
  if (!std::isfinite(options.detail_weight) || options.detail_weight < 0) {
    fail(ErrorCode::kInvalidArgument,
         "detail weight is " + std::to_string(options.detail_weight) + "; 0 or more is allowed");
  }
}

}  // namespace

PointSet sampleSurface(const TriMesh& mesh, const SurfaceSamplingOptions& options,
                       Progress* progress) {
  requireOptions(options);
  validate(mesh);
  advance(progress, 0.0, "Sampling the surface");
  const std::vector<double> running = runningAreas(mesh);
  const double area = running.back();
  const size_t count = options.count;
  const double stratum = area / static_cast<double>(count);
  const SurfaceColour colour_of(mesh, stratum);

  PointSet samples;
  samples.positions.resize(count * 3);
  samples.normals.resize(count * 3);
  samples.colours.resize(count * 3);
  samples.opacities.resize(count);
  samples.areas.assign(count, static_cast<float>(stratum));
  samples.weights.assign(count, static_cast<float>(stratum));

  const auto heightOf = [&](size_t i) {
    const double jitter = unitDouble(keyedBits(options.seed, RandomUse::kSurfaceSample, i));
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
      const double low = triangle == 0 ? 0.0 : running[triangle - 1];
      const uint64_t random =
          keyedBits(~options.seed, RandomUse::kSurfaceSample, static_cast<uint64_t>(triangle));
      const auto ordinal = static_cast<double>(i - std::min(first, i));
      double x = unitDouble(random) + kPlastic1 * ordinal;
      double y = unitDouble(mixBits(random)) + kPlastic2 * ordinal;
      const Barycentric place = foldedPoint(x - std::floor(x), y - std::floor(y));
      const Vec corners[3] = {vertexOf(mesh, triangle, 0), vertexOf(mesh, triangle, 1),
                              vertexOf(mesh, triangle, 2)};
      const Vec normal = unitNormal(mesh, triangle, place);
      const std::array<float, 4> colour =
          colour_of.at(triangle, place, running[triangle] - low, mixBits(random + i));
      for (size_t axis = 0; axis < 3; ++axis) {
        samples.positions[i * 3 + axis] =
            static_cast<float>(place[0] * corners[0][axis] + place[1] * corners[1][axis] +
                               place[2] * corners[2][axis]);
        samples.normals[i * 3 + axis] = static_cast<float>(normal[axis]);
        samples.colours[i * 3 + axis] = colour[axis];
      }
      samples.opacities[i] = colour[3];
    }
  });
  advance(progress, 0.6, "Sampling the surface");
  if (options.detail_weight > 0) {
    const std::vector<float> detail = surfaceDetail(samples, nullptr);
    const double gain = kDetailGain * options.detail_weight;
    parallelFor(count, kSampleGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        samples.weights[i] =
            static_cast<float>(stratum * (1.0 + gain * static_cast<double>(detail[i])));
      }
    });
  }
  advance(progress, 1.0, "Sampling the surface");
  return samples;
}

}  // namespace stipple
