#include "decode/surface/surface_sites.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <functional>
#include <limits>
#include <tuple>

#include "base/parallel.h"
#include "base/random.h"
#include "decode/surface/tangent_frame.h"

namespace stipple {

namespace {

constexpr size_t kAnchorGrain = 2048;
constexpr size_t kRunGrain = 32;
constexpr size_t kMinSamples = 16384;
/// A sample off the tangent plane by h counts as sqrt(1 + kOffPlane) h away.
constexpr float kOffPlane = 15.0f;
/// A site whose normal is turned by t counts as sqrt(kTurned) (1 − cos t) spacings farther.
constexpr float kTurned = 4.0f;
/// Samples farther than this (in spacings, with the penalties above) from every site belong to
/// none: a part that got no anchor is not covered from another part.
constexpr float kReach = 3.0f;

/// Range of samples in a cell of `level`.
std::pair<size_t, size_t> samplesOfCell(const SurfaceIndex& index, uint64_t code, int level) {
  const int shift = 3 * (SurfaceIndex::kCodeLevel - level);
  const auto low = std::lower_bound(index.codes.begin(), index.codes.end(), code << shift);
  const auto high = std::lower_bound(low, index.codes.end(), (code + 1) << shift);
  return {static_cast<size_t>(low - index.codes.begin()),
          static_cast<size_t>(high - index.codes.begin())};
}

float squaredDistance(const float* a, const float* b) {
  const float d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
  return d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
}

/// The sample nearest to an anchor within its leaf. Leaves with many samples are narrowed to the
/// smallest cell around the anchor that still holds some; a leaf without samples (a density that
/// was not made from this surface) falls back on its neighbours in Morton order.
size_t nearestSample(const SurfaceIndex& index, const float* anchor, uint64_t leaf,
                     int leaf_level) {
  constexpr size_t kFew = 32;
  size_t begin = 0, end = 0;
  std::tie(begin, end) = samplesOfCell(index, leaf, leaf_level);
  for (int level = leaf_level + 1; end - begin > kFew && level <= SurfaceIndex::kCodeLevel;
       ++level) {
    const auto [low, high] = samplesOfCell(index, unitCubeCode(anchor, level), level);
    if (low == high || low < begin || high > end) break;
    begin = low;
    end = high;
  }
  for (int level = leaf_level - 1; begin == end && level >= 0; --level) {
    std::tie(begin, end) = samplesOfCell(index, leaf >> (3 * (leaf_level - level)), level);
  }
  size_t best = begin;
  float best_distance = std::numeric_limits<float>::infinity();
  for (size_t i = begin; i < end; ++i) {
    const float distance = squaredDistance(anchor, &index.positions[i * 3]);
    if (distance < best_distance) {
      best_distance = distance;
      best = i;
    }
  }
  return best;
}

/// The cells' level for a spacing: cells of 1 to 2 spacings, so that 27 of them hold every site
/// within a spacing of a sample and few others.
int cellLevel(double spacing) {
  const double level = std::floor(std::log2(1.0 / std::max(spacing, 1e-9)));
  return static_cast<int>(std::clamp(level, 0.0, static_cast<double>(SurfaceIndex::kCodeLevel)));
}

/// Candidate sites around a cell in blocks of contiguous rows x, y, z, nx, ny, nz, so that the
/// compiler can vectorise over a block. The last block is padded with sites infinitely far away.
struct Candidates {
  static constexpr size_t kBlock = 16;
  struct Block {
    float rows[6][kBlock];
  };
  std::vector<uint32_t> site;
  std::vector<Block> blocks;

