#include "decode/splat_shapes.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <functional>
#include <limits>

#include "base/parallel.h"
#include "decode/tangent_frame.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1024;
constexpr float kMaxOpacity = 0.99f;
/// Standard deviation of a splat over that of its patch. On a square pattern of side s a patch has
/// s/√12; 2.3 of it is 0.66 s, where four splats leave 2 % open in the middle between them.
constexpr float kPatchScale = 2.3f;
constexpr float kMinPatchScale = 1.7f;
constexpr float kMaxPatchScale = 3.6f;
constexpr float kMaxAspect = 5.0f;
/// Thickness over the smaller width: thin, yet several voxels can resolve it and it is seen
/// edge-on.
constexpr float kThickness = 0.1f;
constexpr float kMaxThickness = 0.35f;
constexpr float kTargetOpen = 0.012f;  ///< transmittance wanted at every sample inside
constexpr float kCoverageRounds = 2;

struct Moments {
  double area = 0;
  double mean[3] = {0, 0, 0};  ///< about the site
  double normal[3] = {0, 0, 0};
  double second[6] = {0, 0, 0, 0, 0, 0};  ///< xx, xy, xz, yy, yz, zz about the site
  double colour[3] = {0, 0, 0};
  double opacity = 0;
};

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
      m.colour[axis] += area * static_cast<double>(index.colours[i * 3 + axis]) *
                        (static_cast<double>(index.opacities[i]) + 1e-4);
    }
    m.second[0] += area * d[0] * d[0];
    m.second[1] += area * d[0] * d[1];
    m.second[2] += area * d[0] * d[2];
    m.second[3] += area * d[1] * d[1];
    m.second[4] += area * d[1] * d[2];
    m.second[5] += area * d[2] * d[2];
    m.opacity += area * static_cast<double>(index.opacities[i]);
    m.area += area;
  }
  if (m.area > 0) {
    for (double& value : m.mean) value /= m.area;
    for (double& value : m.second) value /= m.area;
    for (double& value : m.colour) value /= m.opacity + 1e-4 * m.area;
    m.opacity /= m.area;
  }
  return m;
}

/// Mean normal of a patch; that of the site where the patch folds so far that its normals cancel.
void meanNormal(const Moments& m, const float* site_normal, float* out) {
  const double length =
      std::sqrt(m.normal[0] * m.normal[0] + m.normal[1] * m.normal[1] + m.normal[2] * m.normal[2]);
  for (size_t axis = 0; axis < 3; ++axis) {
    out[axis] =
        length > 0.3 * m.area ? static_cast<float>(m.normal[axis] / length) : site_normal[axis];
  }
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

/// exp(−q/2), relative error below 3e-5; 0 beyond the renderer's cut-off (1/255).
inline float response(float q) {
  if (q > 11.1f) return 0.0f;
  const float t = -0.72134752f * q;  // to base 2
  const float whole = std::floor(t);
  const float f = t - whole;
  // 2^f on [0,1), minimax of degree 4.
  const float p =
      1.0000026f + f * (0.69300383f + f * (0.24144275f + f * (0.05201146f + f * 0.01353417f)));
  return p * std::bit_cast<float>((static_cast<int32_t>(whole) + 127) << 23);
}

/// Writes the axes and standard deviations of shape i from a covariance in the frame of its normal.
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

/// Shapes around a cell as contiguous arrays: centre, tangent axes over their sigmas, normal.
struct ShapeCandidates {
  std::vector<uint32_t> site;
  std::vector<float> data;  ///< [12][count]
  size_t count = 0;

  const float* row(size_t r) const { return &data[r * count]; }

  void gather(const SurfaceSites& sites, const SplatShapes& shapes, uint64_t code) {
    std::array<uint32_t, 27> around;
    const CellTable& table = sites.cells[0];
    const size_t cell_count = table.neighbours(code, around);
    site.clear();
    for (size_t c = 0; c < cell_count; ++c) {
      for (uint32_t i = table.begin(around[c]); i < table.end(around[c]); ++i) site.push_back(i);
    }
    count = site.size();
    data.resize(count * 12);
    for (size_t k = 0; k < count; ++k) {
      const size_t i = site[k];
      const float* c = &shapes.centres[i * 3];
      const float* n = &shapes.normals[i * 3];
      const float* e = &shapes.majors[i * 3];
      const float minor[3] = {n[1] * e[2] - n[2] * e[1], n[2] * e[0] - n[0] * e[2],
                              n[0] * e[1] - n[1] * e[0]};
      const float first = 1.0f / shapes.sigmas[i * 3];
      const float second = 1.0f / shapes.sigmas[i * 3 + 1];
      for (size_t axis = 0; axis < 3; ++axis) {
        data[axis * count + k] = c[axis];
        data[(3 + axis) * count + k] = e[axis] * first;
        data[(6 + axis) * count + k] = minor[axis] * second;
        data[(9 + axis) * count + k] = n[axis];
      }
    }
  }
};

}  // namespace

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
  shapes.supports.assign(count, 1.0f);
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
      meanNormal(m, &sites.normals[i * 3], normal);
      surfaceCentre(index, patches, m, site, normal, begin, end, centre);
      double covariance[6];
      const size_t rows[6] = {0, 0, 0, 1, 1, 2}, columns[6] = {0, 1, 2, 1, 2, 2};
      for (size_t k = 0; k < 6; ++k) {
        covariance[k] = m.second[k] - m.mean[rows[k]] * m.mean[columns[k]];
      }
      const TangentFrame frame(normal);
      const double scale = static_cast<double>(kPatchScale * kPatchScale);
      setAxes(shapes, i, frame, scale * (quadratic(covariance, frame.u, frame.u) + grain),
              scale * quadratic(covariance, frame.u, frame.v),
              scale * (quadratic(covariance, frame.v, frame.v) + grain));
      const auto height =
          static_cast<float>(std::sqrt(std::max(0.0, quadratic(covariance, normal, normal))));
      const float width = shapes.sigmas[i * 3 + 1];
      shapes.sigmas[i * 3 + 2] = std::clamp(height, kThickness * width, kMaxThickness * width);
      shapes.areas[i] = static_cast<float>(m.area) * static_cast<float>(patches.stride);
      for (size_t c = 0; c < 3; ++c) {
        shapes.colours[i * 3 + c] = static_cast<float>(m.colour[c]);
      }
      shapes.opacities[i] = std::clamp(static_cast<float>(m.opacity), 0.0f, 1.0f);
    }
  });
  return shapes;
}

