// Based on: Zwicker, Pfister, van Baar, Gross, Surface Splatting, SIGGRAPH 2001 (splats overlap
// until the surface is closed). Differs: sizes follow from the opacity measured at the samples.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "base/parallel.h"
#include "decode/surface/splat_shapes.h"
#include "decode/surface/tangent_frame.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1024;
constexpr float kMaxOpacity = 0.99f;
constexpr float kMaxWidth = 1.04f;  ///< in spacings, of a splat that grows
constexpr float kRounding = 0.5f;
constexpr float kBorderReach = 2.0f;    ///< spacings within which borders count
constexpr float kFadingBand = 0.3f;     ///< spacings from a border that need not be closed
constexpr float kSidewaysCost = 0.35f;  ///< of a border sample off the direction of its border
constexpr float kOtherBorder = 0.7f;    ///< directions with a smaller cosine belong to two borders
constexpr float kSameSheet = 0.3f;      ///< n·n' of splats that close a place together
constexpr float kTargetOpen = 0.0055f;  ///< transmittance wanted at every sample inside
/// σ₁σ₂ over the area of the patch at which spread-out splats let 2 % of the light pass:
/// −ln 0.02 / (0.99 · 2π) = 0.63, and a little for the unevenness of the sites.
constexpr float kSmallMass = 0.66f;
constexpr int kCoverageRounds = 2;  ///< one more for few sites
/// A splat ends, at this many standard deviations, one spacing over an open border: 6 % of its
/// opacity are left there. Over a crease, where two faces' splats add up, it ends sooner and
/// closer.
constexpr float kBorderSigmas = 2.35f;
constexpr float kCreaseSigmas = 2.9f;
constexpr float kOverCrease = 0.85f;  ///< spacings

/// exp(−q/2) for q >= 0, relative error below 1e-4 up to q = 40, constant (2e-9) beyond. Without
/// float comparisons, which would keep loops over it from being vectorised.
inline float response(float q) {
  // Floats that are not negative are ordered like their bits.
  constexpr int32_t kFarthest = std::bit_cast<int32_t>(40.0f);
  const int32_t bits = std::bit_cast<int32_t>(q);
  const float t = -0.72134752f * std::bit_cast<float>(bits < kFarthest ? bits : kFarthest);
  const int32_t whole = static_cast<int32_t>(t) - 1;
  const float f = t - static_cast<float>(whole);  // in (0, 1]
  // 2^f on [0,1]
  const float p =
      1.0000026f + f * (0.69300383f + f * (0.24144275f + f * (0.05201146f + f * 0.01353417f)));
  return p * std::bit_cast<float>((whole + 127) << 23);
}

/// Stretches shape i by `factor` along a direction of its plane (given in space, not normalised).
void scaleAlong(SplatShapes& shapes, size_t i, const float* direction, float factor) {
  const float* n = &shapes.normals[i * 3];
  const float* e = &shapes.majors[i * 3];
  TangentFrame frame(n);
  for (size_t axis = 0; axis < 3; ++axis) frame.u[axis] = e[axis];
  frame.v[0] = n[1] * e[2] - n[2] * e[1];
  frame.v[1] = n[2] * e[0] - n[0] * e[2];
  frame.v[2] = n[0] * e[1] - n[1] * e[0];
  double a = 0, b = 0;
  for (size_t axis = 0; axis < 3; ++axis) {
    a += static_cast<double>(direction[axis] * frame.u[axis]);
    b += static_cast<double>(direction[axis] * frame.v[axis]);
  }
  const double length = std::sqrt(a * a + b * b);
  if (length < 1e-12) return;
  a /= length;
  b /= length;
  const double gain = static_cast<double>(factor) - 1.0;
  const double s00 = 1 + gain * a * a, s01 = gain * a * b, s11 = 1 + gain * b * b;
  const auto first = static_cast<double>(shapes.sigmas[i * 3]);
  const auto second = static_cast<double>(shapes.sigmas[i * 3 + 1]);
  const double p = first * first, q = second * second;
  setAxes(shapes, i, frame, s00 * s00 * p + s01 * s01 * q, s00 * s01 * p + s01 * s11 * q,
          s01 * s01 * p + s11 * s11 * q);
}

/// Narrows shape i until it ends within a spacing over its borders.
void keepWithinBorders(SplatShapes& shapes, size_t i) {
  for (size_t which = 0; which < 2; ++which) {
    const float* border = &shapes.borders[i * 10 + which * 5];
    if (!(border[3] < std::numeric_limits<float>::infinity())) return;
    const float* n = &shapes.normals[i * 3];
    const float* e = &shapes.majors[i * 3];
    const float minor[3] = {n[1] * e[2] - n[2] * e[1], n[2] * e[0] - n[0] * e[2],
                            n[0] * e[1] - n[1] * e[0]};
    const float a = border[0] * e[0] + border[1] * e[1] + border[2] * e[2];
    const float b = border[0] * minor[0] + border[1] * minor[1] + border[2] * minor[2];
    const float s = shapes.sigmas[i * 3], t = shapes.sigmas[i * 3 + 1];
    // Standard deviation of the splat seen along the border.
    const float width = std::sqrt(a * a * s * s + b * b * t * t);
    if (width > border[4]) scaleAlong(shapes, i, border, border[4] / width);
  }
}

