// Based on: Zwicker, Pfister, van Baar, Gross, Surface Splatting, SIGGRAPH 2001 (a surface as
// overlapping flat Gaussians). Patches are the Voronoi cells of the anchors among dense surface
// samples, centred as in Lloyd's method; a splat has the moments of its patch. Differs: sheets are
// told apart by normal and height, and sizes are balanced by the coverage at the samples.
#include "decode/surface/surface_decoder.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "decode/surface/silhouettes.h"
#include "decode/surface/splat_shapes.h"
#include "decode/surface/surface_borders.h"
#include "decode/surface/surface_index.h"
#include "decode/surface/surface_sites.h"
#include "math/colour.h"

namespace stipple {

struct SurfaceDecoder::Index {
  SurfaceIndex samples;
  SurfaceBorders borders;
};

namespace {

/// Rounds of Lloyd's method where time permits more than one: the more regular the sites, the
/// smaller the splats that close the surface.
constexpr int kFewCentringRounds = 3;
/// Samples per site that take part: enough for the middle and for the second moments of a patch,
/// few enough for a slider.
constexpr size_t kCentringSamples = 3;
constexpr size_t kFewSamples = 10;
constexpr size_t kManySamples = 4;

size_t samplesPerSite(size_t site_count) {
  return site_count <= kFewSites ? kFewSamples : kManySamples;
}

/// Unit quaternion w, x, y, z of the rotation whose columns are a, b, c.
/// Based on: Shepperd, Quaternion from Rotation Matrix, 1978.
void quaternionOf(const float* a, const float* b, const float* c, float* out) {
  const float m00 = a[0], m10 = a[1], m20 = a[2];
  const float m01 = b[0], m11 = b[1], m21 = b[2];
  const float m02 = c[0], m12 = c[1], m22 = c[2];
  const float trace = m00 + m11 + m22;
  float q[4];
  if (trace > 0) {
    q[0] = 1 + trace;
    q[1] = m21 - m12;
    q[2] = m02 - m20;
    q[3] = m10 - m01;
  } else if (m00 >= m11 && m00 >= m22) {
    q[0] = m21 - m12;
    q[1] = 1 + m00 - m11 - m22;
    q[2] = m01 + m10;
    q[3] = m02 + m20;
  } else if (m11 >= m22) {
    q[0] = m02 - m20;
    q[1] = m01 + m10;
    q[2] = 1 + m11 - m00 - m22;
    q[3] = m12 + m21;
  } else {
    q[0] = m10 - m01;
    q[1] = m02 + m20;
    q[2] = m12 + m21;
    q[3] = 1 + m22 - m00 - m11;
  }
  const float length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (size_t k = 0; k < 4; ++k) out[k] = q[k] / length;
}

void requireRequest(const DecodeRequest& request) {
  if (!request.anchors) fail(ErrorCode::kInvalidArgument, "decode: the anchors are missing");
  if (request.gaussians_per_anchor == 0 || request.gaussians_per_anchor > 64) {
    fail(ErrorCode::kInvalidArgument, "decode: Gaussians per anchor is " +
                                          std::to_string(request.gaussians_per_anchor) +
                                          "; 1 to 64 is allowed");
  }
  if (request.anchors->size() * request.gaussians_per_anchor > kMaxAnchorCount) {
    fail(ErrorCode::kInvalidArgument,
         "decode: " + std::to_string(request.anchors->size()) + " anchors of " +
             std::to_string(request.gaussians_per_anchor) +
             " Gaussians are too many; 268435456 Gaussians are allowed");
  }
}

/// harmonics: [N,harmonic_stride] of the patches.
SplatCloud cloudOf(const SurfaceIndex& index, const SurfaceSites& sites, const SplatShapes& shapes,
                   const std::vector<float>& harmonics) {
  SplatCloud cloud;
  cloud.sh_degree = index.harmonic_degree;
  cloud.resize(sites.size());
  // Most splats are about a pixel or smaller. The classic low-pass widens each of them at full
  // opacity, which moves silhouettes outward by a pixel and gets worse with more splats; mip keeps
  // their sum.
  cloud.antialias = Antialias::kMip;
  const auto side = static_cast<float>(index.root.side);
  const size_t stride = index.harmonic_stride;
  parallelFor(sites.size(), 1024, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const size_t out = sites.outputs[i];
      const float* n = &shapes.normals[i * 3];
      const float* e = &shapes.majors[i * 3];
      const float minor[3] = {n[1] * e[2] - n[2] * e[1], n[2] * e[0] - n[0] * e[2],
                              n[0] * e[1] - n[1] * e[0]};
      quaternionOf(e, minor, n, &cloud.rotations[out * 4]);
      for (size_t axis = 0; axis < 3; ++axis) {
        cloud.positions[out * 3 + axis] =
            static_cast<float>(index.root.origin[axis] +
                               index.root.side * static_cast<double>(shapes.centres[i * 3 + axis]));
        cloud.scales[out * 3 + axis] = shapes.sigmas[i * 3 + axis] * side;
        cloud.sh[out * (stride + 3) + axis] =
            (linearToSrgb(std::max(0.0f, shapes.colours[i * 3 + axis])) - 0.5f) / kShC0;
      }
      std::copy_n(harmonics.begin() + static_cast<std::ptrdiff_t>(i * stride), stride,
                  cloud.sh.begin() + static_cast<std::ptrdiff_t>(out * (stride + 3) + 3));
      cloud.opacities[out] = std::min(0.99f, shapes.opacities[i]);
    }
  });
  return cloud;
}

}  // namespace

