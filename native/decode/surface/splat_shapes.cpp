#include "decode/surface/splat_shapes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/parallel.h"
#include "decode/surface/tangent_frame.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1024;
/// Standard deviation of a splat over that of its patch. On a square pattern of side s a patch has
/// s/√12, and 2.15 of it is 0.62 s: a little less than closes it, since sizes are balanced
/// afterwards.
constexpr float kPatchScale = 2.15f;
/// A patch that wraps half around a rod of radius r has mean (n·u)² = 1/2 across the rod; 0.45 of
/// the size that a flat patch of its width would get keeps its flat splat from sticking out.
constexpr double kCurvedTrim = 1.1;
constexpr float kMaxAspect = 5.0f;
/// Thickness over the smaller width. Splats of a silhouette are seen edge-on, many behind each
/// other: thicker ones make a rim around it.
constexpr float kThickness = 0.03f;
constexpr float kMaxThickness = 0.35f;
constexpr float kHeightScale = 1.0f;  ///< thickness over the standard deviation of heights
/// Mean normal length of a patch from which on its splat may grow, and may grow fully: a flat splat
/// on a curved patch sticks out at the silhouette.
constexpr double kNoGrowth = 0.943;
constexpr double kLeastGrowth = 0.0;
constexpr double kFullGrowth = 0.986;

struct Moments {
  double area = 0;
  double mean[3] = {0, 0, 0};  ///< about the site
  double normal[3] = {0, 0, 0};
  double second[6] = {0, 0, 0, 0, 0, 0};  ///< xx, xy, xz, yy, yz, zz about the site
  double turns[6] = {0, 0, 0, 0, 0, 0};   ///< the same of the normals
  double widening = 0;  ///< of normal · place: how far the normals spread with the places
  double colour[3] = {0, 0, 0};
  double opacity = 0;
};

double weightOfColour(const SurfaceIndex& index, size_t sample) {
  return static_cast<double>(index.areas[sample]) *
         (static_cast<double>(index.opacities[sample]) + 1e-4);
}

/// Sums over the samples of a patch, weighted by area. Colours are weighted by opacity as well, so
/// that what cannot be seen has no say.
Moments patchMoments(const SurfaceIndex& index, const SurfacePatches& patches, const float* site,
                     size_t begin, size_t end) {
  Moments m;
  for (size_t k = begin; k < end; ++k) {
    const size_t i = patches.sampleOf(patches.members[k]);
    const auto area = static_cast<double>(index.areas[i]);
    double d[3];
    for (size_t axis = 0; axis < 3; ++axis) {
      d[axis] = static_cast<double>(index.positions[i * 3 + axis] - site[axis]);
      m.mean[axis] += area * d[axis];
      m.normal[axis] += area * static_cast<double>(index.normals[i * 3 + axis]);
      m.colour[axis] += weightOfColour(index, i) * static_cast<double>(index.colours[i * 3 + axis]);
    }
    m.second[0] += area * d[0] * d[0];
    m.second[1] += area * d[0] * d[1];
    m.second[2] += area * d[0] * d[2];
    m.second[3] += area * d[1] * d[1];
    m.second[4] += area * d[1] * d[2];
    m.second[5] += area * d[2] * d[2];
    const double n[3] = {static_cast<double>(index.normals[i * 3]),
                         static_cast<double>(index.normals[i * 3 + 1]),
                         static_cast<double>(index.normals[i * 3 + 2])};
    m.widening += area * (n[0] * d[0] + n[1] * d[1] + n[2] * d[2]);
    m.turns[0] += area * n[0] * n[0];
    m.turns[1] += area * n[0] * n[1];
    m.turns[2] += area * n[0] * n[2];
    m.turns[3] += area * n[1] * n[1];
    m.turns[4] += area * n[1] * n[2];
    m.turns[5] += area * n[2] * n[2];
    m.opacity += area * static_cast<double>(index.opacities[i]);
    m.area += area;
  }
  if (m.area > 0) {
    for (double& value : m.mean) value /= m.area;
    for (double& value : m.second) value /= m.area;
    for (double& value : m.turns) value /= m.area;
    m.widening =
        (m.widening - m.normal[0] * m.mean[0] - m.normal[1] * m.mean[1] - m.normal[2] * m.mean[2]) /
        m.area;
    for (double& value : m.colour) value /= m.opacity + 1e-4 * m.area;
    m.opacity /= m.area;
  }
  return m;
}

/// Mean normal of a patch; that of the site where the patch folds so far that its normals cancel.
/// Returns the length of the mean of the unit normals: 1 for a flat patch.
double meanNormal(const Moments& m, const float* site_normal, float* out) {
  const double length =
      std::sqrt(m.normal[0] * m.normal[0] + m.normal[1] * m.normal[1] + m.normal[2] * m.normal[2]);
  for (size_t axis = 0; axis < 3; ++axis) {
    out[axis] =
        length > 0.3 * m.area ? static_cast<float>(m.normal[axis] / length) : site_normal[axis];
  }
  return length / m.area;
}

