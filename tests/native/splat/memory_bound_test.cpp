#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <new>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "splat/backward_cases.h"
#include "splat/cpu/rays/ray_tiles.h"
#include "splat/random_scene.h"

// Every allocation of this test binary is counted, so that the bound is held against what a
// rendering really takes.

namespace {

std::atomic<uint64_t> held{0};
std::atomic<uint64_t> peak{0};
std::atomic<uint64_t> calls{0};

/// Room before each block for its size, keeping malloc's alignment.
constexpr size_t kHeader = 16;

/// Null where there is no memory.
[[maybe_unused]] void* allocateIfPossible(size_t size) {
  auto* block = static_cast<std::byte*>(std::malloc(size + kHeader));
  if (!block) return nullptr;
  *reinterpret_cast<uint64_t*>(block) = size;
  calls.fetch_add(1);
  const uint64_t now = held.fetch_add(size) + size;
  uint64_t seen = peak.load();
  while (now > seen && !peak.compare_exchange_weak(seen, now)) {
  }
  return block + kHeader;
}

[[maybe_unused]] void* allocate(size_t size) {
  void* memory = allocateIfPossible(size);
  if (!memory) throw std::bad_alloc();
  return memory;
}

[[maybe_unused]] void release(void* pointer) {
  if (!pointer) return;
  std::byte* block = static_cast<std::byte*>(pointer) - kHeader;
  held.fetch_sub(*reinterpret_cast<uint64_t*>(block));
  std::free(block);
}

}  // namespace

#ifndef __SANITIZE_ADDRESS__  // which brings its own
void* operator new(size_t size) {
  return allocate(size);
}
void* operator new[](size_t size) {
  return allocate(size);
}
// std::stable_sort calls these. The usual ones call those above, but the thread sanitizer's do not,
// and what they give must not be released here.
void* operator new(size_t size, const std::nothrow_t&) noexcept {
  return allocateIfPossible(size);
}
void* operator new[](size_t size, const std::nothrow_t&) noexcept {
  return allocateIfPossible(size);
}
void operator delete(void* pointer) noexcept {
  release(pointer);
}
void operator delete[](void* pointer) noexcept {
  release(pointer);
}
void operator delete(void* pointer, size_t) noexcept {
  release(pointer);
}
void operator delete[](void* pointer, size_t) noexcept {
  release(pointer);
}
#endif

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::frontCamera;
using testing::randomCloud;

uint64_t peakOf(std::span<const SplatInstance> instances, const Camera& camera,
                const RenderOptions& options) {
  const uint64_t before = held.load();
  peak.store(before);
  const RenderResult picture = renderTiled(instances, camera, options);
  EXPECT_EQ(picture.width, camera.width);
  return peak.load() - before;
}

TEST(RenderMemoryBound, IsNeverExceeded) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "the address sanitizer replaces the allocator that is counted here";
#endif
  CloudRecipe small;
  small.count = 50000;
  small.size_max = 0.01;
  CloudRecipe covering;
  covering.count = 3000;
  covering.size_min = 3;
  covering.size_max = 5;
  RenderOptions everything;
  everything.with_median_depth = true;
  everything.with_counts = true;
  for (const CloudRecipe& recipe : {small, covering}) {
    const SplatCloud cloud = randomCloud(recipe, 1);
    const SplatInstance instance{&cloud};
    for (const Camera& camera : {frontCamera(33, 20, 30, 3), frontCamera(900, 700, 500, 3)}) {
      const uint64_t bound = renderMemoryBound({&instance, 1}, camera, everything);
      const uint64_t used = peakOf({&instance, 1}, camera, everything);
      // Progress texts, task functions: a few kilobytes that do not grow with the work.
      EXPECT_LE(used, bound + 65536);
      // A bound that is far off would refuse what fits; the lists' worst case is within 64 times.
      EXPECT_GT(used, bound / 64);
    }
  }
}

TEST(RenderMemoryBound, CountsWhatObjectsApartTake) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "the address sanitizer replaces the allocator that is counted here";
#endif
  CloudRecipe recipe;
  recipe.count = 100;
  recipe.size_max = 0.01;
  const SplatCloud cloud = randomCloud(recipe, 1);
  // Counters of so many objects are more than the splats.
  const std::vector<SplatInstance> instances(4000, SplatInstance{&cloud});
  const Camera camera = frontCamera(33, 20, 30, 3);
  RenderOptions apart;
  apart.object_order = ObjectOrder::kApart;
  EXPECT_LE(peakOf(instances, camera, apart), renderMemoryBound(instances, camera, apart) + 65536);
}