SurfaceDecoder::SurfaceDecoder(std::shared_ptr<const PointSet> surface, const RootCube& root,
                               int leaf_level)
    : surface_(std::move(surface)) {
  if (!surface_ || surface_->size() == 0) {
    fail(ErrorCode::kInvalidArgument, "surface decoder: 0 surface samples; at least 1 is needed");
  }
  SurfaceIndex samples = makeSurfaceIndex(*surface_, root, leaf_level);
  SurfaceBorders borders = findBorders(samples);
  index_ = std::make_unique<const Index>(Index{std::move(samples), std::move(borders)});
}

SurfaceDecoder::~SurfaceDecoder() = default;

SplatCloud SurfaceDecoder::decode(const DecodeRequest& request) const {
  requireRequest(request);
  if (request.anchors->size() == 0) return SplatCloud{};
  const SurfaceIndex& index = index_->samples;
  advance(request.progress, 0.0, "Decoding the surface");
  SurfaceSites sites = projectAnchors(index, request);
  const bool few = sites.size() <= kFewSites;
  const int centring_rounds = few ? kFewCentringRounds : 1;
  for (int round = 0; round < centring_rounds; ++round) {
    centreSites(index, assignSamples(index, sites, kCentringSamples, request.progress), sites);
    sortByCell(index, sites);
  }
  SplatShapes shapes;
  std::vector<float> harmonics;
  {
    const SurfacePatches patches =
        assignSamples(index, sites, samplesPerSite(sites.size()), request.progress);
    advance(request.progress, 0.4, "Decoding the surface");
    shapes = fitShapes(index, sites, patches);
    harmonics = patchHarmonics(index, sites, patches);
    findNearBorders(index_->borders, sites, shapes);
    balanceCoverage(index, sites, patches, shapes, request.progress);
  }
  insetSplats(index, sites, shapes);
  sites.cells = std::vector<CellTable>();
  sites.around = std::vector<std::array<uint32_t, 28>>();
  SplatCloud cloud = cloudOf(index, sites, shapes, harmonics);
  advance(request.progress, 1.0, "Decoding the surface");
  return cloud;
}

uint64_t SurfaceDecoder::memoryBound(uint64_t anchor_count, uint32_t gaussians_per_anchor) const {
  // The most is held while the coverage is balanced: sorting holds the sites twice but no shapes,
  // and the cloud is made when cells and patches are gone.
  constexpr uint64_t kSite = 9 * sizeof(float);
  constexpr uint64_t kShape = 29 * sizeof(float);
  constexpr uint64_t kPatch = 2 * sizeof(uint32_t);  // where its members begin, and a copy
  // Codes, runs and slots of a table, which is at least a quarter full.
  constexpr uint64_t kCell = sizeof(uint64_t) + sizeof(uint32_t) + 4 * sizeof(uint32_t);
  constexpr uint64_t kNeighbours = 28 * sizeof(uint32_t);
  // Each site may have a cell of its own, in each of three tables. On closed surfaces there are 0.4
  // to 0.9 cells a site in the finest table, and a quarter of that in the next: what is held is
  // two thirds of this bound, and more of it for dust.
  constexpr uint64_t kSplat = kSite + kShape + kPatch + 3 * kCell + kNeighbours;
  // Owner, member, start of a run, coverage.
  constexpr uint64_t kSample = 4 * sizeof(uint32_t);
  // Bits of three grids of 256 and fewer cells a side, and what threads gather.
  constexpr uint64_t kFixed = uint64_t{4} << 20;
  const uint64_t splats = anchor_count * gaussians_per_anchor;
  const uint64_t samples =
      surface_->size() / sampleStride(surface_->size(), splats, samplesPerSite(splats));
  const uint64_t harmonics = surface_->harmonicStride() * sizeof(float);
  return splats * (kSplat + harmonics) + samples * kSample + kFixed;
}

}  // namespace stipple
