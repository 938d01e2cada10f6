#include "splat/cpu/tiled_backward.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "base/error.h"
#include "base/parallel.h"
#include "math/affine.h"
#include "splat/cpu/backward_sums.h"
#include "splat/cpu/tile_backward.h"
#include "splat/projection_backward.h"
#include "splat/scene_backward.h"

// Tiles run side by side and write one set of sums per entry of their list; then each splat adds
// its own in the order of the tiles; then the projection of each splat is taken back.

namespace stipple {

namespace {

/// Entries whose tile sums are held at once, unless a single tile has more.
constexpr uint64_t kHeldEntries = 1u << 20;
constexpr size_t kTileGrain = 4;
constexpr size_t kSplatGrain = 2048;
constexpr size_t kPrefetchDistance = 8;
constexpr uint32_t kNotVisible = std::numeric_limits<uint32_t>::max();
/// Largest derivative or weight that is accepted: with colours up to 6e28 (the largest that the
/// renderer makes) every float32 product and sum of a tile stays below 3e38.
constexpr double kLargestInput = 1e4;

void requirePicture(std::span<const float> values, size_t pixel_count, size_t channels, float least,
                    bool may_be_empty, const char* what) {
  if (values.empty() && may_be_empty) return;
  if (values.size() != pixel_count * channels) {
    fail(ErrorCode::kInvalidArgument,
         std::string(what) + " holds " + std::to_string(values.size()) +
             " values; the picture has " + std::to_string(pixel_count) + " pixels of " +
             std::to_string(channels));
  }
  const auto good = [least](float value) {
    // By bits: infinity and NaN are above the largest, and comparing NaN would raise a trap.
    const bool in_range = (std::bit_cast<uint32_t>(value) & 0x7fffffffu) <=
                          std::bit_cast<uint32_t>(static_cast<float>(kLargestInput));
    return in_range && value >= least;
  };
  // The top bit of the difference is set where a value is above the largest.
  constexpr uint32_t kLargestBits = std::bit_cast<uint32_t>(static_cast<float>(kLargestInput));
  uint32_t above = 0;
  for (const float value : values) {
    above |= kLargestBits - (std::bit_cast<uint32_t>(value) & 0x7fffffffu);
  }
  if (!(above & 0x80000000u) && least < 0.0f) return;
  for (const float value : values) {
    if (good(value)) continue;
    fail(ErrorCode::kInvalidArgument, std::string(what) + " holds " + std::to_string(value) + "; " +
                                          std::to_string(static_cast<double>(least)) + " to " +
                                          std::to_string(kLargestInput) + " is allowed");
  }
}

void validateInput(const Camera& camera, const BackwardInput& input) {
  const size_t pixel_count = static_cast<size_t>(camera.width) * camera.height;
  constexpr float kAny = -static_cast<float>(kLargestInput);
  requirePicture(input.colour_gradient, pixel_count, 4, kAny, false, "colour_gradient");
  requirePicture(input.residual, pixel_count, 3, kAny, true, "residual");
  requirePicture(input.residual_weights, pixel_count, 1, 0.0f, true, "residual_weights");
  requirePicture(input.edge_weights, pixel_count, 1, kAny, true, "edge_weights");
  requirePicture(input.errors, pixel_count, 1, 0.0f, true, "errors");
}

BackwardMode modeOf(const BackwardInput& input) {
  if (input.with_blending_weights || input.with_screen_gradients || !input.edge_weights.empty() ||
      !input.errors.empty()) {
    return BackwardMode::kStatistics;
  }
  return input.residual.empty() ? BackwardMode::kGradients : BackwardMode::kContributions;
}

/// Calls use(array, values per splat) for every array of the result that is wanted.
template <typename Use>
void forEachArray(const SplatCloud& cloud, const BackwardInput& input, const Use& use) {
  use(&SplatGradients::positions, 3);
  use(&SplatGradients::rotations, 4);
  use(&SplatGradients::scales, 3);
  use(&SplatGradients::opacities, 1);
  use(&SplatGradients::sh, cloud.shStride());
  if (!input.residual.empty()) use(&SplatGradients::contributions, 1);
  if (input.with_blending_weights) use(&SplatGradients::blending_weights, 1);
  if (!input.edge_weights.empty()) use(&SplatGradients::edge_weights, 1);
  if (input.with_screen_gradients) {
    use(&SplatGradients::screen_gradients, 2);
    use(&SplatGradients::absolute_screen_gradients, 2);
    use(&SplatGradients::screen_gradient_norms, 1);
  }
  if (!input.errors.empty()) {
    use(&SplatGradients::errors, 1);
    use(&SplatGradients::largest_errors, 1);
  }
}

void clearUnwanted(const BackwardInput& input, SplatGradients& gradients) {
  if (input.residual.empty()) gradients.contributions.clear();
  if (!input.with_blending_weights) gradients.blending_weights.clear();
  if (input.edge_weights.empty()) gradients.edge_weights.clear();
  if (!input.with_screen_gradients) {
    gradients.screen_gradients.clear();
    gradients.absolute_screen_gradients.clear();
    gradients.screen_gradient_norms.clear();
  }
  if (input.errors.empty()) {
    gradients.errors.clear();
    gradients.largest_errors.clear();
  }
}

/// Takes the splats off every tile; returns dL/dbackground.
std::array<double, 3> takeOffTiles(const BackwardKernel& kernel, const TileGrid& grid,
                                   const PictureLoss& loss, BackwardWorkspace::Arrays& arrays,
                                   Progress* progress) {
  const VisibleSplats& visible = arrays.forward.visible;
  const size_t field_count = backwardFieldCount(loss.mode);
  arrays.backgrounds.assign(grid.tileCount() * 3, 0.0);
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
        scratch->begin(kernel, visible.splats.get(), loss);
        for (size_t tile = first + from; tile < first + to; ++tile) {
          const uint64_t entry = entriesBefore(tile) - entriesBefore(first);
          scratch->run(tileOf(grid, tile, group.tile(tile)), tile_sums + entry * field_count,
                       &arrays.backgrounds[tile * 3]);
        }
        arrays.scratch.giveBack(std::move(scratch));
      };
      parallelFor(end - first, kTileGrain, std::ref(take_off_tiles));
      arrays.sums.add(group, first, end, tile_sums);
      first = end;
      advance(progress, static_cast<double>(first) / static_cast<double>(grid.tileCount()),
              "Taking splats off");
    }
  };
  forEachTileGroup(visible, grid, progress, arrays.forward.lists, std::ref(take_off_group));
  std::array<double, 3> total{};
  for (size_t i = 0; i < arrays.backgrounds.size(); ++i) total[i % 3] += arrays.backgrounds[i];
  return total;
}