/// Widens shape i until the surface stays closed where splats are smaller than a pixel and the mip
/// low-pass spreads them evenly: there only the sum of their masses counts.
void closeWhenSmall(SplatShapes& shapes, size_t i, float largest) {
  float* sigma = &shapes.sigmas[i * 3];
  const float wanted = kSmallMass * shapes.areas[i];
  const float product = sigma[0] * sigma[1];
  if (product >= wanted || product <= 0) return;
  const float factor = 1 + shapes.growths[i] * (std::sqrt(wanted / product) - 1);
  for (size_t axis = 0; axis < 2; ++axis) {
    sigma[axis] = std::min(sigma[axis] * factor, std::max(sigma[axis], largest));
  }
}

/// Shapes around a cell in blocks of contiguous rows: centre, tangent axes over their sigmas,
/// normal. The last block is padded with shapes infinitely far away.
struct ShapeCandidates {
  static constexpr size_t kBlock = 16;
  struct Block {
    float rows[12][kBlock];
  };
  std::vector<Block> blocks;

  void gather(const SurfaceSites& sites, const SplatShapes& shapes, uint64_t code) {
    std::array<uint32_t, 27> around;
    const CellTable& table = sites.cells[0];
    const size_t cell_count = sites.neighbours(code, around);
    size_t count = 0;
    for (size_t c = 0; c < cell_count; ++c) count += table.end(around[c]) - table.begin(around[c]);
    blocks.resize((count + kBlock - 1) / kBlock);
    size_t k = 0;
    for (size_t c = 0; c < cell_count; ++c) {
      for (size_t i = table.begin(around[c]); i < table.end(around[c]); ++i, ++k) {
        Block& block = blocks[k / kBlock];
        const size_t lane = k % kBlock;
        const float* n = &shapes.normals[i * 3];
        const float* e = &shapes.majors[i * 3];
        const float minor[3] = {n[1] * e[2] - n[2] * e[1], n[2] * e[0] - n[0] * e[2],
                                n[0] * e[1] - n[1] * e[0]};
        const float first = 1.0f / shapes.sigmas[i * 3];
        const float second = 1.0f / shapes.sigmas[i * 3 + 1];
        for (size_t axis = 0; axis < 3; ++axis) {
          block.rows[axis][lane] = shapes.centres[i * 3 + axis];
          block.rows[3 + axis][lane] = e[axis] * first;
          block.rows[6 + axis][lane] = minor[axis] * second;
          block.rows[9 + axis][lane] = n[axis];
        }
      }
    }
    for (; k < blocks.size() * kBlock; ++k) {
      for (size_t row = 0; row < 12; ++row)
        blocks.back().rows[row][k % kBlock] = row < 3 ? 1e6f : 1.0f;
    }
  }

  /// Share of light that passes all splats of the same sheet at a sample, seen face-on.
  float transmittance(const float* p, const float* n) const {
    const float px = p[0], py = p[1], pz = p[2], nx = n[0], ny = n[1], nz = n[2];
    // One product per lane: every step of the loop is the same for all lanes.
    float passed[kBlock];
    for (float& lane : passed) lane = 1.0f;
    for (const Block& block : blocks) {
      for (size_t k = 0; k < kBlock; ++k) {
        const float dx = px - block.rows[0][k], dy = py - block.rows[1][k],
                    dz = pz - block.rows[2][k];
        const float a = dx * block.rows[3][k] + dy * block.rows[4][k] + dz * block.rows[5][k];
        const float b = dx * block.rows[6][k] + dy * block.rows[7][k] + dz * block.rows[8][k];
        const float turn = nx * block.rows[9][k] + ny * block.rows[10][k] + nz * block.rows[11][k];
        // Splats of other sheets do not close this one: the sign of the difference clears the bits.
        const int32_t other = std::bit_cast<int32_t>(turn - kSameSheet) >> 31;
        const int32_t r = std::bit_cast<int32_t>(response(a * a + b * b)) & ~other;
        passed[k] *= 1.0f - kMaxOpacity * std::bit_cast<float>(r);
      }
    }
    float result = 1.0f;
    for (const float lane : passed) result *= lane;
    return result;
  }
};

}  // namespace

