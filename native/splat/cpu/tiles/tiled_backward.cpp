#include "splat/cpu/tiles/tiled_backward.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "base/error.h"
#include "base/parallel.h"
#include "splat/cpu/back_projector.h"
#include "splat/cpu/backward_sums.h"
#include "splat/cpu/tiles/tile_backward.h"

// Tiles run side by side and write one set of sums per entry of their list; then each splat adds
// its own in the order of the tiles; then projection and colour of each splat are taken back, in
// the order of the clouds, and every row of the result is written, once.

namespace stipple {

namespace {

/// Entries whose tile sums are held at once, unless a single tile has more.
constexpr uint64_t kHeldEntries = 1u << 20;
constexpr size_t kTileGrain = 4;
/// Rows that a back projector is given at once.
constexpr size_t kRowsAtOnce = 256;

void requireSize(std::span<const float> values, size_t pixel_count, size_t channels,
                 bool may_be_empty, const char* what) {
  if (values.empty() && may_be_empty) return;
  if (values.size() == pixel_count * channels) return;
  fail(ErrorCode::kInvalidArgument, std::string(what) + " holds " + std::to_string(values.size()) +
                                        " values; the image has " + std::to_string(pixel_count) +
                                        " pixels of " + std::to_string(channels));
}

void requireRange(std::span<const float> values, float least, const char* what) {
  for (const float value : values) {
    // By bits: infinity and NaN are above the largest, and comparing NaN would raise a trap.
    const bool in_range =
        (std::bit_cast<uint32_t>(value) & 0x7fffffffu) <= std::bit_cast<uint32_t>(kLargestInput);
    if (in_range && value >= least) continue;
    fail(ErrorCode::kInvalidArgument, std::string(what) + " holds " + std::to_string(value) + "; " +
                                          std::to_string(static_cast<double>(least)) + " to " +
                                          std::to_string(static_cast<double>(kLargestInput)) +
                                          " is allowed");
  }
}

/// Whether nothing is asked for but blending weights, which need no loss.
bool wantsOnlyWeights(const BackwardInput& input) {
  return input.with_blending_weights && input.colour_gradient.empty() && input.residual.empty() &&
         input.depth_gradient.empty() && input.edge_weights.empty() && input.errors.empty() &&
         input.coverage_gradient == 0 && !input.with_screen_gradients &&
         !input.with_absolute_screen_gradients && !input.with_covered;
}

void requireSizes(const KeptPicture& picture, const BackwardInput& input) {
  const size_t pixel_count = static_cast<size_t>(picture.width) * picture.height;
  requireSize(input.colour_gradient, pixel_count, 4, wantsOnlyWeights(input), "colour_gradient");
  requireSize(input.depth_gradient, pixel_count, 1, true, "depth_gradient");
  requireSize(input.residual, pixel_count, 3, true, "residual");
  requireSize(input.residual_weights, pixel_count, 1, true, "residual_weights");
  requireSize(input.edge_weights, pixel_count, 1, true, "edge_weights");
  requireSize(input.errors, pixel_count, 1, true, "errors");
  if (!std::isfinite(input.coverage_gradient) ||
      std::abs(input.coverage_gradient) > static_cast<double>(kLargestInput)) {
    fail(ErrorCode::kInvalidArgument, "coverage_gradient is " +
                                          std::to_string(input.coverage_gradient) +
                                          "; -1e4 to 1e4 is allowed");
  }
}

/// Names the value that the tiles found.
void requireRanges(const BackwardInput& input) {
  requireRange(input.colour_gradient, -kLargestInput, "colour_gradient");
  requireRange(input.depth_gradient, -kLargestInput, "depth_gradient");
  requireRange(input.residual, -kLargestInput, "residual");
  requireRange(input.residual_weights, 0.0f, "residual_weights");
  requireRange(input.edge_weights, -kLargestInput, "edge_weights");
  requireRange(input.errors, 0.0f, "errors");
}

BackwardWants wantsOf(const BackwardInput& input) {
  if (wantsOnlyWeights(input)) return {BackwardMode::kWeights, false};
  const bool with_depth = !input.depth_gradient.empty();
  if (input.with_blending_weights || input.with_absolute_screen_gradients || input.with_covered ||
      !input.errors.empty()) {
    return {BackwardMode::kStatistics, with_depth};
  }
  if (!input.edge_weights.empty()) {
    const bool is_alone = input.residual.empty() && !with_depth;
    return {is_alone ? BackwardMode::kEdges : BackwardMode::kStatistics, with_depth};
  }
  return {input.residual.empty() ? BackwardMode::kGradients : BackwardMode::kContributions,
          with_depth};
}

bool isWanted(const GradientArray& array, const BackwardInput& input) {
  const auto isOneOf = [&](auto... arrays) { return ((array.values == arrays) || ...); };
  using G = SplatGradients;
  if (!array.is_statistic) return !input.colour_gradient.empty();
  if (isOneOf(&G::contributions)) return !input.residual.empty();
  if (isOneOf(&G::blending_weights)) return input.with_blending_weights;
  if (isOneOf(&G::edge_weights)) return !input.edge_weights.empty();
  if (isOneOf(&G::errors, &G::largest_errors)) return !input.errors.empty();
  if (isOneOf(&G::screen_gradients)) return input.with_screen_gradients;
  if (isOneOf(&G::covered_pixels, &G::covered_distances)) return input.with_covered;
  if (isOneOf(&G::covered_errors)) return input.with_covered && !input.errors.empty();
  return input.with_absolute_screen_gradients;
}

/// Calls use(array, values per splat) for every array of the result that is wanted.
template <typename Use>
void forEachArray(const SplatCloud& cloud, const BackwardInput& input, const Use& use) {
  for (const GradientArray& array : kGradientArrays) {
    if (!isWanted(array, input)) continue;
    use(array.values, array.per_splat == 0 ? cloud.shStride() : array.per_splat);
  }
}

void clearUnwanted(const BackwardInput& input, SplatGradients& gradients) {
  for (const GradientArray& array : kGradientArrays) {
    if (!isWanted(array, input)) (gradients.*array.values).clear();
  }
}

/// Takes the splats off every tile and adds their sums; returns dL/dbackground.
std::array<double, 3> takeOffTiles(const BackwardKernel& kernel, RenderWorkspace::Arrays& drawn,
                                   const PictureLoss& loss, BackwardWorkspace::Arrays& arrays,
                                   Progress* progress) {
  const TileGrid grid(loss.picture->width, loss.picture->height);
  const VisibleSplats& visible = drawn.visible;
  const size_t field_count = backwardFieldCount(loss.wants);
  arrays.backgrounds.assign(grid.tileCount() * 3, 0.0);
  arrays.used.resize(grid.tileCount());
  std::atomic<bool> input_is_good{true};
  // By reference where they are handed over: a std::function of a large capture allocates.
  const auto take_off_group = [&](const TileListGroup& group) {
    const auto entriesBefore = [&](size_t tile) { return group.offsets[tile - group.first_tile]; };
    for (size_t first = group.first_tile; first < group.end_tile;) {
      size_t end = first + 1;
      while (end < group.end_tile &&
             entriesBefore(end + 1) - entriesBefore(first) <= kHeldEntries) {
        ++end;
      }
      const uint64_t entries = entriesBefore(end) - entriesBefore(first);
      float* tile_sums = arrays.tile_sums.resize(entries * field_count);
      const auto take_off_tiles = [&](size_t from, size_t to) {
        if (progress) progress->throwIfCancelled();
        std::unique_ptr<TileBackward> scratch = arrays.scratch.take();
        scratch->begin(kernel, visible.slots(), loss);
        const auto tileAt = [&](size_t tile) { return tileOf(grid, tile, group.tile(tile)); };
        Tile next = tileAt(first + from);
        for (size_t tile = first + from; tile < first + to; ++tile) {
          const Tile current = next;
          // The tile behind this range is most often this thread's next.
          const bool is_last = tile + 1 == end;
          if (!is_last) next = tileAt(tile + 1);
          const uint64_t entry = entriesBefore(tile) - entriesBefore(first);
          arrays.used[tile] =
              scratch->run(current, tile, is_last ? nullptr : &next,
                           tile_sums + entry * field_count, &arrays.backgrounds[tile * 3]);
        }
        if (!scratch->inputIsGood()) input_is_good.store(false, std::memory_order_relaxed);
        arrays.scratch.giveBack(std::move(scratch));
      };
      parallelFor(end - first, kTileGrain, std::ref(take_off_tiles));
      arrays.sums.add(visible, grid, drawn.lists, {first, end, tile_sums, arrays.used.data()});
      first = end;
      advance(progress, static_cast<double>(first) / static_cast<double>(grid.tileCount()),
              "Taking splats off");
    }
  };
  const TileListGroup& group = drawn.lists.group;
  if (group.first_tile == 0 && group.end_tile == grid.tileCount()) {
    take_off_group(group);
  } else {
    forEachTileGroup(visible, grid, progress, drawn.lists, std::ref(take_off_group));
  }
  if (!input_is_good) requireRanges(*loss.input);
  std::array<double, 3> total{};
  if (!loss.picture->with_background) return total;
  for (size_t i = 0; i < arrays.backgrounds.size(); ++i) total[i % 3] += arrays.backgrounds[i];
  return total;
}

void storeStatistics(const BackwardInput& input, BackwardMode mode, const float* sums,
                     const double* mean, size_t index, SplatGradients& out) {
  if (!input.residual.empty()) out.contributions[index] = sums[kFieldContribution];
  if (input.with_blending_weights) {
    out.blending_weights[index] =
        sums[mode == BackwardMode::kWeights ? kFieldWeightAlone : kFieldWeight];
  }
  if (!input.edge_weights.empty()) {
    out.edge_weights[index] = sums[mode == BackwardMode::kEdges ? kFieldEdgeAlone : kFieldEdge];
  }
  if (input.with_screen_gradients) {
    for (size_t axis = 0; axis < 2; ++axis) {
      out.screen_gradients[index * 2 + axis] = static_cast<float>(mean[axis]);
    }
  }
  if (input.with_absolute_screen_gradients) {
    for (size_t axis = 0; axis < 2; ++axis) {
      out.absolute_screen_gradients[index * 2 + axis] = sums[kFieldAbsoluteX + axis];
    }
    out.screen_gradient_norms[index] = sums[kFieldNorm];
  }
  if (!input.errors.empty()) {
    out.errors[index] = sums[kFieldError];
    out.largest_errors[index] = sums[kFieldLargestError];
  }
  if (!input.with_covered) return;
  out.covered_pixels[index] = sums[kFieldPixels];
  out.covered_distances[index] = sums[kFieldDistances];
  if (!input.errors.empty()) out.covered_errors[index] = sums[kFieldPixelErrors];
}

/// Slots [begin, end).
struct SlotRange {
  size_t begin, end;
};

/// Writes rows [begin, end) of one cloud's result, whose splats have the first of `slots`; takes
/// those away. Adds to the camera's derivative [6].
void takeBackRows(BackProjector project, const PlacedScene& scene, const PlacedCloud& placed,
                  const BackwardInput& input, const SplatSlots& all, const BackwardSums& sums,
                  SlotRange& slots, size_t begin, size_t end, SplatGradients& out, double* camera) {
  uint32_t rows[kRowsAtOnce];
  uint32_t places[kRowsAtOnce];
  double means[kRowsAtOnce * 2];
  SummedRows summed{rows, places, 0, sums.of(0), sums.stride(), {}};
  if (!input.depth_gradient.empty()) summed.depth_field = sums.fieldCount() - 1;
  const BackwardMode mode = wantsOf(input).mode;
  const auto flush = [&] {
    if (mode != BackwardMode::kWeights) project(scene, placed, summed, out, means, camera);
    for (size_t i = 0; i < summed.count; ++i) {
      storeStatistics(input, mode, summed.sumsOf(i), means + i * 2, rows[i], out);
    }
    summed.count = 0;
  };
  const auto clear = [&](size_t first, size_t last) {
    if (first == last) return;
    forEachArray(*placed.cloud, input,
                 [&](std::vector<float> SplatGradients::*array, size_t per_splat) {
                   float* values = (out.*array).data();
                   std::fill(values + first * per_splat, values + last * per_splat, 0.0f);
                 });
  };
  size_t written = begin;
  for (; slots.begin < slots.end; ++slots.begin) {
    const size_t row = all.extras[slots.begin].index - placed.first_index;
    if (row >= end) break;
    if (!sums.isTouched(slots.begin)) continue;
    clear(written, row);
    written = row + 1;
    rows[summed.count] = static_cast<uint32_t>(row);
    places[summed.count++] = static_cast<uint32_t>(slots.begin);
    if (summed.count == kRowsAtOnce) flush();
  }
  clear(written, end);
  if (summed.count > 0) flush();
}

/// Writes the result of every splat.
void takeBackSplats(BackProjector project, const RenderWorkspace::Arrays& drawn,
                    const BackwardInput& input, BackwardWorkspace::Arrays& arrays,
                    BackwardResult& result, Progress* progress) {
  const PlacedScene& scene = drawn.scene;
  arrays.cameras.assign(rangeCount(scene.splat_count, kRangeSplats), {});
  const auto take_back = [&](size_t begin, size_t end) {
    if (progress) progress->throwIfCancelled();
    double* camera = arrays.cameras[begin / kRangeSplats].data();
    SlotRange slots{begin, begin + drawn.visible.slotCount(begin)};
    for (size_t cloud = cloudOfSplat(scene, begin); begin < end; ++cloud) {
      const PlacedCloud& placed = scene.clouds[cloud];
      const size_t first = begin - placed.first_index;
      const size_t last = std::min<size_t>(end - placed.first_index, placed.cloud->size());
      takeBackRows(project, scene, placed, input, drawn.visible.slots(), arrays.sums, slots, first,
                   last, result.instances[placed.instance], camera);
      begin = placed.first_index + last;
    }
  };
  parallelFor(scene.splat_count, kRangeSplats, std::ref(take_back));
  result.camera = {};
  for (const std::array<double, 6>& part : arrays.cameras) {
    for (size_t k = 0; k < 6; ++k) result.camera[k] += part[k];
  }
}

void prepareResult(const KeptPicture& picture, const BackwardInput& input, BackwardResult& result) {
  result.instances.resize(picture.clouds.size());
  for (size_t i = 0; i < picture.clouds.size(); ++i) {
    const SplatCloud& cloud = *picture.clouds[i];
    clearUnwanted(input, result.instances[i]);
    forEachArray(cloud, input, [&](std::vector<float> SplatGradients::*array, size_t per_splat) {
      (result.instances[i].*array).resize(cloud.size() * per_splat);
    });
  }
}

/// The clouds must be what was drawn: everything else was found out from them.
void requireSame(const RenderWorkspace::Arrays& drawn) {
  const PlacedScene& scene = drawn.scene;
  bool is_same = true;
  for (size_t i = 0; i < scene.clouds.size() && is_same; ++i) {
    const PlacedCloud& placed = scene.clouds[i];
    const uint64_t end =
        i + 1 < scene.clouds.size() ? scene.clouds[i + 1].first_index : scene.splat_count;
    is_same = placed.cloud->size() == end - placed.first_index;
    if (is_same) validateSizes(*placed.cloud, "a cloud that was drawn");
  }
  if (is_same && fingerprintOf(scene, drawn.visible) == drawn.kept.fingerprint) return;
  fail(ErrorCode::kInvalidArgument,
       "the splats changed after their image was drawn; draw them again, then go backward");
}

uint64_t resultBytes(const SplatCloud* cloud, const BackwardInput& input) {
  uint64_t bytes = sizeof(SplatGradients);
  if (!cloud) return bytes;
  forEachArray(*cloud, input, [&](auto, uint64_t per_splat) {
    bytes += cloud->size() * per_splat * sizeof(float);
  });
  return bytes;
}

/// Of a picture that is there, beside the result.
uint64_t backwardBound(uint64_t splat_count, const TileGrid& grid, const BackwardInput& input) {
  const BackwardWants wants = wantsOf(input);
  const uint64_t entries =
      std::min<uint64_t>(splat_count * grid.tileCount(), std::max(splat_count, kHeldEntries));
  const uint64_t threads = std::max(1u, std::thread::hardware_concurrency());
  return BackwardSums::memoryBound(splat_count, grid, wants) +
         entries * backwardFieldCount(wants) * sizeof(float) +
         grid.tileCount() * (3 * sizeof(double) + sizeof(uint32_t)) +
         threads * (TileBackward::memoryBound() + sizeof(TileBackward)) +
         rangeCount(splat_count, kRangeSplats) * sizeof(std::array<double, 6>);
}

void requireMemory(uint64_t needed, uint64_t limit, size_t splat_count) {
  if (needed <= limit) return;
  fail(ErrorCode::kMemoryLimit, "the backward pass of " + std::to_string(splat_count) +
                                    " splats needs up to " + std::to_string(needed) + " bytes; " +
                                    std::to_string(limit) + " are allowed");
}

/// From the picture that `drawn` keeps, whichever that is.
void goBackward(const BackwardKernel& kernel, BackProjector project, RenderWorkspace::Arrays& drawn,
                const BackwardInput& input, BackwardWorkspace::Arrays& arrays,
                BackwardResult& result, Progress* progress) {
  const PictureLoss loss{&input, &drawn.kept, wantsOf(input)};
  arrays.sums.reset(drawn.scene.splat_count, loss.wants);
  const std::array<double, 3> background = takeOffTiles(kernel, drawn, loss, arrays, progress);
  prepareResult(drawn.kept, input, result);
  result.background = background;
  result.visible_count = drawn.visible.count;
  takeBackSplats(project, drawn, input, arrays, result, progress);
  advance(progress, 1.0, "Taking splats off");
}

}  // namespace

std::unique_ptr<TileBackward> TileScratch::take() {
  const std::lock_guard lock(mutex_);
  if (idle_.empty()) return std::make_unique<TileBackward>();
  std::unique_ptr<TileBackward> one = std::move(idle_.back());
  idle_.pop_back();
  return one;
}

void TileScratch::giveBack(std::unique_ptr<TileBackward> one) {
  const std::lock_guard lock(mutex_);
  idle_.push_back(std::move(one));
}

BackwardWorkspace::BackwardWorkspace() : arrays_(std::make_unique<Arrays>()) {}
BackwardWorkspace::~BackwardWorkspace() = default;
BackwardWorkspace::BackwardWorkspace(BackwardWorkspace&&) noexcept = default;
BackwardWorkspace& BackwardWorkspace::operator=(BackwardWorkspace&&) noexcept = default;

void renderBackwardWith(const BackwardKernel& kernel, BackProjector project, RenderWorkspace& drawn,
                        const RenderResult& picture, const BackwardInput& input,
                        BackwardWorkspace& workspace, BackwardResult& result,
                        uint64_t memory_limit_bytes, Progress* progress) {
  RenderWorkspace::Arrays& arrays = drawn.arrays();
  const KeptPicture& kept = arrays.kept;
  if (kept.number == 0) {
    fail(ErrorCode::kInvalidArgument,
         "the workspace keeps no image; call keepForBackward(true) before one is drawn into it");
  }
  if (picture.number != kept.number) {
    fail(ErrorCode::kInvalidArgument, "image " + std::to_string(picture.number) +
                                          " is not what the workspace drew last, which is image " +
                                          std::to_string(kept.number));
  }
  requireSizes(kept, input);
  if (!input.depth_gradient.empty() && !kept.with_depth) {
    fail(ErrorCode::kInvalidArgument,
         "depth_gradient is given for an image that was drawn without depth");
  }
  requireSame(arrays);
  requireMemory(backwardMemoryBound(drawn, input), memory_limit_bytes, arrays.scene.splat_count);
  goBackward(kernel, project, arrays, input, workspace.arrays(), result, progress);
}

void renderBackward(RenderWorkspace& drawn, const RenderResult& picture, const BackwardInput& input,
                    BackwardWorkspace& workspace, BackwardResult& result,
                    uint64_t memory_limit_bytes, Progress* progress) {
  renderBackwardWith(chosenBackwardKernel(), chosenBackProjector(), drawn, picture, input,
                     workspace, result, memory_limit_bytes, progress);
}

uint64_t backwardMemoryBound(RenderWorkspace& drawn, const BackwardInput& input) {
  const KeptPicture& kept = drawn.arrays().kept;
  uint64_t splat_count = 0;
  uint64_t result_bytes = 0;
  for (const SplatCloud* cloud : kept.clouds) {
    splat_count += cloud->size();
    result_bytes += resultBytes(cloud, input);
  }
  return result_bytes + backwardBound(splat_count, TileGrid(kept.width, kept.height), input);
}

void renderBackwardWith(const BackwardKernel& kernel, BackProjector project,
                        std::span<const SplatInstance> instances, const Camera& camera,
                        const RenderOptions& options, const BackwardInput& input,
                        BackwardWorkspace& workspace, BackwardResult& result,
                        uint64_t memory_limit_bytes, Progress* progress) {
  BackwardWorkspace::Arrays& arrays = workspace.arrays();
  RenderWorkspace::Arrays& drawn = arrays.own_picture.arrays();
  placeSceneUnread(instances, camera, options, drawn.scene);
  KeptPicture size;
  size.width = camera.width;
  size.height = camera.height;
  requireSizes(size, input);
  requireMemory(backwardMemoryBound(instances, camera, options, input), memory_limit_bytes,
                drawn.scene.splat_count);
  RenderOptions needed = options;
  needed.with_depth = !input.depth_gradient.empty();
  needed.with_median_depth = needed.with_counts = false;
  blendTiledWith(kernel.blend, chosenProjector(), instances, camera, needed, arrays.own_picture,
                 progress);
  goBackward(kernel, project, drawn, input, arrays, result, progress);
}

BackwardResult renderBackwardWith(const BackwardKernel& kernel, BackProjector project,
                                  std::span<const SplatInstance> instances, const Camera& camera,
                                  const RenderOptions& options, const BackwardInput& input,
                                  uint64_t memory_limit_bytes, Progress* progress) {
  BackwardWorkspace workspace;
  BackwardResult result;
  renderBackwardWith(kernel, project, instances, camera, options, input, workspace, result,
                     memory_limit_bytes, progress);
  return result;
}

void renderBackward(std::span<const SplatInstance> instances, const Camera& camera,
                    const RenderOptions& options, const BackwardInput& input,
                    BackwardWorkspace& workspace, BackwardResult& result,
                    uint64_t memory_limit_bytes, Progress* progress) {
  renderBackwardWith(chosenBackwardKernel(), chosenBackProjector(), instances, camera, options,
                     input, workspace, result, memory_limit_bytes, progress);
}

BackwardResult renderBackward(std::span<const SplatInstance> instances, const Camera& camera,
                              const RenderOptions& options, const BackwardInput& input,
                              uint64_t memory_limit_bytes, Progress* progress) {
  return renderBackwardWith(chosenBackwardKernel(), chosenBackProjector(), instances, camera,
                            options, input, memory_limit_bytes, progress);
}

uint64_t backwardMemoryBound(std::span<const SplatInstance> instances, const Camera& camera,
                             const RenderOptions& options, const BackwardInput& input) {
  validate(camera);
  const TileGrid grid(camera.width, camera.height);
  uint64_t splat_count = 0;
  uint64_t result_bytes = 0;
  for (const SplatInstance& instance : instances) {
    splat_count += instance.cloud ? instance.cloud->size() : 0;
    result_bytes += resultBytes(instance.cloud, input);
  }
  const RenderMemory forward = renderMemory(instances, camera, options);
  return forward.splat_bytes + forward.pixel_bytes + forward.pair_bytes + forward.other_bytes +
         keptPictureBound(grid, !input.depth_gradient.empty(), instances.size()) + result_bytes +
         backwardBound(splat_count, grid, input);
}

}  // namespace stipple