/// Middle of the patch, put on the tangent plane of the patch's sample nearest to it.
void surfaceCentre(const SurfaceIndex& index, const SurfacePatches& patches, const Moments& m,
                   const float* site, const float* normal, size_t begin, size_t end, float* out) {
  for (size_t axis = 0; axis < 3; ++axis) out[axis] = site[axis] + static_cast<float>(m.mean[axis]);
  float best = std::numeric_limits<float>::infinity();
  float height = 0;
  for (size_t k = begin; k < end; ++k) {
    const float* p = &index.positions[patches.sampleOf(patches.members[k]) * 3];
    const float d[3] = {out[0] - p[0], out[1] - p[1], out[2] - p[2]};
    const float distance = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    if (distance < best) {
      best = distance;
      height = d[0] * normal[0] + d[1] * normal[1] + d[2] * normal[2];
    }
  }
  for (size_t axis = 0; axis < 3; ++axis) out[axis] -= height * normal[axis];
}

double quadratic(const double* s, const float* a, const float* b) {
  const double x = static_cast<double>(a[0]), y = static_cast<double>(a[1]),
               z = static_cast<double>(a[2]);
  return x * (s[0] * static_cast<double>(b[0]) + s[1] * static_cast<double>(b[1]) +
              s[2] * static_cast<double>(b[2])) +
         y * (s[1] * static_cast<double>(b[0]) + s[3] * static_cast<double>(b[1]) +
              s[4] * static_cast<double>(b[2])) +
         z * (s[2] * static_cast<double>(b[0]) + s[4] * static_cast<double>(b[1]) +
              s[5] * static_cast<double>(b[2]));
}

/// Eigenvalues and first eigenvector (c, s) of [[a, b], [b, d]].
struct Eigen2 {
  double first, second, c, s;
};

Eigen2 eigen2(double a, double b, double d) {
  const double half = 0.5 * (a + d);
  const double difference = 0.5 * (a - d);
  const double radius = std::sqrt(difference * difference + b * b);
  if (radius <= 1e-12 * half) return {half, half, 1.0, 0.0};
  // Of two equivalent forms of the eigenvector, the one without cancellation.
  double x = difference + radius, y = b;
  if (difference < 0) {
    x = b;
    y = radius - difference;
  }
  const double length = std::sqrt(x * x + y * y);
  return {half + radius, std::max(0.0, half - radius), x / length, y / length};
}

}  // namespace

void setAxes(SplatShapes& shapes, size_t i, const TangentFrame& frame, double uu, double uv,
             double vv) {
  const Eigen2 e = eigen2(uu, uv, vv);
  float* major = &shapes.majors[i * 3];
  for (size_t axis = 0; axis < 3; ++axis) {
    major[axis] = static_cast<float>(e.c) * frame.u[axis] + static_cast<float>(e.s) * frame.v[axis];
  }
  const auto first = static_cast<float>(std::sqrt(e.first));
  shapes.sigmas[i * 3] = first;
  shapes.sigmas[i * 3 + 1] = std::max(static_cast<float>(std::sqrt(e.second)), first / kMaxAspect);
}

void centreSites(const SurfaceIndex& index, const SurfacePatches& patches, SurfaceSites& sites) {
  parallelFor(sites.size(), kGrain, [&](size_t first, size_t last) {
    for (size_t i = first; i < last; ++i) {
      const size_t begin = patches.begins[i], end = patches.begins[i + 1];
      if (begin == end) continue;
      float* p = &sites.positions[i * 3];
      const Moments m = patchMoments(index, patches, p, begin, end);
      float normal[3], centre[3];
      meanNormal(m, &sites.normals[i * 3], normal);
      surfaceCentre(index, patches, m, p, normal, begin, end, centre);
      for (size_t axis = 0; axis < 3; ++axis) {
        p[axis] = centre[axis];
        sites.normals[i * 3 + axis] = normal[axis];
      }
    }
  });
}