void findNearBorders(const SurfaceBorders& borders, const SurfaceSites& sites,
                     SplatShapes& shapes) {
  const int level = std::max(0, sites.level - 1);
  const CellTable table(borders.codes, 3 * (SurfaceIndex::kCodeLevel - level), level);
  parallelFor(sites.cells[0].size(), 64, [&](size_t first, size_t last) {
    std::array<uint32_t, 27> around;
    for (size_t cell = first; cell < last; ++cell) {
      const size_t cell_count =
          table.size() == 0
              ? 0
              : table.neighbours(sites.cells[0].code(cell) >> (3 * (sites.level - level)), around);
      for (size_t i = sites.cells[0].begin(cell); i < sites.cells[0].end(cell); ++i) {
        const float reach = kBorderReach * sites.spacings[i];
        const float* c = &shapes.centres[i * 3];
        const float* n = &shapes.normals[i * 3];
        float* near = &shapes.borders[i * 10];
        for (size_t which = 0; which < 2; ++which) {
          float best = reach * (1 + kSidewaysCost);
          for (size_t k = 0; k < cell_count; ++k) {
            for (size_t j = table.begin(around[k]); j < table.end(around[k]); ++j) {
              const float* p = &borders.positions[j * 3];
              const float d[3] = {p[0] - c[0], p[1] - c[1], p[2] - c[2]};
              const float squared = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
              if (squared > reach * reach) continue;
              const float* m = &borders.normals[j * 3];
              if (n[0] * m[0] + n[1] * m[1] + n[2] * m[2] < 0.5f) continue;
              const float* o = &borders.outwards[j * 3];
              if (which == 1 && o[0] * near[0] + o[1] * near[1] + o[2] * near[2] > kOtherBorder) {
                continue;
              }
              const float distance = std::max(0.0f, d[0] * o[0] + d[1] * o[1] + d[2] * o[2]);
              const float sideways = std::sqrt(std::max(0.0f, squared - distance * distance));
              const float cost = distance + kSidewaysCost * sideways;
              if (cost >= best) continue;
              best = cost;
              for (size_t axis = 0; axis < 3; ++axis) near[which * 5 + axis] = o[axis];
              near[which * 5 + 3] = distance;
              near[which * 5 + 4] =
                  borders.open[j] ? (distance + sites.spacings[i]) / kBorderSigmas
                                  : (distance + kOverCrease * sites.spacings[i]) / kCreaseSigmas;
            }
          }
          if (!(near[which * 5 + 3] < reach)) break;
        }
        if (near[3] < reach) continue;
        float* sigma = &shapes.sigmas[i * 3];
        const float mean = 0.5f * (sigma[0] * sigma[0] + sigma[1] * sigma[1]);
        for (size_t axis = 0; axis < 2; ++axis) {
          sigma[axis] =
              std::sqrt(sigma[axis] * sigma[axis] * (1.0f - kRounding) + mean * kRounding);
        }
      }
    }
  });
}

void balanceCoverage(const SurfaceIndex& index, const SurfaceSites& sites,
                     const SurfacePatches& patches, SplatShapes& shapes, Progress* progress) {
  std::vector<float> open(patches.sample_count);
  const int rounds = kCoverageRounds + (sites.size() <= kFewSites ? 1 : 0);
  for (int round = 0; round < rounds; ++round) {
    forSampleRuns(index, patches, sites.level, [&](size_t begin, size_t end, uint64_t code) {
      if (progress) progress->throwIfCancelled();
      thread_local ShapeCandidates near;
      near.gather(sites, shapes, code);
      for (size_t i = begin; i < end; ++i) {
        const size_t sample = patches.sampleOf(i);
        const float* p = &index.positions[sample * 3];
        const float* n = &index.normals[sample * 3];
        open[i] = near.transmittance(p, n);
      }
    });
    parallelFor(sites.size(), kGrain, [&](size_t first, size_t last) {
      for (size_t i = first; i < last; ++i) {
        const float* border = &shapes.borders[i * 10];
        const bool bordered = border[3] < std::numeric_limits<float>::infinity();
        const float* c = &shapes.centres[i * 3];
        float worst = 0;
        for (size_t k = patches.begins[i]; k < patches.begins[i + 1]; ++k) {
          const size_t member = patches.members[k];
          const float* p = &index.positions[patches.sampleOf(member) * 3];
          // Within a spacing of a border the surface may fade.
          if (bordered && border[3] - ((p[0] - c[0]) * border[0] + (p[1] - c[1]) * border[1] +
                                       (p[2] - c[2]) * border[2]) <
                              sites.spacings[i] * kFadingBand) {
            continue;
          }
          worst = std::max(worst, open[member]);
        }
        if (patches.begins[i] == patches.begins[i + 1]) continue;
        // A patch that fades altogether keeps its size.
        if (worst == 0) worst = kTargetOpen;
        const float scale = worst > kTargetOpen
                                ? std::min(1.3f, std::pow(worst / kTargetOpen, 0.15f))
                                : std::max(0.9f, std::pow(worst / kTargetOpen, 0.05f));
        const float factor = scale > 1 ? 1 + shapes.growths[i] * (scale - 1) : scale;
        const float largest = kMaxWidth * sites.spacings[i];
        for (size_t axis = 0; axis < 2; ++axis) {
          float& sigma = shapes.sigmas[i * 3 + axis];
          // No splat grows beyond about its spacing: a hole that this leaves belongs to others.
          sigma = std::min(sigma * factor, std::max(sigma, largest));
        }
        if (round + 1 == rounds) closeWhenSmall(shapes, i, largest);
        keepWithinBorders(shapes, i);
      }
    });
  }
}

}  // namespace stipple