/// The picture's splats with what taking their projection back needs.
struct Taken {
  const PlacedScene& scene;
  const BackwardInput& input;
  const std::vector<size_t>& instance_of;
  const std::vector<Mat3d>& normal_to_view;
};

void storeStatistics(const BackwardInput& input, const double* sums, const Vec2d& mean,
                     size_t index, SplatGradients& out) {
  if (!input.residual.empty()) {
    out.contributions[index] = storedGradient(sums[kFieldContribution]);
  }
  if (input.with_blending_weights) out.blending_weights[index] = storedGradient(sums[kFieldWeight]);
  if (!input.edge_weights.empty()) out.edge_weights[index] = storedGradient(sums[kFieldEdge]);
  if (input.with_screen_gradients) {
    for (size_t axis = 0; axis < 2; ++axis) {
      out.screen_gradients[index * 2 + axis] = storedGradient(mean[static_cast<int>(axis)]);
      out.absolute_screen_gradients[index * 2 + axis] =
          storedGradient(sums[kFieldAbsoluteX + axis]);
    }
    out.screen_gradient_norms[index] = storedGradient(sums[kFieldNorm]);
  }
  if (!input.errors.empty()) {
    out.errors[index] = storedGradient(sums[kFieldError]);
    out.largest_errors[index] = storedGradient(sums[kFieldLargestError]);
  }
}