SplatShapes fitShapes(const SurfaceIndex& index, const SurfaceSites& sites,
                      const SurfacePatches& patches) {
  const size_t count = sites.size();
  SplatShapes shapes;
  shapes.centres.resize(count * 3);
  shapes.normals.resize(count * 3);
  shapes.majors.resize(count * 3);
  shapes.sigmas.resize(count * 3);
  shapes.areas.resize(count);
  shapes.colours.resize(count * 3);
  shapes.opacities.resize(count);
  shapes.curvatures.assign(count, 0.0f);
  shapes.growths.assign(count, 1.0f);
  shapes.borders.assign(count * 10, std::numeric_limits<float>::infinity());
  parallelFor(count, kGrain, [&](size_t first, size_t last) {
    for (size_t i = first; i < last; ++i) {
      const size_t begin = patches.begins[i], end = patches.begins[i + 1];
      const float* site = &sites.positions[i * 3];
      const size_t sample = sites.nearest[i];
      // What a single sample stands for, as a square.
      const double grain =
          static_cast<double>(index.areas[sample]) * static_cast<double>(patches.stride) / 12.0;
      float* normal = &shapes.normals[i * 3];
      float* centre = &shapes.centres[i * 3];
      if (begin == end) {
        // Other sites own all samples around this one; it fills in at the size of a sample.
        for (size_t axis = 0; axis < 3; ++axis) {
          normal[axis] = sites.normals[i * 3 + axis];
          centre[axis] = site[axis];
          shapes.colours[i * 3 + axis] = index.colours[sample * 3 + axis];
        }
        shapes.opacities[i] = index.opacities[sample];
        shapes.areas[i] = 0;
        const double scale = static_cast<double>(kPatchScale * kPatchScale);
        setAxes(shapes, i, TangentFrame(normal), grain * scale, 0, grain * scale);
        shapes.sigmas[i * 3 + 2] = kThickness * shapes.sigmas[i * 3 + 1];
        continue;
      }
      const Moments m = patchMoments(index, patches, site, begin, end);
      const double straight = meanNormal(m, &sites.normals[i * 3], normal);
      shapes.growths[i] = static_cast<float>(
          std::clamp((straight - kNoGrowth) / (kFullGrowth - kNoGrowth), kLeastGrowth, 1.0));
      surfaceCentre(index, patches, m, site, normal, begin, end, centre);
      double covariance[6];
      const size_t rows[6] = {0, 0, 0, 1, 1, 2}, columns[6] = {0, 1, 2, 1, 2, 2};
      for (size_t k = 0; k < 6; ++k) {
        covariance[k] = m.second[k] - m.mean[rows[k]] * m.mean[columns[k]];
      }
      const TangentFrame frame(normal);
      const double across =
          quadratic(covariance, frame.u, frame.u) + quadratic(covariance, frame.v, frame.v);
      shapes.curvatures[i] = static_cast<float>(m.widening / (across + 2 * grain));
      const double scale = static_cast<double>(kPatchScale * kPatchScale);
      const double uu = scale * (quadratic(covariance, frame.u, frame.u) + grain);
      const double uv = scale * quadratic(covariance, frame.u, frame.v);
      const double vv = scale * (quadratic(covariance, frame.v, frame.v) + grain);
      // Narrower in the direction in which the normals turn: S C S with S = 1 − trim · mean(n nᵀ).
      const double s0 = 1 - kCurvedTrim * quadratic(m.turns, frame.u, frame.u);
      const double s1 = -kCurvedTrim * quadratic(m.turns, frame.u, frame.v);
      const double s2 = 1 - kCurvedTrim * quadratic(m.turns, frame.v, frame.v);
      setAxes(shapes, i, frame, s0 * s0 * uu + 2 * s0 * s1 * uv + s1 * s1 * vv,
              s0 * s1 * uu + (s0 * s2 + s1 * s1) * uv + s1 * s2 * vv,
              s1 * s1 * uu + 2 * s1 * s2 * uv + s2 * s2 * vv);
      const auto height =
          kHeightScale *
          static_cast<float>(std::sqrt(std::max(0.0, quadratic(covariance, normal, normal))));
      const float minor = shapes.sigmas[i * 3 + 1];
      shapes.sigmas[i * 3 + 2] = std::clamp(height, kThickness * minor, kMaxThickness * minor);
      shapes.areas[i] = static_cast<float>(m.area) * static_cast<float>(patches.stride);
      for (size_t c = 0; c < 3; ++c) {
        shapes.colours[i * 3 + c] = static_cast<float>(m.colour[c]);
      }
      shapes.opacities[i] = std::clamp(static_cast<float>(m.opacity), 0.0f, 1.0f);
    }
  });
  return shapes;
}

std::vector<float> patchHarmonics(const SurfaceIndex& index, const SurfaceSites& sites,
                                  const SurfacePatches& patches) {
  const size_t stride = index.harmonic_stride;
  std::vector<float> means(sites.size() * stride, 0.0f);
  if (stride == 0) return means;
  parallelFor(sites.size(), kGrain, [&](size_t first, size_t last) {
    std::vector<double> sums(stride);
    for (size_t i = first; i < last; ++i) {
      float* mean = &means[i * stride];
      const size_t begin = patches.begins[i], end = patches.begins[i + 1];
      if (begin == end) {
        std::copy_n(&index.harmonics[sites.nearest[i] * stride], stride, mean);
        continue;
      }
      std::fill(sums.begin(), sums.end(), 0.0);
      double total = 0;
      for (size_t k = begin; k < end; ++k) {
        const size_t sample = patches.sampleOf(patches.members[k]);
        const double weight = weightOfColour(index, sample);
        for (size_t c = 0; c < stride; ++c) {
          sums[c] += weight * static_cast<double>(index.harmonics[sample * stride + c]);
        }
        total += weight;
      }
      if (total <= 0) continue;
      for (size_t c = 0; c < stride; ++c) mean[c] = static_cast<float>(sums[c] / total);
    }
  });
  return means;
}

}  // namespace stipple