void trimBorders(const SurfaceSites& sites, SplatShapes& shapes) {
  // Reads the untrimmed shapes, writes new ones: independent of the order of the sites.
  const SplatShapes before = shapes;
  const CellTable& table = sites.cells[0];
  parallelFor(table.size(), 64, [&](size_t first, size_t last) {
    std::array<uint32_t, 27> around;
    for (size_t cell = first; cell < last; ++cell) {
      const size_t cell_count = table.neighbours(table.code(cell), around);
      for (size_t i = table.begin(cell); i < table.end(cell); ++i) {
        const float* c = &before.centres[i * 3];
        const float* n = &before.normals[i * 3];
        // A Gaussian window of one spacing over the patches' areas: 1 in the midst of the surface,
        // 1/2 on a straight border; its mean offset points inwards.
        const float width = sites.spacings[i];
        const float factor = 1.0f / (width * width);
        float mass = 0, offset[3] = {0, 0, 0};
        for (size_t k = 0; k < cell_count; ++k) {
          for (uint32_t j = table.begin(around[k]); j < table.end(around[k]); ++j) {
            const float* q = &before.centres[size_t{j} * 3];
            const float* m = &before.normals[size_t{j} * 3];
            if (n[0] * m[0] + n[1] * m[1] + n[2] * m[2] < -0.2f) continue;
            const float d[3] = {q[0] - c[0], q[1] - c[1], q[2] - c[2]};
            const float share =
                before.areas[j] * response(factor * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]));
            mass += share;
            for (size_t axis = 0; axis < 3; ++axis) offset[axis] += share * d[axis];
          }
        }
        const float support = std::min(1.0f, mass * factor * 0.15915494f);
        shapes.supports[i] = support;
      }
    }
  });
}

void balanceCoverage(const SurfaceIndex& index, const SurfaceSites& sites,
                     const SurfacePatches& patches, SplatShapes& shapes, Progress* progress) {
  std::vector<float> open(patches.sample_count);
  for (int round = 0; round < kCoverageRounds; ++round) {
    forSampleRuns(index, patches, sites.level, [&](size_t begin, size_t end, uint64_t code) {
      if (progress) progress->throwIfCancelled();
      thread_local ShapeCandidates near;
      near.gather(sites, shapes, code);
      for (size_t i = begin; i < end; ++i) {
        const size_t sample = patches.sampleOf(i);
        const float* p = &index.positions[sample * 3];
        const float* n = &index.normals[sample * 3];
        float transmittance = 1.0f;
        for (size_t k = 0; k < near.count; ++k) {
          const float d[3] = {p[0] - near.row(0)[k], p[1] - near.row(1)[k], p[2] - near.row(2)[k]};
          const float a = d[0] * near.row(3)[k] + d[1] * near.row(4)[k] + d[2] * near.row(5)[k];
          const float b = d[0] * near.row(6)[k] + d[1] * near.row(7)[k] + d[2] * near.row(8)[k];
          const float q = a * a + b * b;
          if (q > 11.1f) continue;
          // Splats of other sheets do not close this one.
          const float turn =
              n[0] * near.row(9)[k] + n[1] * near.row(10)[k] + n[2] * near.row(11)[k];
          if (turn < 0.3f) continue;
          transmittance *= 1.0f - kMaxOpacity * response(q);
        }
        open[i] = transmittance;
      }
    });
    parallelFor(sites.size(), kGrain, [&](size_t first, size_t last) {
      for (size_t i = first; i < last; ++i) {
        float worst = 0;
        for (size_t k = patches.begins[i]; k < patches.begins[i + 1]; ++k) {
          worst = std::max(worst, open[patches.members[k]]);
        }
        if (patches.begins[i] == patches.begins[i + 1]) continue;
        float scale = 1.0f;
        if (worst > kTargetOpen) {
          scale = std::min(1.3f, std::pow(worst / kTargetOpen, 0.12f));
        } else {
          scale = std::max(0.9f, std::pow(worst / kTargetOpen, 0.05f));
        }
        for (size_t axis = 0; axis < 2; ++axis) shapes.sigmas[i * 3 + axis] *= scale;
      }
    });
  }
}

}  // namespace stipple