  void gather(const SurfaceSites& sites, const CellTable& table, uint64_t code) {
    std::array<uint32_t, 27> around;
    const size_t cell_count =
        &table == &sites.cells[0] ? sites.neighbours(code, around) : table.neighbours(code, around);
    site.clear();
    for (size_t c = 0; c < cell_count; ++c) {
      for (uint32_t i = table.begin(around[c]); i < table.end(around[c]); ++i) site.push_back(i);
    }
    const size_t count = site.size();
    blocks.resize((count + kBlock - 1) / kBlock);
    for (size_t i = 0; i < count; ++i) {
      Block& block = blocks[i / kBlock];
      for (size_t axis = 0; axis < 3; ++axis) {
        block.rows[axis][i % kBlock] = sites.positions[size_t{site[i]} * 3 + axis];
        block.rows[3 + axis][i % kBlock] = sites.normals[size_t{site[i]} * 3 + axis];
      }
    }
    for (size_t i = count; i < blocks.size() * kBlock; ++i) {
      for (size_t row = 0; row < 6; ++row) blocks.back().rows[row][i % kBlock] = row < 3 ? 1e6f : 0;
    }
  }

  /// The candidate of least cost for a sample and its cost; no candidates: infinite cost.
  std::pair<size_t, float> cheapest(const float* p, const float* n, float squared_spacing) const {
    const float px = p[0], py = p[1], pz = p[2], nx = n[0], ny = n[1], nz = n[2];
    const float turn_cost = kTurned * squared_spacing;
    // One running minimum per lane, on the bits of the costs (floats that are not negative are
    // ordered like their bits): the loop vectorises.
    constexpr int32_t kInfinity = std::bit_cast<int32_t>(std::numeric_limits<float>::infinity());
    int32_t least[kBlock], where[kBlock];
    for (size_t k = 0; k < kBlock; ++k) {
      least[k] = kInfinity;
      where[k] = 0;
    }
    for (size_t b = 0; b < blocks.size(); ++b) {
      const Block& block = blocks[b];
      const auto number = static_cast<int32_t>(b);
      for (size_t k = 0; k < kBlock; ++k) {
        const float dx = px - block.rows[0][k], dy = py - block.rows[1][k],
                    dz = pz - block.rows[2][k];
        const float mx = block.rows[3][k], my = block.rows[4][k], mz = block.rows[5][k];
        // Along the mean of both normals: on a smoothly curved sheet it is at right angles to the
        // chord, on another sheet it is not.
        const float along = 0.5f * (dx * (nx + mx) + dy * (ny + my) + dz * (nz + mz));
        const float turn = 1.0f - (nx * mx + ny * my + nz * mz);
        const float cost =
            dx * dx + dy * dy + dz * dz + kOffPlane * along * along + turn_cost * turn * turn;
        const int32_t bits = std::bit_cast<int32_t>(cost);
        where[k] = bits < least[k] ? number : where[k];
        least[k] = bits < least[k] ? bits : least[k];
      }
    }
    size_t lane = 0;
    for (size_t k = 1; k < kBlock; ++k) {
      if (least[k] < least[lane] || (least[k] == least[lane] && where[k] < where[lane])) lane = k;
    }
    return {static_cast<size_t>(where[lane]) * kBlock + lane, std::bit_cast<float>(least[lane])};
  }
};

/// Members of every site by counting: same order for any number of threads.
void groupByOwner(SurfacePatches& patches, size_t site_count) {
  patches.begins.assign(site_count + 1, 0);
  for (const uint32_t owner : patches.owners) {
    if (owner != CellTable::kNone) ++patches.begins[owner + 1];
  }
  for (size_t i = 0; i < site_count; ++i) patches.begins[i + 1] += patches.begins[i];
  patches.members.resize(patches.begins[site_count]);
  std::vector<uint32_t> next(patches.begins.begin(), patches.begins.end() - 1);
  for (size_t i = 0; i < patches.owners.size(); ++i) {
    const uint32_t owner = patches.owners[i];
    if (owner != CellTable::kNone) patches.members[next[owner]++] = static_cast<uint32_t>(i);
  }
}

}  // namespace

SurfaceSites projectAnchors(const SurfaceIndex& index, const DecodeRequest& request) {
  constexpr float kGoldenAngle = 2.39996323f;
  const AnchorSet& anchors = *request.anchors;
  const size_t per_anchor = request.gaussians_per_anchor;
  const size_t count = anchors.size() * per_anchor;
  SurfaceSites sites;
  sites.positions.resize(count * 3);
  sites.normals.resize(count * 3);
  sites.spacings.resize(count);
  sites.nearest.resize(count);
  sites.outputs.resize(count);
  parallelFor(anchors.size(), kAnchorGrain, [&](size_t begin, size_t end) {
    for (size_t a = begin; a < end; ++a) {
      const float* anchor = &anchors.positions[a * 3];
      const size_t sample = nearestSample(index, anchor, anchors.leaves[a], anchors.leaf_level);
      const float* p = &index.positions[sample * 3];
      const float* n = &index.normals[sample * 3];
      const float height =
          n[0] * (anchor[0] - p[0]) + n[1] * (anchor[1] - p[1]) + n[2] * (anchor[2] - p[2]);
      const TangentFrame frame(n);
      const float anchor_spacing =
          std::sqrt(index.spreads[sample] / static_cast<float>(anchors.size()));
      const float turn =
          6.2831853f * unitFloat(keyedBits(request.seed, RandomUse::kDecoder, anchors.leaves[a]));
      for (size_t k = 0; k < per_anchor; ++k) {
        const size_t i = a * per_anchor + k;
        // One site stands on the anchor; more of them on a sunflower over a disc of its area.
        const float radius =
            per_anchor == 1
                ? 0.0f
                : 0.5642f * anchor_spacing *
                      std::sqrt((static_cast<float>(k) + 0.5f) / static_cast<float>(per_anchor));
        const float angle = turn + kGoldenAngle * static_cast<float>(k);
        const float u = radius * std::cos(angle), v = radius * std::sin(angle);
        for (size_t axis = 0; axis < 3; ++axis) {
          sites.positions[i * 3 + axis] =
              anchor[axis] - height * n[axis] + u * frame.u[axis] + v * frame.v[axis];
          sites.normals[i * 3 + axis] = n[axis];
        }
        sites.spacings[i] = anchor_spacing / std::sqrt(static_cast<float>(per_anchor));
        sites.nearest[i] = static_cast<uint32_t>(sample);
        sites.outputs[i] = static_cast<uint32_t>(i);
      }
    }
  });
  sortByCell(index, sites);
  return sites;
}

void sortByCell(const SurfaceIndex& index, SurfaceSites& sites) {
  const size_t count = sites.size();
  // Those of the old places, so that two generations of them are never held.
  sites.cells = std::vector<CellTable>();
  sites.around = std::vector<std::array<uint32_t, 28>>();
  sites.level = cellLevel(std::sqrt(index.area / static_cast<double>(count)));
  std::vector<uint64_t> codes(count);
  parallelFor(count, kAnchorGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      codes[i] = unitCubeCode(&sites.positions[i * 3], sites.level);
  });
  const std::vector<uint32_t> order = sortedOrder(codes, sites.level * 3);
  SurfaceSites sorted;
  sorted.level = sites.level;
  sorted.positions.resize(count * 3);
  sorted.normals.resize(count * 3);
  sorted.spacings.resize(count);
  sorted.nearest.resize(count);
  sorted.outputs.resize(count);
  std::vector<uint64_t> sorted_codes(count);
  parallelFor(count, kAnchorGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const size_t from = order[i];
      sorted_codes[i] = codes[from];
      for (size_t axis = 0; axis < 3; ++axis) {
        sorted.positions[i * 3 + axis] = sites.positions[from * 3 + axis];
        sorted.normals[i * 3 + axis] = sites.normals[from * 3 + axis];
      }
      sorted.spacings[i] = sites.spacings[from];
      sorted.nearest[i] = sites.nearest[from];
      sorted.outputs[i] = sites.outputs[from];
    }
  });
  for (int step = 0; step < 3 && step <= sites.level; ++step) {
    sorted.cells.emplace_back(sorted_codes, 3 * step, sites.level - step);
  }
  const CellTable& cells = sorted.cells[0];
  sorted.around.resize(cells.size());
  parallelFor(cells.size(), kRunGrain * 8, [&](size_t begin, size_t end) {
    std::array<uint32_t, 27> around;
    for (size_t cell = begin; cell < end; ++cell) {
      const size_t cell_count = cells.neighbours(cells.code(cell), around);
      sorted.around[cell][0] = static_cast<uint32_t>(cell_count);
      std::copy_n(around.begin(), cell_count, sorted.around[cell].begin() + 1);
    }
  });
  sites = std::move(sorted);
}

