#include "mesh/surface_detail.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/parallel.h"
#include "math/colour.h"
#include "math/morton.h"
#include "mesh/cell_table.h"

namespace stipple {

namespace {

constexpr size_t kMaxNodeCount = 100000;
constexpr float kRadiusInSpacings = 2.5f;
constexpr float kSameSide = -0.2f;  ///< n·n' above this: the same side of the surface
constexpr float kHalfNormalVariation = 0.02f;
constexpr float kHalfColourVariance = 0.0025f;
constexpr size_t kGrain = 64;  ///< cells per range

/// The samples that take part, sorted by cell.
struct Nodes {
  std::vector<float> position;  ///< [M,3] metres from the lowest corner of the bounds
  std::vector<float> normal;    ///< [M,3]
  std::vector<float> colour;    ///< [M,3] display space
  CellTable cells;
  double low[3] = {0, 0, 0};
  double cell_side = 1.0;
  int level = 0;
  float radius = 0;

  uint64_t codeOf(const float* p) const {
    uint32_t at[3];
    const double last = static_cast<double>((uint32_t{1} << level) - 1);
    for (size_t axis = 0; axis < 3; ++axis) {
      const double cell = std::floor((static_cast<double>(p[axis]) - low[axis]) / cell_side);
      at[axis] = static_cast<uint32_t>(std::clamp(cell, 0.0, last));
    }
    return mortonEncode(at[0], at[1], at[2]);
  }
};

Nodes makeNodes(const PointSet& surface) {
  Nodes nodes;
  const size_t count = surface.size();
  const size_t node_count = std::min(count, kMaxNodeCount);
  double area = 0;
  double high[3];
  for (size_t axis = 0; axis < 3; ++axis) {
    nodes.low[axis] = std::numeric_limits<double>::infinity();
    high[axis] = -nodes.low[axis];
  }
  for (size_t i = 0; i < count; ++i) {
    area += static_cast<double>(surface.areas[i]);
    for (size_t axis = 0; axis < 3; ++axis) {
      const auto x = static_cast<double>(surface.positions[i * 3 + axis]);
      nodes.low[axis] = std::min(nodes.low[axis], x);
      high[axis] = std::max(high[axis], x);
    }
  }
  const double side = std::max({high[0] - nodes.low[0], high[1] - nodes.low[1],
                                high[2] - nodes.low[2], std::numeric_limits<double>::min()});
  const double radius =
      static_cast<double>(kRadiusInSpacings) * std::sqrt(area / static_cast<double>(node_count));
  nodes.radius = static_cast<float>(radius);
  nodes.level = static_cast<int>(
      std::clamp(std::floor(std::log2(side / std::max(radius, side * 1e-6))), 0.0, 20.0));
  // Cells are at least as wide as the radius, so that 27 of them hold the neighbourhood.
  nodes.cell_side = std::max(side / static_cast<double>(uint32_t{1} << nodes.level), radius);

  std::vector<size_t> chosen(node_count);
  std::vector<uint64_t> codes(node_count);
  for (size_t i = 0; i < node_count; ++i) {
    chosen[i] = i * count / node_count;
    codes[i] = nodes.codeOf(&surface.positions[chosen[i] * 3]);
  }
  const std::vector<uint32_t> order = sortedOrder(codes, nodes.level * 3);
  std::vector<uint64_t> sorted(node_count);
  nodes.position.resize(node_count * 3);
  nodes.normal.resize(node_count * 3);
  nodes.colour.resize(node_count * 3);
  parallelFor(node_count, 4096, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const size_t from = chosen[order[i]];
      sorted[i] = codes[order[i]];
      for (size_t axis = 0; axis < 3; ++axis) {
        nodes.position[i * 3 + axis] = static_cast<float>(
            static_cast<double>(surface.positions[from * 3 + axis]) - nodes.low[axis]);
        nodes.normal[i * 3 + axis] = surface.normals[from * 3 + axis];
        nodes.colour[i * 3 + axis] =
            linearToSrgb(std::clamp(surface.colours[from * 3 + axis], 0.0f, 1.0f));
      }
    }
  });
  nodes.cells = CellTable(sorted, 0, nodes.level);
  return nodes;
}