TEST(RayMemoryBound, IsThatOfTheSplatsInViewWhereThereAreMany) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "the address sanitizer replaces the allocator that is counted here";
#endif
  CloudRecipe recipe;
  recipe.count = size_t{1} << 20;
  recipe.size_max = 0.006;
  const SplatCloud cloud = randomCloud(recipe, 3);
  const SplatInstance instance{&cloud};
  // From the middle, through a long lens: nearly all is beyond the borders or behind.
  const Camera camera = frontCamera(80, 60, 160, 0);
  for (const RayProjection projection : {RayProjection::kRay, RayProjection::kAffine}) {
    RayOptions rays;
    rays.projection = projection;
    const RenderMemory memory = rayTileMemory({&instance, 1}, camera, {}, rays);
    EXPECT_LT(memory.splat_bytes, rayMemory({&instance, 1}, camera, {}).splat_bytes / 4);
    const uint64_t bound = memory.sum();
    const uint64_t before = held.load();
    peak.store(before);
    const RenderResult picture = renderRayTiles({&instance, 1}, camera, {}, rays);
    EXPECT_GT(picture.visible_count, 1000u);
    EXPECT_LE(peak.load() - before, bound + 65536);
  }
}

TEST(RenderMemoryBound, StaysWithinItsShareOfEverySplatAndPixel) {
  // Pages of 2 MiB and the sort's counters, whatever the size.
  constexpr uint64_t kFixed = uint64_t{10} << 20;
  for (const size_t count : {size_t{0}, size_t{1000}, size_t{10000000}}) {
    SplatCloud cloud;
    cloud.opacities.resize(count);
    const SplatInstance instance{&cloud};
    for (const Camera& camera : {frontCamera(1, 1, 1, 3), frontCamera(1280, 720, 500, 3),
                                 frontCamera(8000, 6000, 500, 3)}) {
      const RenderMemory memory = renderMemory({&instance, 1}, camera, {});
      EXPECT_LE(memory.splat_bytes, count * 200 + kFixed);
      EXPECT_LE(memory.pixel_bytes, uint64_t{camera.width} * camera.height * 64 + 4096);
      EXPECT_EQ(memory.result_bytes, uint64_t{camera.width} * camera.height * 20);
      EXPECT_EQ(memory.splat_bytes + memory.pixel_bytes + memory.pair_bytes + memory.result_bytes +
                    memory.other_bytes,
                renderMemoryBound({&instance, 1}, camera, {}));
    }
  }
}

TEST(RenderWorkspace, AllocatesNothingForASecondPictureOfTheSameSize) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "the address sanitizer replaces the allocator that is counted here";
#endif
  CloudRecipe recipe;
  recipe.count = 60000;
  recipe.size_max = 0.02;
  const SplatCloud cloud = randomCloud(recipe, 2);
  const SplatInstance instance{&cloud};
  const Camera camera = frontCamera(300, 200, 250, 3);
  RenderWorkspace workspace;
  RenderResult first, second;
  renderTiled({&instance, 1}, camera, {}, workspace, first);
  second = first;
  std::fill(second.colour.begin(), second.colour.end(), -1.0f);
  const uint64_t bytes = workspace.bytes();
  const uint64_t before = calls.load();
  renderTiled({&instance, 1}, camera, {}, workspace, second);
  EXPECT_EQ(calls.load(), before);
  EXPECT_EQ(workspace.bytes(), bytes);
  EXPECT_EQ(first.colour, second.colour);
  EXPECT_GT(bytes, first.visible_count * sizeof(float));
}

TEST(RenderWorkspace, DrawsAnotherSceneAsIfItWereNew) {
  RenderWorkspace workspace;
  RenderResult reused;
  uint32_t seed = 0;
  for (const size_t count : {size_t{5000}, size_t{20}, size_t{0}, size_t{9000}}) {
    CloudRecipe recipe;
    recipe.count = count;
    const SplatCloud cloud = randomCloud(recipe, ++seed);
    const SplatInstance instance{&cloud};
    const Camera camera = frontCamera(20 + 40 * seed, 90 - 10 * seed, 60, 3);
    RenderOptions options;
    options.with_depth = seed % 2 == 0;
    options.with_counts = seed % 2 == 1;
    const RenderResult fresh = renderTiled({&instance, 1}, camera, options);
    renderTiled({&instance, 1}, camera, options, workspace, reused);
    EXPECT_EQ(reused.colour, fresh.colour);
    EXPECT_EQ(reused.depth, fresh.depth);
    EXPECT_EQ(reused.counts, fresh.counts);
    EXPECT_EQ(reused.width, fresh.width);
    EXPECT_EQ(reused.visible_count, fresh.visible_count);
  }
}