size_t SurfaceSites::neighbours(uint64_t code, std::array<uint32_t, 27>& out) const {
  const uint32_t cell = cells[0].find(code);
  if (cell == CellTable::kNone) return cells[0].neighbours(code, out);
  std::copy_n(around[cell].begin() + 1, around[cell][0], out.begin());
  return around[cell][0];
}

void forSampleRuns(const SurfaceIndex& index, const SurfacePatches& patches, int level,
                   const std::function<void(size_t, size_t, uint64_t)>& body) {
  const int shift = 3 * (SurfaceIndex::kCodeLevel - level);
  const auto starts_run = [&](size_t i) {
    return i == 0 || index.codes[patches.sampleOf(i)] >> shift !=
                         index.codes[patches.sampleOf(i - 1)] >> shift;
  };
  size_t run_count = 0;
  for (size_t i = 0; i < patches.sample_count; ++i) run_count += starts_run(i) ? 1 : 0;
  std::vector<uint32_t> begins;
  begins.reserve(run_count + 1);
  for (size_t i = 0; i < patches.sample_count; ++i) {
    if (starts_run(i)) begins.push_back(static_cast<uint32_t>(i));
  }
  begins.push_back(static_cast<uint32_t>(patches.sample_count));
  parallelFor(begins.size() - 1, kRunGrain, [&](size_t begin, size_t end) {
    for (size_t run = begin; run < end; ++run) {
      body(begins[run], begins[run + 1], index.codes[patches.sampleOf(begins[run])] >> shift);
    }
  });
}