/// Calls visit(node) for the nodes of the same side within the radius of a place.
template <typename Visit>
void forNeighbours(const Nodes& nodes, const uint32_t* cells, size_t cell_count, const float* p,
                   const float* n, const Visit& visit) {
  const float limit = nodes.radius * nodes.radius;
  for (size_t c = 0; c < cell_count; ++c) {
    for (uint32_t j = nodes.cells.begin(cells[c]); j < nodes.cells.end(cells[c]); ++j) {
      const float* q = &nodes.position[size_t{j} * 3];
      const float* m = &nodes.normal[size_t{j} * 3];
      const float d[3] = {q[0] - p[0], q[1] - p[1], q[2] - p[2]};
      if (d[0] * d[0] + d[1] * d[1] + d[2] * d[2] > limit) continue;
      if (n[0] * m[0] + n[1] * m[1] + n[2] * m[2] <= kSameSide) continue;
      visit(size_t{j});
    }
  }
}

float variation(const Nodes& nodes, const uint32_t* cells, size_t cell_count, size_t i) {
  const float* n = &nodes.normal[i * 3];
  double turn = 0, sum[3] = {0, 0, 0}, square[3] = {0, 0, 0};
  size_t count = 0;
  forNeighbours(nodes, cells, cell_count, &nodes.position[i * 3], n, [&](size_t j) {
    const float* m = &nodes.normal[j * 3];
    turn += static_cast<double>(1.0f - (n[0] * m[0] + n[1] * m[1] + n[2] * m[2]));
    for (size_t c = 0; c < 3; ++c) {
      const auto value = static_cast<double>(nodes.colour[j * 3 + c]);
      sum[c] += value;
      square[c] += value * value;
    }
    ++count;
  });
  const auto total = static_cast<double>(count);
  double variance = 0;
  for (size_t c = 0; c < 3; ++c) {
    variance += std::max(0.0, square[c] / total - (sum[c] / total) * (sum[c] / total)) / 3.0;
  }
  const double x = std::max(0.0, turn / total) / static_cast<double>(kHalfNormalVariation) +
                   variance / static_cast<double>(kHalfColourVariance);
  return static_cast<float>(x / (1.0 + x));
}

}  // namespace

std::vector<float> surfaceDetail(const PointSet& surface, Progress* progress) {
  std::vector<float> result(surface.size(), 0.0f);
  if (surface.size() == 0) return result;
  const Nodes nodes = makeNodes(surface);
  advance(progress, 0.2, "Measuring detail");
  std::vector<float> raw(nodes.position.size() / 3);
  std::vector<float> smooth(raw.size());
  for (const bool second : {false, true}) {
    parallelFor(nodes.cells.size(), kGrain, [&](size_t begin, size_t end) {
      std::array<uint32_t, 27> around;
      for (size_t cell = begin; cell < end; ++cell) {
        const size_t cell_count = nodes.cells.neighbours(nodes.cells.code(cell), around);
        for (size_t i = nodes.cells.begin(cell); i < nodes.cells.end(cell); ++i) {
          if (!second) {
            raw[i] = variation(nodes, around.data(), cell_count, i);
            continue;
          }
          double sum = 0;
          size_t count = 0;
          forNeighbours(nodes, around.data(), cell_count, &nodes.position[i * 3],
                        &nodes.normal[i * 3], [&](size_t j) {
                          sum += static_cast<double>(raw[j]);
                          ++count;
                        });
          smooth[i] = static_cast<float>(sum / static_cast<double>(count));
        }
      }
    });
    advance(progress, second ? 0.8 : 0.5, "Measuring detail");
  }
  // Every sample takes the value of the nearest node of its side in its own cell.
  parallelFor(surface.size(), 4096, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const float* world = &surface.positions[i * 3];
      const float* n = &surface.normals[i * 3];
      float p[3];
      for (size_t axis = 0; axis < 3; ++axis) {
        p[axis] = static_cast<float>(static_cast<double>(world[axis]) - nodes.low[axis]);
      }
      const uint32_t cell = nodes.cells.find(nodes.codeOf(world));
      if (cell == CellTable::kNone) continue;
      float best = std::numeric_limits<float>::infinity();
      for (size_t j = nodes.cells.begin(cell); j < nodes.cells.end(cell); ++j) {
        const float* q = &nodes.position[j * 3];
        const float* m = &nodes.normal[j * 3];
        const float d[3] = {q[0] - p[0], q[1] - p[1], q[2] - p[2]};
        const float turn = 1.0f - (n[0] * m[0] + n[1] * m[1] + n[2] * m[2]);
        const float cost =
            d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + turn * nodes.radius * nodes.radius;
        if (cost < best) {
          best = cost;
          result[i] = smooth[j];
        }
      }
    }
  });
  return result;
}

}  // namespace stipple
