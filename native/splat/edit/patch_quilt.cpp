#include "splat/edit/patch_quilt.h"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

#include "base/random.h"

namespace stipple {

namespace {

using Cell = HoleRaster::Cell;

constexpr uint32_t kNone = UINT32_MAX;
constexpr size_t kCandidates = 256;
/// Squared colour of a difference that nobody sees: among such fits, chance decides.
constexpr double kUnseen = 1e-4;
/// The same for each time that a cell has been copied already: a drain that is there twice is seen.
constexpr double kRepeated = 0.05;

/// Keys of this file's numbers beside the seed.
constexpr uint64_t kOrderKey = 0x71756f7264657231ull;
constexpr uint64_t kPatchKey = 0x7175706174636831ull;

uint64_t bitsOf(uint64_t seed, uint64_t key, uint64_t index) {
  return mixBits(mixBits(seed ^ key) ^ index);
}

struct Offset {
  std::ptrdiff_t x, y;
};

class Quilt {
 public:
  Quilt(const HoleRaster& raster, std::vector<CellLook> looks, const QuiltOptions& options)
      : raster_(raster),
        looks_(std::move(looks)),
        options_(options),
        sources_(raster.size(), kNone),
        uses_(raster.size(), 0) {
    for (uint32_t i = 0; i < raster.size(); ++i) {
      if (raster.cells[i] == Cell::kSolid) solid_.push_back(i);
    }
  }

  std::vector<uint32_t> run() {
    if (solid_.empty()) return sources_;
    for (const uint32_t cell : fromTheEdge()) {
      if (sources_[cell] != kNone) continue;
      size_t reach = options_.reach;
      while (!copyPatch(cell, static_cast<std::ptrdiff_t>(reach))) reach /= 2;
    }
    return sources_;
  }

 private:
  std::ptrdiff_t width() const { return static_cast<std::ptrdiff_t>(raster_.width); }
  std::ptrdiff_t height() const { return static_cast<std::ptrdiff_t>(raster_.height); }
  std::ptrdiff_t columnOf(uint32_t cell) const {
    return static_cast<std::ptrdiff_t>(cell) % width();
  }
  std::ptrdiff_t rowOf(uint32_t cell) const { return static_cast<std::ptrdiff_t>(cell) / width(); }

  /// The cell at an offset, or kNone beyond the raster.
  uint32_t at(uint32_t cell, std::ptrdiff_t x, std::ptrdiff_t y) const {
    const std::ptrdiff_t column = columnOf(cell) + x, row = rowOf(cell) + y;
    if (column < 0 || row < 0 || column >= width() || row >= height()) return kNone;
    return static_cast<uint32_t>(row * width() + column);
  }

  static constexpr std::array<Offset, 4> kBeside = {{{-1, 0}, {1, 0}, {0, -1}, {0, 1}}};

  /// Cells of the hole by their distance to what is solid; equal ones by chance.
  std::vector<uint32_t> fromTheEdge() const {
    std::vector<uint32_t> steps(raster_.size(), kNone), order;
    std::vector<uint32_t> queue = solid_;
    for (const uint32_t cell : solid_) steps[cell] = 0;
    for (size_t k = 0; k < queue.size(); ++k) {
      for (const Offset& o : kBeside) {
        const uint32_t next = at(queue[k], o.x, o.y);
        if (next == kNone || steps[next] != kNone || raster_.cells[next] != Cell::kHole) continue;
        steps[next] = steps[queue[k]] + 1;
        queue.push_back(next);
      }
    }
    // What no path of the hole leads to from anything solid comes last.
    for (uint32_t i = 0; i < raster_.size(); ++i) {
      if (raster_.cells[i] == Cell::kHole) order.push_back(i);
    }
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
      if (steps[a] != steps[b]) return steps[a] < steps[b];
      const uint64_t first = bitsOf(options_.seed, kOrderKey, a);
      const uint64_t second = bitsOf(options_.seed, kOrderKey, b);
      return first != second ? first < second : a < b;
    });
    return order;
  }

  bool isOpen(uint32_t cell) const {
    return raster_.cells[cell] == Cell::kHole && sources_[cell] == kNone;
  }

  /// Whether it is known what a cell looks like: ground is there, or has been copied there.
  bool looks(uint32_t cell) const {
    return raster_.cells[cell] == Cell::kSolid || sources_[cell] != kNone;
  }

  /// How badly the patch around `source` fits around `target`; infinite where it lacks a cell that
  /// is to be filled.
  double misfit(uint32_t target, uint32_t source, std::ptrdiff_t reach) const {
    double sum = 0, count = 0, uses = 0, filled = 0;
    for (std::ptrdiff_t y = -reach; y <= reach; ++y) {
      for (std::ptrdiff_t x = -reach; x <= reach; ++x) {
        const uint32_t to = at(target, x, y);
        if (to == kNone) continue;
        const uint32_t from = at(source, x, y);
        const bool solid = from != kNone && raster_.cells[from] == Cell::kSolid;
        if (isOpen(to)) {
          if (!solid) return std::numeric_limits<double>::infinity();
          uses += uses_[from];
          filled += 1;
        } else if (solid && looks(to)) {
          sum += (looks_[to] - looks_[from]).squaredNorm();
          count += 1;
        }
      }
    }
    return (count > 0 ? sum / count : kUnseen) + kRepeated * uses / filled;
  }

  /// False where no candidate has all cells that the patch would fill.
  bool copyPatch(uint32_t target, std::ptrdiff_t reach) {
    double best = std::numeric_limits<double>::infinity();
    uint32_t chosen = kNone;
    const auto offer = [&](uint32_t source) {
      if (source == kNone) return;
      const double fit = std::max(kUnseen, misfit(target, source, reach));
      if (fit < best) {
        best = fit;
        chosen = source;
      }
    };
    // What goes on with a neighbour's patch comes first, and so wins a tie.
    for (const Offset& o : kBeside) {
      const uint32_t beside = at(target, o.x, o.y);
      if (beside == kNone || sources_[beside] == kNone) continue;
      offer(at(sources_[beside], -o.x, -o.y));
    }
    const uint64_t key = uint64_t{target} * kCandidates;
    for (size_t k = 0; k < kCandidates; ++k) {
      const double share = unitDouble(bitsOf(options_.seed, kPatchKey, key + k));
      offer(solid_[static_cast<size_t>(share * static_cast<double>(solid_.size()))]);
    }
    if (chosen == kNone) return false;
    for (std::ptrdiff_t y = -reach; y <= reach; ++y) {
      for (std::ptrdiff_t x = -reach; x <= reach; ++x) {
        const uint32_t to = at(target, x, y);
        if (to == kNone || !isOpen(to)) continue;
        sources_[to] = at(chosen, x, y);
        ++uses_[sources_[to]];
        looks_[to] = looks_[sources_[to]];
      }
    }
    return true;
  }

  const HoleRaster& raster_;
  std::vector<CellLook> looks_;
  QuiltOptions options_;
  std::vector<uint32_t> sources_;
  std::vector<uint32_t> uses_;  ///< of each cell as a source
  std::vector<uint32_t> solid_;
};

}  // namespace

std::vector<uint32_t> quiltSources(const HoleRaster& raster, std::vector<CellLook> looks,
                                   const QuiltOptions& options) {
  return Quilt(raster, std::move(looks), options).run();
}

}  // namespace stipple