size_t sampleStride(size_t sample_count, size_t site_count, size_t samples_per_site) {
  const size_t wanted = std::max(kMinSamples, site_count * samples_per_site);
  return std::max<size_t>(1, (sample_count + wanted / 2) / wanted);
}

SurfacePatches assignSamples(const SurfaceIndex& index, const SurfaceSites& sites,
                             size_t samples_per_site, Progress* progress) {
  SurfacePatches patches;
  patches.stride = sampleStride(index.size(), sites.size(), samples_per_site);
  patches.sample_count = index.size() / patches.stride;
  patches.owners.resize(patches.sample_count);
  const float cell_side = 1.0f / static_cast<float>(uint32_t{1} << sites.level);
  const float scale = std::sqrt(1.0f / static_cast<float>(sites.size()));
  forSampleRuns(index, patches, sites.level, [&](size_t begin, size_t end, uint64_t code) {
    if (progress) progress->throwIfCancelled();
    thread_local std::array<Candidates, 3> levels;
    size_t gathered = 1;
    levels[0].gather(sites, sites.cells[0], code);
    for (size_t i = begin; i < end; ++i) {
      const size_t sample = patches.sampleOf(i);
      const float* p = &index.positions[sample * 3];
      const float* n = &index.normals[sample * 3];
      const float spacing = std::sqrt(index.spreads[sample]) * scale;
      const float squared = spacing * spacing;
      const float reach = kReach * kReach * squared;
      auto [best, cost] = levels[0].cheapest(p, n, squared);
      size_t used = 0;
      // The 27 cells hold every site within a cell's side; farther ones need wider cells.
      for (size_t step = 1; step < sites.cells.size(); ++step) {
        const float sure = cell_side * static_cast<float>(uint32_t{1} << (step - 1));
        if (cost <= sure * sure || sure * sure > reach) break;
        if (gathered <= step) {
          levels[step].gather(sites, sites.cells[step], code >> (3 * step));
          gathered = step + 1;
        }
        std::tie(best, cost) = levels[step].cheapest(p, n, squared);
        used = step;
      }
      patches.owners[i] = cost <= reach ? levels[used].site[best] : CellTable::kNone;
    }
  });
  groupByOwner(patches, sites.size());
  return patches;
}

}  // namespace stipple