/// Takes back projection and colour of one splat; adds to the camera's derivative [6].
void takeBack(const Taken& taken, uint32_t splat, const double* sums,
              std::vector<SplatGradients>& results, double* camera) {
  const size_t cloud_index = cloudOfSplat(taken.scene, splat);
  const PlacedCloud& placed = taken.scene.clouds[cloud_index];
  const SplatCloud& cloud = *placed.cloud;
  const size_t index = splat - placed.first_index;
  SplatGradients& out = results[taken.instance_of[cloud_index]];

  // e = L d is sqrt(2 ln 2) g.
  const double scale = std::sqrt(kSquaredGScale);
  FootprintGradient by_footprint;
  by_footprint.s = sums[kFieldS];
  by_footprint.first = scale * Vec2d(sums[kFieldG0], sums[kFieldG1]);
  by_footprint.second << sums[kFieldG00], sums[kFieldG01], sums[kFieldG01], sums[kFieldG11];
  by_footprint.second *= kSquaredGScale;
  const ProjectionGradient gradient = projectBackward(
      taken.scene.view, placed.linear, placed.translation, &cloud.positions[index * 3],
      &cloud.rotations[index * 4], &cloud.scales[index * 3], cloud.opacities[index],
      placed.low_pass, by_footprint);
  const Vec3d by_direction = splatColourBackward(taken.scene, placed, index, sums + kFieldRed,
                                                 &out.sh[index * cloud.shStride()]);
  const bool perspective = taken.scene.view.perspective;
  const Vec3d seen = taken.normal_to_view[cloud_index] * by_direction;
  // A camera that moves by upsilon sees a splat at p from where p - upsilon was; a parallel view
  // that turns by omega looks along its z axis turned by -omega.
  const Vec3d turn =
      perspective ? gradient.turn : Vec3d(gradient.turn - Vec3d(-seen[1], seen[0], 0.0));
  const Vec3d shift = perspective ? Vec3d(gradient.centre + seen) : gradient.centre;
  for (int axis = 0; axis < 3; ++axis) {
    camera[axis] += turn[axis];
    camera[3 + axis] += shift[axis];
  }
  for (size_t axis = 0; axis < 3; ++axis) {
    const int a = static_cast<int>(axis);
    out.positions[index * 3 + axis] =
        storedGradient(gradient.position[a] + (perspective ? by_direction[a] : 0.0));
    out.scales[index * 3 + axis] = storedGradient(gradient.scales[a]);
  }
  for (size_t k = 0; k < 4; ++k) {
    out.rotations[index * 4 + k] = storedGradient(gradient.rotation[static_cast<int>(k)]);
  }
  out.opacities[index] = storedGradient(gradient.opacity);
  storeStatistics(taken.input, sums, gradient.mean, index, out);
}

uint64_t resultBytes(std::span<const SplatInstance> instances, const BackwardInput& input) {
  uint64_t bytes = instances.size() * sizeof(SplatGradients);
  for (const SplatInstance& instance : instances) {
    if (!instance.cloud) continue;
    forEachArray(*instance.cloud, input, [&](auto, uint64_t per_splat) {
      bytes += instance.cloud->size() * per_splat * sizeof(float);
    });
  }
  return bytes;
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

void renderBackwardWith(const BackwardKernel& kernel, std::span<const SplatInstance> instances,
                        const Camera& camera, const RenderOptions& options,
                        const BackwardInput& input, BackwardWorkspace& workspace,
                        BackwardResult& result, uint64_t memory_limit_bytes, Progress* progress) {
  BackwardWorkspace::Arrays& arrays = workspace.arrays();
  PlacedScene& scene = arrays.forward.scene;
  VisibleSplats& visible = arrays.forward.visible;
  placeSceneUnread(instances, camera, options, scene);
  validateInput(camera, input);
  const uint64_t needed = backwardMemoryBound(instances, camera, options, input);
  if (needed > memory_limit_bytes) {
    fail(ErrorCode::kMemoryLimit, "the backward pass of " + std::to_string(scene.splat_count) +
                                      " splats needs up to " + std::to_string(needed) + " bytes; " +
                                      std::to_string(memory_limit_bytes) + " are allowed");
  }
  advance(progress, 0.0, "Projecting splats");
  findVisibleSplats(chosenProjector(), scene, progress, visible);

  result.visible_count = visible.count;
  result.instances.resize(instances.size());
  for (size_t i = 0; i < instances.size(); ++i) {
    const SplatCloud& cloud = *instances[i].cloud;
    clearUnwanted(input, result.instances[i]);
    forEachArray(cloud, input, [&](std::vector<float> SplatGradients::*array, size_t per_splat) {
      (result.instances[i].*array).assign(cloud.size() * per_splat, 0.0f);
    });
  }

  PictureLoss loss{&input, camera.width, options.with_background, {}, modeOf(input)};
  std::copy(options.background, options.background + 3, loss.background);
  arrays.sums.reset(visible.count, loss.mode);
  result.background =
      takeOffTiles(kernel, TileGrid(camera.width, camera.height), loss, arrays, progress);
  if (!options.with_background) result.background = {};

  arrays.instance_of.clear();
  arrays.normal_to_view.clear();
  for (size_t i = 0; i < instances.size(); ++i) {
    if (instances[i].cloud->size() > 0) arrays.instance_of.push_back(i);
  }
  for (const PlacedCloud& placed : scene.clouds) {
    arrays.normal_to_view.push_back(inverse(placed.linear).transpose());
  }
  const Taken taken{scene, input, arrays.instance_of, arrays.normal_to_view};
  // In the order of the clouds: attributes and derivatives are then read and written in a row.
  uint32_t* place_of = arrays.place_of.resize(scene.splat_count);
  std::fill(place_of, place_of + scene.splat_count, kNotVisible);
  parallelFor(visible.count, kSplatGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      place_of[visible.splats[i].index] = static_cast<uint32_t>(i);
    }
  });
  arrays.cameras.assign(rangeCount(scene.splat_count, kSplatGrain), {});
  const auto take_back = [&](size_t begin, size_t end) {
    if (progress) progress->throwIfCancelled();
    for (size_t i = begin; i < end; ++i) {
      // The sums lie in the order of depth, so each would wait for memory.
      const uint32_t ahead = place_of[std::min(i + kPrefetchDistance, end - 1)];
      if (ahead != kNotVisible) __builtin_prefetch(arrays.sums.of(ahead));
      if (place_of[i] == kNotVisible || !arrays.sums.isTouched(place_of[i])) continue;
      takeBack(taken, static_cast<uint32_t>(i), arrays.sums.of(place_of[i]), result.instances,
               arrays.cameras[begin / kSplatGrain].data());
    }
  };
  parallelFor(scene.splat_count, kSplatGrain, std::ref(take_back));
  result.camera = {};
  for (const std::array<double, 6>& part : arrays.cameras) {
    for (size_t k = 0; k < 6; ++k) result.camera[k] += part[k];
  }
  advance(progress, 1.0, "Taking splats off");
}