TEST(BackwardMemoryBound, IsNeverExceeded) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "the address sanitizer replaces the allocator that is counted here";
#endif
  CloudRecipe small;
  small.count = 50000;
  small.size_max = 0.01;
  small.degree = 1;
  CloudRecipe covering;
  covering.count = 3000;
  covering.size_min = 3;
  covering.size_max = 5;
  for (const CloudRecipe& recipe : {small, covering}) {
    const SplatCloud cloud = randomCloud(recipe, 2);
    const SplatInstance instance{&cloud};
    for (const Camera& camera : {frontCamera(33, 20, 30, 3), frontCamera(500, 400, 300, 3)}) {
      const size_t pixels = testing::pixelCount(camera);
      const std::vector<float> gradient(pixels * 4, 1.0f);
      const std::vector<float> residual(pixels * 3, 0.1f);
      for (const bool everything : {false, true}) {
        BackwardInput input;
        input.colour_gradient = gradient;
        if (everything) input.residual = residual;
        input.with_blending_weights = everything;
        input.with_screen_gradients = input.with_absolute_screen_gradients = everything;
        const uint64_t bound = backwardMemoryBound({&instance, 1}, camera, {}, input);
        const uint64_t before = held.load();
        peak.store(before);
        const BackwardResult result = renderBackward({&instance, 1}, camera, {}, input, bound);
        const uint64_t used = peak.load() - before;
        EXPECT_GT(result.visible_count, 0u);
        EXPECT_LE(used, bound + 65536);
        EXPECT_GT(used, bound / 64);
      }
    }
  }
}

TEST(BackwardMemoryBound, RefusesTooLittleMemoryBeforeAnythingIsAllocated) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "the address sanitizer replaces the allocator that is counted here";
#endif
  CloudRecipe recipe;
  recipe.count = 100000;
  const SplatCloud cloud = randomCloud(recipe, 4);
  const SplatInstance instance{&cloud};
  const Camera camera = frontCamera(500, 400, 300, 3);
  const std::vector<float> gradient(testing::pixelCount(camera) * 4, 1.0f);
  BackwardInput input;
  input.colour_gradient = gradient;
  const uint64_t bound = backwardMemoryBound({&instance, 1}, camera, {}, input);
  const uint64_t before = held.load();
  peak.store(before);
  std::string message;
  try {
    renderBackward({&instance, 1}, camera, {}, input, bound / 2);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kMemoryLimit);
    message = error.what();
  }
  EXPECT_NE(message.find("100000 splats needs up to " + std::to_string(bound) + " bytes; " +
                         std::to_string(bound / 2) + " are allowed"),
            std::string::npos)
      << message;
  // The workspace itself, the placed scene and the message.
  EXPECT_LT(peak.load() - before, 65536u);
}

TEST(BackwardWorkspace, AllocatesNothingForASecondCallOfTheSameSizeAndGivesTheSame) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "the address sanitizer replaces the allocator that is counted here";
#endif
  CloudRecipe recipe;
  recipe.count = 60000;
  recipe.size_max = 0.02;
  const SplatCloud cloud = randomCloud(recipe, 2);
  const SplatCloud other = randomCloud(CloudRecipe{}, 3);
  const SplatInstance instance{&cloud};
  const SplatInstance other_instance{&other};
  const Camera camera = frontCamera(300, 200, 250, 3);
  const std::vector<float> gradient(testing::pixelCount(camera) * 4, 0.5f);
  BackwardInput input;
  input.colour_gradient = gradient;
  input.with_screen_gradients = input.with_absolute_screen_gradients = true;
  BackwardWorkspace workspace;
  BackwardResult result;
  // One thread: how many tiles are at work at once, and so want scratch, is then the same.
  withThreads(1, [&] {
    renderBackward({&instance, 1}, camera, {}, input, workspace, result);
    const BackwardResult first = result;
    const uint64_t before = calls.load();
    renderBackward({&instance, 1}, camera, {}, input, workspace, result);
    EXPECT_EQ(calls.load(), before);
    EXPECT_EQ(first.instances[0].positions, result.instances[0].positions);
    EXPECT_EQ(first.instances[0].screen_gradients, result.instances[0].screen_gradients);
    EXPECT_EQ(first.camera, result.camera);
    // A smaller scene with less asked for comes out as if everything were new.
    input.with_screen_gradients = false;
    renderBackward({&other_instance, 1}, camera, {}, input, workspace, result);
    const BackwardResult fresh = renderBackward({&other_instance, 1}, camera, {}, input);
    EXPECT_EQ(fresh.instances[0].positions, result.instances[0].positions);
    EXPECT_TRUE(result.instances[0].screen_gradients.empty());
    EXPECT_EQ(fresh.camera, result.camera);
  });
}

}  // namespace
}  // namespace stipple
