#include "splat/cpu/tiles/tiled_render.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <functional>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "splat/cpu/tiles/tile.h"
#include "splat/cpu/tiles/tile_holdouts.h"
#include "splat/cpu/tiles/tile_lists.h"
#include "splat/cpu/tiles/tile_surface.h"
#include "splat/cpu/visible_splats.h"
#include "splat/render/effects.h"
#include "splat/render/object_order.h"
#include "splat/render/pixel_passes.h"
#include "splat/render/scene.h"
#include "splat/render/surface.h"

// Based on: Kerbl et al., 3D Gaussian Splatting, SIGGRAPH 2023 (tiles). Differs: one sort by depth
// followed by counting by tile; and where float32 rounding could decide a threshold, double does,
// with the same numbers as the reference: the least alpha on the spot, the end at T = 1e-4 and the
// median at T = 1/2 by blending the pixel again. So no threshold falls
// differently in the two renderers and the rest differs by rounding only.

namespace stipple {

namespace {

constexpr size_t kBatchSize = 128;

bool hasLayer(const RenderOptions& options) {
  return kHasEffects && hasSurface(options);
}

/// A pixel of a tile that is blended as the reference blends it.
struct DoubtfulPixel {
  uint32_t x, y;
  PixelBlend<double> blend;
  SurfaceAtPixel<double> surface;  ///< if there is one
};

/// Goes over the tile's splats once for all of them.
template <bool kSurface>
void blendInDouble(const SplatSlots& slots, const Tile& tile, const Painter& painter,
                   DoubtfulPixel* pixels, size_t count) {
  constexpr size_t kAhead = 8;
  for (size_t i = 0; i < tile.splats.size() && count > 0; ++i) {
    const size_t ahead = std::min(i + kAhead, tile.splats.size() - 1);
    __builtin_prefetch(&slots.splats[tile.splats[ahead]]);
    __builtin_prefetch(&slots.extras[tile.splats[ahead]]);
    const uint32_t slot = tile.splats[i];
    const VisibleSplat& splat = slots.splats[slot];
    float colour[3] = {splat.colour[0], splat.colour[1], splat.colour[2]};
    painter.apply(slot, splat.depth, colour);
    for (size_t k = 0; k < count; ++k) {
      double distance;
      if (!mayShow(splat, tile, pixels[k].x, pixels[k].y, distance)) continue;
      const double alpha =
          splatAlpha(slots.extras[slot].opacity, distance, tile.cut_off.least_alpha);
      if (alpha == 0) continue;
      if (kSurface && !pixels[k].blend.isBefore(pixels[k].surface, splat.depth)) {
        pixels[k].blend.addSurface(pixels[k].surface);
        if (pixels[k].blend.finished) {
          std::swap(pixels[k--], pixels[--count]);
          continue;
        }
      }
      pixels[k].blend.add(alpha, colour, static_cast<double>(splat.depth));
      // A pixel that has ended changes places with the last that has not.
      if (pixels[k].blend.finished) std::swap(pixels[k--], pixels[--count]);
    }
  }
}

void replaceDoubtful(const SplatSlots& slots, const Tile& tile, const RenderOptions& options,
                     const Painter& painter, TilePixels& pixels) {
  uint32_t any = 0;
  for (const float doubt : pixels.doubt) any |= std::bit_cast<uint32_t>(doubt);
  if (any == 0) return;
  constexpr size_t kAtOnce = 32;
  DoubtfulPixel doubtful[kAtOnce];
  for (uint32_t next = 0; next < kTilePixelCount;) {
    size_t count = 0;
    for (; next < kTilePixelCount && count < kAtOnce; ++next) {
      // Pixels outside the picture are never in doubt.
      if (pixels.doubt[next] == 0.0f) continue;
      doubtful[count++] = {next % kTileSide, next / kTileSide, {}, {}};
    }
    if (hasLayer(options)) {
      for (size_t k = 0; k < count; ++k) {
        const size_t row = static_cast<size_t>(tile.y0 + doubtful[k].y) * options.surface.width;
        doubtful[k].surface = surfaceAt<double>(options.surface, row + tile.x0 + doubtful[k].x);
      }
      blendInDouble<true>(slots, tile, painter, doubtful, count);
    } else {
      blendInDouble<false>(slots, tile, painter, doubtful, count);
    }
    for (size_t k = 0; k < count; ++k) {
      const size_t i = static_cast<size_t>(doubtful[k].y) * kTileSide + doubtful[k].x;
      PixelBlend<double>& pixel = doubtful[k].blend;
      if (hasLayer(options)) {
        if (pixel.surface_weight < 0) pixel.addSurface(doubtful[k].surface);
        pixels.before[i] = static_cast<float>(pixel.surface_weight);
      }
      pixels.transmittance[i] = static_cast<float>(pixel.transmittance);
      pixels.red[i] = static_cast<float>(pixel.colour[0]);
      pixels.green[i] = static_cast<float>(pixel.colour[1]);
      pixels.blue[i] = static_cast<float>(pixel.colour[2]);
      pixels.weighted_depth[i] = static_cast<float>(pixel.weighted_depth);
      pixels.coverage[i] = static_cast<float>(1.0 - pixel.transmittance);
      pixels.median_depth[i] =
          pixel.has_median ? static_cast<float>(pixel.median_depth) : kNoMedian;
      pixels.count[i] = static_cast<float>(pixel.count);
    }
  }
}

/// Chooses by bits: with comparisons of numbers, which may trap, the compiler makes no vectors.
float expectedDepth(const TilePixels& pixels, size_t i) {
  const uint32_t coverage = std::bit_cast<uint32_t>(1.0f - pixels.transmittance[i]);
  const uint32_t nothing = coverage == 0 ? ~0u : 0u;
  const float divisor = std::bit_cast<float>(coverage | (nothing & std::bit_cast<uint32_t>(1.0f)));
  const uint32_t depth = std::bit_cast<uint32_t>(pixels.weighted_depth[i] / divisor);
  return std::bit_cast<float>((depth & ~nothing) |
                              (std::bit_cast<uint32_t>(kEmptyDepth) & nothing));
}

/// A row of a tile. Loops over plain arrays, one output each, so that the compiler makes vectors.
void writeRow(const TilePixels& pixels, size_t first, size_t count, const RenderOptions& options,
              RenderResult& result, size_t out) {
  const float* transmittance = pixels.transmittance + first;
  const float* red = pixels.red + first;
  const float* green = pixels.green + first;
  const float* blue = pixels.blue + first;
  float* colour = &result.colour[out * 4];
  if (options.with_background) {
    const float background[3] = {static_cast<float>(options.background[0]),
                                 static_cast<float>(options.background[1]),
                                 static_cast<float>(options.background[2])};
    for (size_t x = 0; x < count; ++x) {
      colour[x * 4] = red[x] + transmittance[x] * background[0];
      colour[x * 4 + 1] = green[x] + transmittance[x] * background[1];
      colour[x * 4 + 2] = blue[x] + transmittance[x] * background[2];
      colour[x * 4 + 3] = 1.0f;
    }
  } else {
    for (size_t x = 0; x < count; ++x) {
      colour[x * 4] = red[x];
      colour[x * 4 + 1] = green[x];
      colour[x * 4 + 2] = blue[x];
      colour[x * 4 + 3] = 1.0f - transmittance[x];
    }
  }
  if (kHasEffects && options.with_depth) {
    float* depth = &result.depth[out];
    for (size_t x = 0; x < count; ++x) depth[x] = expectedDepth(pixels, first + x);
  }
  if (kHasEffects && options.with_median_depth) {
    for (size_t x = 0; x < count; ++x) {
      const float median = pixels.median_depth[first + x];
      result.median_depth[out + x] = median == kNoMedian ? kEmptyDepth : median;
    }
  }
  if (kHasEffects && options.with_counts) {
    for (size_t x = 0; x < count; ++x) {
      result.counts[out + x] = static_cast<uint32_t>(pixels.count[first + x]);
    }
  }
  if (kHasEffects && options.with_transmittance) {
    std::copy_n(transmittance, count, result.transmittance.begin() + static_cast<ptrdiff_t>(out));
  }
}

/// Alpha and depth of the pixels of a row, written as writeRow does, that holdouts touch.
void leaveOutHoldouts(const TilePixels& shares, size_t first, size_t count,
                      const RenderOptions& options, RenderResult& result, size_t out) {
  for (size_t x = 0; x < count; ++x) {
    const PixelShares share = sharesOf(shares, first + x);
    if (share.hidden == 0.0f) continue;
    result.colour[(out + x) * 4 + 3] = options.with_background ? 1.0f - share.hidden : share.shown;
    if (!options.with_depth) continue;
    result.depth[out + x] = share.shown > 0.0f ? share.shown_depth / share.shown : kEmptyDepth;
  }
}

/// In: shares, of holdouts, or null for none.
void writePixels(const Tile& tile, const TilePixels& pixels, const TilePixels* shares,
                 const RenderOptions& options, RenderResult& result) {
  for (uint32_t y = 0; y < tile.height; ++y) {
    const size_t out = static_cast<size_t>(tile.y0 + y) * result.width + tile.x0;
    const size_t first = static_cast<size_t>(y) * kTileSide;
    writeRow(pixels, first, tile.width, options, result, out);
    if (shares) leaveOutHoldouts(*shares, first, tile.width, options, result, out);
  }
  if (hasLayer(options)) writeWithSurface(tile, pixels, shares, options, result);
}

/// The batch that the kernel works on, for judgeAlpha.
struct Judged {
  const SplatSlots* slots;
  const Tile* tile;
  size_t begin;
};

double judgeAlpha(const void* context, size_t splat, uint32_t pixel) {
  const Judged& judged = *static_cast<const Judged*>(context);
  const uint32_t slot = judged.tile->splats[judged.begin + splat];
  return alphaInDouble(*judged.slots, slot, *judged.tile, pixel % kTileSide, pixel / kTileSide);
}

/// What `kept` holds of tile `index`.
void keepTile(size_t index, const TilePixels& pixels, KeptPicture& kept) {
  const size_t first = index * kTilePixelCount;
  std::copy_n(pixels.transmittance, kTilePixelCount, kept.transmittance.get() + first);
  int32_t* ends = kept.ends.get() + first;
  for (size_t i = 0; i < kTilePixelCount; ++i) {
    ends[i] = pixels.doubt[i] != 0.0f ? kInDoubt : pixels.end[i];
  }
  if (!kept.with_depth) return;
  float* depth = kept.depth.get() + first;
  for (size_t i = 0; i < kTilePixelCount; ++i) {
    const float coverage = pixels.coverage[i];
    depth[i] = coverage > 0 ? pixels.weighted_depth[i] / coverage : kEmptyDepth;
  }
}

/// In: which sums are wanted. Out: pixels.
void blendTile(const SplatSlots& slots, Tile tile, TileKernel kernel, const RenderOptions& options,
               TileKernelOptions kernel_options, const Painter& painter, TilePixels& pixels) {
  // Scratch of this thread: 10 KiB of pixels and 8 KiB of splats, in the first-level cache.
  TileSplat batch[kBatchSize];
  clearPixels(tile, pixels);
  if (hasLayer(options)) takeSurface(options.surface, slots.splats, tile, pixels);
  Judged judged{&slots, &tile, 0};
  kernel_options.with_surface = hasLayer(options);
  kernel_options.surface_shows = options.surface.colour != nullptr;
  kernel_options.log2_least = tile.cut_off.log2_least;
  kernel_options.median_doubt = tile.cut_off.medianDoubt(tile.splats.size());
  kernel_options.judge = judgeAlpha;
  kernel_options.judge_context = &judged;
  float largest = 0;
  for (size_t begin = 0; begin < tile.splats.size() && pixels.unfinished > 0; begin += kBatchSize) {
    const size_t count = std::min(kBatchSize, tile.splats.size() - begin);
    makeTileSplats(slots.splats, tile, begin, count, largest, batch);
    paintSplats(painter, tile.splats.data() + begin, count, batch);
    judged.begin = begin;
    kernel_options.first = static_cast<int32_t>(begin);
    const size_t behind = tile.splats.size() - begin - count + tile.listed_behind;
    kernel_options.next = {slots.splats, tile.splats.data() + begin + count, behind};
    kernel(batch, count, kernel_options, pixels);
  }
  if (hasLayer(options)) {
    endWithSurface(options.surface, tile, kernel_options.with_extras, pixels);
  }
  replaceDoubtful(slots, tile, options, painter, pixels);
}

/// Normals and objects, each by blending the tile again.
void renderPasses(const SplatSlots& slots, const Tile& tile, TileKernel kernel,
                  const RenderOptions& options, const PassSplats& passes, RenderResult& result) {
  TilePixels pixels;
  if (options.with_normal) {
    const Painter painter = {Paint::kNormals, passes.normals.get(), nullptr, {}};
    blendTile(slots, tile, kernel, options, {false, false}, painter, pixels);
    writeNormals(tile, pixels, result);
  }
  if (!options.with_objects) return;
  const std::vector<uint32_t> objects = objectsOf(tile, passes);
  TileObjects found;
  clearPixels(tile, pixels);
  for (size_t first = 0; first < objects.size(); first += 3) {
    Painter painter = {Paint::kObjects, nullptr, passes.objects.get(), {}};
    for (size_t c = 0; c < 3; ++c) {
      painter.wanted[c] = first + c < objects.size() ? objects[first + c] : 0;
    }
    blendTile(slots, tile, kernel, options, {false, false}, painter, pixels);
    found.take(pixels, painter.wanted);
  }
  // Without objects nothing was blended, and there is nothing that a surface could hide.
  RenderOptions no_surface;
  found.write(tile, pixels, objects.empty() ? no_surface : options, result);
}

/// What a tile is drawn into; null: not wanted.
struct TileTargets {
  RenderResult* result;
  KeptPicture* kept;
  const PassSplats* passes;
};

void renderTile(const SplatSlots& slots, const Tile& tile, size_t index, TileKernel kernel,
                const RenderOptions& options, bool has_holdouts, const TileTargets& targets) {
  TileKernelOptions wanted = {options.with_depth, options.with_median_depth || options.with_counts};
  wanted.with_coverage = targets.kept != nullptr;
  TilePixels pixels;
  if constexpr (!kHasEffects) {
    blendTile(slots, tile, kernel, options, {false, false}, {}, pixels);
    writePixels(tile, pixels, nullptr, options, *targets.result);
    return;
  }
  Painter painter;
  painter.paint = has_holdouts ? Paint::kColours : Paint::kStored;
  blendTile(slots, tile, kernel, options, wanted, painter, pixels);
  if (targets.result && has_holdouts) {
    TilePixels shares;
    painter.paint = Paint::kShares;
    blendTile(slots, tile, kernel, options, {false, false}, painter, shares);
    writePixels(tile, pixels, &shares, options, *targets.result);
  } else if (targets.result) {
    writePixels(tile, pixels, nullptr, options, *targets.result);
  }
  if (targets.kept) keepTile(index, pixels, *targets.kept);
  if (targets.passes) {
    renderPasses(slots, tile, kernel, options, *targets.passes, *targets.result);
  }
}

void prepareResult(const Camera& camera, const RenderOptions& options, RenderResult& result) {
  result.width = camera.width;
  result.height = camera.height;
  const size_t pixel_count = static_cast<size_t>(camera.width) * camera.height;
  result.colour.resize(pixel_count * 4);
  result.depth.resize(options.with_depth ? pixel_count : 0);
  result.median_depth.resize(options.with_median_depth ? pixel_count : 0);
  result.counts.resize(options.with_counts ? pixel_count : 0);
  result.transmittance.resize(options.with_transmittance ? pixel_count : 0);
  result.normal.resize(options.with_normal ? pixel_count * 3 : 0);
  result.objects.resize(options.with_objects ? pixel_count : 0);
  result.surface_weight.resize(hasLayer(options) && options.splats_apart ? pixel_count : 0);
}

uint64_t resultBytes(const Camera& camera, const RenderOptions& options) {
  const uint64_t pixel_count = static_cast<uint64_t>(camera.width) * camera.height;
  const uint64_t planes = 4u + (options.with_depth ? 1u : 0u) +
                          (options.with_median_depth ? 1u : 0u) + (options.with_counts ? 1u : 0u) +
                          (options.with_transmittance ? 1u : 0u) + (options.with_normal ? 3u : 0u) +
                          (options.with_objects ? 1u : 0u) +
                          (hasLayer(options) && options.splats_apart ? 1u : 0u);
  return pixel_count * planes * sizeof(float);
}

}  // namespace

RenderWorkspace::RenderWorkspace() : arrays_(std::make_unique<Arrays>()) {}
RenderWorkspace::~RenderWorkspace() = default;
RenderWorkspace::RenderWorkspace(RenderWorkspace&&) noexcept = default;
RenderWorkspace& RenderWorkspace::operator=(RenderWorkspace&&) noexcept = default;

uint64_t RenderWorkspace::bytes() const {
  const VisibleSplats& visible = arrays_->visible;
  const TileListMemory& lists = arrays_->lists;
  return arrays_->scene.clouds.capacity() * sizeof(PlacedCloud) + visible.splats.bytes() +
         visible.extras.bytes() + visible.slot_spans.bytes() + visible.items[0].bytes() +
         visible.items[1].bytes() +
         (visible.filled.capacity() + visible.digits.capacity() + lists.counts.capacity()) *
             sizeof(uint32_t) +
         (lists.cursors.capacity() + lists.group.offsets.capacity()) * sizeof(uint64_t) +
         lists.group.entries.bytes() + arrays_->kept.bytes() + arrays_->passes.bytes();
}

void RenderWorkspace::keepForBackward(bool keep) {
  arrays_->kept.wanted = keep;
}

uint64_t KeptPicture::bytes() const {
  return clouds.capacity() * sizeof(const SplatCloud*) + transmittance.bytes() + ends.bytes() +
         depth.bytes();
}

uint64_t keptPictureBound(const TileGrid& grid, bool with_depth, size_t instance_count) {
  const uint64_t pixels = grid.tileCount() * kTilePixelCount;
  return pixels * (sizeof(float) + sizeof(int32_t) + (with_depth ? sizeof(float) : 0)) +
         2 * instance_count * sizeof(const SplatCloud*) +
         3 * (uint64_t{2} << 20);  // arrays on huge pages are rounded up
}

namespace {

/// One more number: no two numbers, and no two sums, lead to the same.
uint64_t mixed(uint64_t sum, float value) {
  return (sum ^ std::bit_cast<uint32_t>(value)) * 0x9e3779b97f4a7c15u;
}

uint64_t stirred(uint64_t sum) {
  sum ^= sum >> 32;
  sum *= 0xd6e8feb86659fd93u;
  return sum ^ sum >> 32;
}

/// Of positions and opacities of rows [begin, end).
uint64_t hashOfRows(const SplatCloud& cloud, size_t begin, size_t end) {
  uint64_t sums[4] = {begin, 1, 2, 3};  // side by side: each waits for itself only
  for (size_t row = begin; row < end; ++row) {
    for (size_t k = 0; k < 3; ++k) sums[k] = mixed(sums[k], cloud.positions[row * 3 + k]);
    sums[3] = mixed(sums[3], cloud.opacities[row]);
  }
  uint64_t hash = 0;
  for (const uint64_t sum : sums) hash = stirred(hash ^ stirred(sum));
  return hash;
}

}  // namespace

uint64_t fingerprintOf(const PlacedScene& scene, const VisibleSplats& visible) {
  constexpr size_t kSamples = 32;
  constexpr size_t kHashedRows = 8192;
  uint64_t sum = visible.count;
  for (const PlacedCloud& placed : scene.clouds) {
    // Added up, which has the same result in every order.
    std::atomic<uint64_t> hashes{0};
    const auto hash_rows = [&](size_t begin, size_t end) {
      hashes.fetch_add(hashOfRows(*placed.cloud, begin, end), std::memory_order_relaxed);
    };
    parallelFor(placed.cloud->size(), kHashedRows, std::cref(hash_rows));
    sum = stirred(sum ^ hashes.load());
  }
  for (size_t i = 0; i < std::min(kSamples, visible.count); ++i) {
    const uint32_t splat = visible.extraAt(i * visible.count / kSamples % visible.count).index;
    const PlacedCloud& placed = scene.clouds[cloudOfSplat(scene, splat)];
    const size_t row = splat - placed.first_index;
    const SplatCloud& cloud = *placed.cloud;
    for (size_t k = 0; k < 4; ++k) sum = mixed(sum, cloud.rotations[row * 4 + k]);
    for (size_t k = 0; k < 3; ++k) sum = mixed(sum, cloud.scales[row * 3 + k]);
    for (size_t k = 0; k < 3; ++k) sum = mixed(sum, cloud.sh[row * cloud.shStride() + k]);
    sum = stirred(sum);
  }
  return sum;
}

namespace {

void prepareKept(std::span<const SplatInstance> instances, const Camera& camera,
                 const RenderOptions& options, RenderWorkspace::Arrays& arrays) {
  KeptPicture& kept = arrays.kept;
  const size_t pixels = TileGrid(camera.width, camera.height).tileCount() * kTilePixelCount;
  kept.width = camera.width;
  kept.height = camera.height;
  kept.with_background = options.with_background;
  kept.with_depth = options.with_depth;
  std::copy(options.background, options.background + 3, kept.background);
  kept.clouds.clear();
  for (const SplatInstance& instance : instances) kept.clouds.push_back(instance.cloud);
  kept.fingerprint = fingerprintOf(arrays.scene, arrays.visible);
  kept.transmittance.resize(pixels);
  kept.ends.resize(pixels);
  kept.depth.resize(options.with_depth ? pixels : 0);
}

/// Draws into `result` and keeps what `kept` wants, where not null.
void drawTiles(TileKernel kernel, Projector projector, std::span<const SplatInstance> instances,
               const Camera& camera, const RenderOptions& options, RenderWorkspace& workspace,
               RenderResult* result, KeptPicture* kept, Progress* progress) {
  static std::atomic<uint64_t> pictures{0};
  if (kept && hasLayer(options)) {
    fail(ErrorCode::kUnsupported,
         "the image has a surface; images that a backward pass goes on from can have none");
  }
  if (kept && options.least_alpha != kMinAlpha) {
    fail(ErrorCode::kUnsupported, "min_alpha is " + std::to_string(options.least_alpha) +
                                      "; images that a backward pass goes on from have 1/255");
  }
  auto& [scene, visible, lists, last, passes] = workspace.arrays();
  last.number = 0;  // also where this fails on the way
  placeSceneUnread(instances, camera, options, scene);
  if (kept && scene.has_holdouts) {
    fail(ErrorCode::kUnsupported,
         "an instance is a holdout; images that a backward pass goes on from can have none");
  }
  advance(progress, 0.0, "Projecting splats");
  findVisibleSplats(projector, scene, progress, visible);
  if (kept) prepareKept(instances, camera, options, workspace.arrays());
  if (result) {
    prepareResult(camera, options, *result);
    result->visible_count = visible.count;
    findPassSplats(scene, visible, options, passes);
  }
  const TileTargets targets = {result, kept, result && hasPasses(options) ? &passes : nullptr};

  const TileGrid grid(camera.width, camera.height);
  const TileCutOff cut_off = cutOffOf(options.least_alpha);
  std::atomic<size_t> finished_tiles{0};
  const auto render_group = [&](const TileListGroup& group) {
    const auto render_tiles = [&](size_t begin, size_t end) {
      for (size_t index = group.first_tile + begin; index < group.first_tile + end; ++index) {
        if (progress) progress->throwIfCancelled();
        Tile tile = tileOf(grid, index, group.tile(index));
        tile.listed_behind = group.listedBehind(index);
        tile.cut_off = cut_off;
        renderTile(visible.slots(), tile, index, kernel, options, scene.has_holdouts, targets);
        const size_t finished = finished_tiles.fetch_add(1, std::memory_order_relaxed) + 1;
        if (finished % grid.columns == 0) {
          advance(progress, static_cast<double>(finished) / static_cast<double>(grid.tileCount()),
                  "Blending splats");
        }
      }
    };
    parallelFor(group.end_tile - group.first_tile, 1, std::cref(render_tiles));
  };
  forEachTileGroup(visible, grid, progress, lists, std::cref(render_group));
  const uint64_t number = pictures.fetch_add(1, std::memory_order_relaxed) + 1;
  if (result) result->number = number;
  if (kept) kept->number = number;
}

}  // namespace

void renderTiledWith(TileKernel kernel, Projector projector,
                     std::span<const SplatInstance> instances, const Camera& camera,
                     const RenderOptions& options, RenderWorkspace& workspace, RenderResult& result,
                     Progress* progress) {
  KeptPicture& kept = workspace.arrays().kept;
  drawTiles(kernel, projector, instances, camera, options, workspace, &result,
            kept.wanted ? &kept : nullptr, progress);
}

void blendTiledWith(TileKernel kernel, Projector projector,
                    std::span<const SplatInstance> instances, const Camera& camera,
                    const RenderOptions& options, RenderWorkspace& workspace, Progress* progress) {
  drawTiles(kernel, projector, instances, camera, options, workspace, nullptr,
            &workspace.arrays().kept, progress);
}

RenderResult renderTiledWith(TileKernel kernel, std::span<const SplatInstance> instances,
                             const Camera& camera, const RenderOptions& options,
                             Progress* progress) {
  RenderWorkspace workspace;
  RenderResult result;
  renderTiledWith(kernel, chosenProjector(), instances, camera, options, workspace, result,
                  progress);
  return result;
}

void renderTiled(std::span<const SplatInstance> instances, const Camera& camera,
                 const RenderOptions& options, RenderWorkspace& workspace, RenderResult& result,
                 Progress* progress) {
  renderTiledWith(chosenTileKernel(), chosenProjector(), instances, camera, options, workspace,
                  result, progress);
}

RenderResult renderTiled(std::span<const SplatInstance> instances, const Camera& camera,
                         const RenderOptions& options, Progress* progress) {
  return renderTiledWith(chosenTileKernel(), instances, camera, options, progress);
}

RenderMemory renderMemory(std::span<const SplatInstance> instances, const Camera& camera,
                          const RenderOptions& options, bool keeps_for_backward) {
  uint64_t splat_count = 0;
  for (const SplatInstance& instance : instances) {
    if (instance.cloud) splat_count += instance.cloud->size();
  }
  validate(camera);
  const TileGrid grid(camera.width, camera.height);
  const TileListsBound lists = tileListsBound(splat_count, grid);
  RenderMemory memory;
  memory.splat_bytes =
      visibleSplatsMemoryBound(splat_count) + passSplatsBound(splat_count, options);
  memory.pair_bytes = lists.pair_bytes;
  memory.pixel_bytes = lists.other_bytes;
  if (keeps_for_backward) {
    memory.pixel_bytes += keptPictureBound(grid, options.with_depth, instances.size());
  }
  memory.result_bytes = resultBytes(camera, options);
  memory.other_bytes = 2 * instances.size() * sizeof(PlacedCloud);
  if (options.object_order == ObjectOrder::kApart) {
    memory.other_bytes += objectSortBound(splat_count, instances.size());
  }
  return memory;
}

uint64_t renderMemoryBound(std::span<const SplatInstance> instances, const Camera& camera,
                           const RenderOptions& options) {
  return renderMemory(instances, camera, options).sum();
}

}  // namespace stipple
