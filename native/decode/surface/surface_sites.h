#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "base/progress.h"
#include "decode/decoder.h"
#include "decode/surface/surface_index.h"
#include "mesh/cell_table.h"

namespace stipple {

/// Up to this many sites the decoder has time for a denser set of samples and one more round.
constexpr size_t kFewSites = 24000;

/// The places where splats will lie, sorted by grid cell, in the unit cube.
struct SurfaceSites {
  std::vector<float> positions;                  ///< [N,3]
  std::vector<float> normals;                    ///< [N,3] unit
  std::vector<float> spacings;                   ///< [N] expected distance to the next site
  std::vector<uint32_t> nearest;                 ///< [N] sample that the site was projected to
  std::vector<uint32_t> outputs;                 ///< [N] number of the splat in anchor order
  int level = 0;                                 ///< of the cells
  std::vector<std::array<uint32_t, 28>> around;  ///< per cell of cells[0]: count, then neighbours
  std::vector<CellTable> cells;  ///< at level, level − 1, level − 2 (as far as there are such)

  size_t size() const { return spacings.size(); }
  /// The occupied ones of the 27 cells of cells[0] around and at `code`; returns how many.
  size_t neighbours(uint64_t code, std::array<uint32_t, 27>& out) const;
};

/// Which samples take part and which site each belongs to.
struct SurfacePatches {
  size_t stride = 1;              ///< every stride-th sample of the index takes part
  size_t sample_count = 0;        ///< M
  std::vector<uint32_t> owners;   ///< [M] site, or CellTable::kNone for samples far from every site
  std::vector<uint32_t> begins;   ///< [N+1] into members
  std::vector<uint32_t> members;  ///< samples (0..M-1) by site, ascending within a site

  size_t sampleOf(size_t i) const { return i * stride + stride / 2; }
};

/// Anchors moved along the normal to the nearest sample of their leaf; K sites per anchor, spread
/// over the patch of the anchor.
SurfaceSites projectAnchors(const SurfaceIndex& index, const DecodeRequest& request);

/// Sorts the sites by cell after their positions have changed.
void sortByCell(const SurfaceIndex& index, SurfaceSites& sites);

/// Every how many-th of the samples of a surface takes part.
size_t sampleStride(size_t sample_count, size_t site_count, size_t samples_per_site);

/// Gives every taking-part sample to its nearest site; sites on another sheet of the surface (other
/// normal, or off the tangent plane) count as farther.
/// `samples_per_site` is how many take part on average, where there are as many.
SurfacePatches assignSamples(const SurfaceIndex& index, const SurfaceSites& sites,
                             size_t samples_per_site, Progress* progress);

/// Calls body(begin, end, cell code) for runs of taking-part samples that share a cell of the
/// sites' grid, in parallel over runs. The runs do not depend on the number of threads.
void forSampleRuns(const SurfaceIndex& index, const SurfacePatches& patches, int level,
                   const std::function<void(size_t, size_t, uint64_t)>& body);

}  // namespace stipple
