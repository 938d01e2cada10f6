// Based on: Bendels, Schnabel, Klein, Detecting Holes in Point Set Surfaces, WSCG 2006 (angle
// criterion). Differs: directions are binned into sectors instead of sorted, and only neighbours
// with a similar normal count, so that creases are borders of their faces.
#include "decode/surface/surface_borders.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/parallel.h"
#include "decode/surface/tangent_frame.h"
#include "mesh/cell_table.h"

namespace stipple {

namespace {

constexpr size_t kMaxNodeCount = 250000;
constexpr float kRadius = 2.6f;     ///< in sample spacings: 21 neighbours on average
constexpr float kFlatTurn = 0.5f;   ///< n·n' of neighbours that go on in the same plane
constexpr float kSideTurn = -0.2f;  ///< n·n' of neighbours that close a crease
constexpr int kSectors = 24;
constexpr size_t kMinCompanions = 3;

struct Nodes {
  std::vector<uint32_t> samples;
  std::vector<float> positions;
  std::vector<float> normals;
  CellTable cells;
  float squared_radius = 0;
};

/// Samples that stand for equal areas, in the order of the index: where there are more samples than
/// elsewhere, not more of them.
std::vector<uint32_t> evenSamples(const SurfaceIndex& index) {
  const auto widest = static_cast<double>(*std::ranges::max_element(index.areas));
  const double step = std::max(widest, index.area / static_cast<double>(kMaxNodeCount));
  std::vector<uint32_t> chosen;
  // Not at the ends of samples, where rounding would decide.
  double passed = 0, next = 0.25 * step;
  for (size_t i = 0; i < index.size(); ++i) {
    passed += static_cast<double>(index.areas[i]);
    if (passed < next) continue;
    chosen.push_back(static_cast<uint32_t>(i));
    next += step;
  }
  return chosen;
}

Nodes makeNodes(const SurfaceIndex& index) {
  Nodes nodes;
  nodes.samples = evenSamples(index);
  const size_t count = nodes.samples.size();
  std::vector<uint64_t> codes(count);
  nodes.positions.resize(count * 3);
  nodes.normals.resize(count * 3);
  for (size_t i = 0; i < count; ++i) {
    const size_t from = nodes.samples[i];
    codes[i] = index.codes[from];
    for (size_t axis = 0; axis < 3; ++axis) {
      nodes.positions[i * 3 + axis] = index.positions[from * 3 + axis];
      nodes.normals[i * 3 + axis] = index.normals[from * 3 + axis];
    }
  }
  const double radius =
      static_cast<double>(kRadius) * std::sqrt(index.area / static_cast<double>(count));
  nodes.squared_radius = static_cast<float>(radius * radius);
  const int level = static_cast<int>(std::clamp(std::floor(std::log2(1.0 / radius)), 0.0,
                                                static_cast<double>(SurfaceIndex::kCodeLevel)));
  nodes.cells = CellTable(codes, 3 * (SurfaceIndex::kCodeLevel - level), level);
  return nodes;
}

/// Sector 0..23 of a direction in the plane, by the diamond angle (no trigonometry).
int sectorOf(float x, float y) {
  const float t = y / (std::abs(x) + std::abs(y));
  const float angle = x >= 0 ? (t >= 0 ? t : 4.0f + t) : 2.0f - t;
  return std::min(kSectors - 1, static_cast<int>(angle * (kSectors / 4.0f)));
}

/// True if eight neighbouring sectors of the circle are empty.
bool hasWideGap(uint32_t filled) {
  const uint64_t empty = ~filled & ((uint32_t{1} << kSectors) - 1);
  const uint64_t twice = empty | empty << kSectors;
  uint64_t run = twice & twice >> 1;
  run &= run >> 2;
  run &= run >> 4;
  return run != 0;
}

/// Calls visit(node, offset, n·n') for the neighbours of a node within `squared_radius` whose
/// normal is on its side.
template <typename Visit>
void forNeighbours(const Nodes& nodes, const std::array<uint32_t, 27>& around, size_t cell_count,
                   size_t i, float squared_radius, const Visit& visit) {
  const float* p = &nodes.positions[i * 3];
  const float* n = &nodes.normals[i * 3];
  for (size_t c = 0; c < cell_count; ++c) {
    for (size_t j = nodes.cells.begin(around[c]); j < nodes.cells.end(around[c]); ++j) {
      const float* q = &nodes.positions[j * 3];
      const float d[3] = {q[0] - p[0], q[1] - p[1], q[2] - p[2]};
      if (d[0] * d[0] + d[1] * d[1] + d[2] * d[2] > squared_radius || j == i) continue;
      const float* m = &nodes.normals[j * 3];
      const float turn = n[0] * m[0] + n[1] * m[1] + n[2] * m[2];
      if (turn > kSideTurn) visit(j, d, turn);
    }
  }
}

}  // namespace

SurfaceBorders findBorders(const SurfaceIndex& index) {
  const Nodes nodes = makeNodes(index);
  const size_t count = nodes.samples.size();
  std::vector<uint8_t> gaps(count, 0);
  std::vector<uint8_t> open(count, 0);
  std::vector<uint8_t> kept(count, 0);
  std::vector<uint8_t> opens(count, 0);
  std::vector<float> outwards(count * 3, 0.0f);
  parallelFor(nodes.cells.size(), 64, [&](size_t first, size_t last) {
    std::array<uint32_t, 27> around;
    for (size_t cell = first; cell < last; ++cell) {
      const size_t cell_count = nodes.cells.neighbours(nodes.cells.code(cell), around);
      for (size_t i = nodes.cells.begin(cell); i < nodes.cells.end(cell); ++i) {
        const TangentFrame frame(&nodes.normals[i * 3]);
        uint32_t flat = 0, all = 0;
        forNeighbours(nodes, around, cell_count, i, nodes.squared_radius,
                      [&](size_t, const float* d, float turn) {
                        const float x = d[0] * frame.u[0] + d[1] * frame.u[1] + d[2] * frame.u[2];
                        const float y = d[0] * frame.v[0] + d[1] * frame.v[1] + d[2] * frame.v[2];
                        if (x == 0 && y == 0) return;
                        const uint32_t bit = uint32_t{1} << sectorOf(x, y);
                        all |= bit;
                        if (turn > kFlatTurn) flat |= bit;
                      });
        gaps[i] = hasWideGap(flat);
        open[i] = hasWideGap(all);
      }
    }
  });
  // A chance gap among the samples stands alone; a border is a line of them.
  parallelFor(nodes.cells.size(), 64, [&](size_t first, size_t last) {
    std::array<uint32_t, 27> around;
    for (size_t cell = first; cell < last; ++cell) {
      const size_t begin = nodes.cells.begin(cell), end = nodes.cells.end(cell);
      if (std::none_of(&gaps[begin], &gaps[begin] + (end - begin), [](uint8_t g) { return g; })) {
        continue;
      }
      const size_t cell_count = nodes.cells.neighbours(nodes.cells.code(cell), around);
      for (size_t i = begin; i < end; ++i) {
        if (!gaps[i]) continue;
        size_t companions = 0;
        float* outward = &outwards[i * 3];
        const float* n = &nodes.normals[i * 3];
        size_t open_companions = 0;
        forNeighbours(nodes, around, cell_count, i, 2 * nodes.squared_radius,
                      [&](size_t j, const float* d, float turn) {
                        if (turn < kFlatTurn) return;
                        companions += gaps[j];
                        open_companions += open[j];
                        for (size_t axis = 0; axis < 3; ++axis) outward[axis] -= d[axis];
                      });
        // By majority, so that a border is open or closed all along.
        opens[i] = 2 * (open_companions + open[i]) > companions + 1;
        // The surface around lies inwards; what sticks out of the plane is curvature.
        const float along = outward[0] * n[0] + outward[1] * n[1] + outward[2] * n[2];
        float length = 0;
        for (size_t axis = 0; axis < 3; ++axis) {
          outward[axis] -= along * n[axis];
          length += outward[axis] * outward[axis];
        }
        length = std::sqrt(length);
        kept[i] = companions >= kMinCompanions && length > 0;
        for (size_t axis = 0; kept[i] && axis < 3; ++axis) outward[axis] /= length;
      }
    }
  });
  SurfaceBorders borders;
  for (size_t i = 0; i < count; ++i) {
    if (!kept[i]) continue;
    borders.open.push_back(opens[i]);
    borders.codes.push_back(index.codes[nodes.samples[i]]);
    for (size_t axis = 0; axis < 3; ++axis) {
      borders.positions.push_back(nodes.positions[i * 3 + axis]);
      borders.normals.push_back(nodes.normals[i * 3 + axis]);
      borders.outwards.push_back(outwards[i * 3 + axis]);
    }
  }
  return borders;
}

}  // namespace stipple