BackwardResult renderBackwardWith(const BackwardKernel& kernel,
                                  std::span<const SplatInstance> instances, const Camera& camera,
                                  const RenderOptions& options, const BackwardInput& input,
                                  uint64_t memory_limit_bytes, Progress* progress) {
  BackwardWorkspace workspace;
  BackwardResult result;
  renderBackwardWith(kernel, instances, camera, options, input, workspace, result,
                     memory_limit_bytes, progress);
  return result;
}

void renderBackward(std::span<const SplatInstance> instances, const Camera& camera,
                    const RenderOptions& options, const BackwardInput& input,
                    BackwardWorkspace& workspace, BackwardResult& result,
                    uint64_t memory_limit_bytes, Progress* progress) {
  renderBackwardWith(chosenBackwardKernel(), instances, camera, options, input, workspace, result,
                     memory_limit_bytes, progress);
}

BackwardResult renderBackward(std::span<const SplatInstance> instances, const Camera& camera,
                              const RenderOptions& options, const BackwardInput& input,
                              uint64_t memory_limit_bytes, Progress* progress) {
  return renderBackwardWith(chosenBackwardKernel(), instances, camera, options, input,
                            memory_limit_bytes, progress);
}

uint64_t backwardMemoryBound(std::span<const SplatInstance> instances, const Camera& camera,
                             const RenderOptions&, const BackwardInput& input) {
  validate(camera);
  uint64_t splat_count = 0;
  for (const SplatInstance& instance : instances) {
    if (instance.cloud) splat_count += instance.cloud->size();
  }
  const TileGrid grid(camera.width, camera.height);
  const BackwardMode mode = modeOf(input);
  const uint64_t entries =
      std::min<uint64_t>(splat_count * grid.tileCount(), std::max(splat_count, kHeldEntries));
  const uint64_t threads = std::max(1u, std::thread::hardware_concurrency());
  return visibleSplatsMemoryBound(splat_count) + tileListsMemoryBound(splat_count, grid) +
         resultBytes(instances, input) + BackwardSums::memoryBound(splat_count, mode) +
         entries * backwardFieldCount(mode) * sizeof(float) +
         grid.tileCount() * 3 * sizeof(double) +
         threads * (TileBackward::memoryBound() + sizeof(TileBackward)) +
         rangeCount(splat_count, kSplatGrain) * sizeof(std::array<double, 6>) +
         splat_count * sizeof(uint32_t) +
         instances.size() * (2 * sizeof(PlacedCloud) + 2 * sizeof(Mat3d) + 2 * sizeof(size_t));
}

}  // namespace stipple
