#include <benchmark/benchmark.h>

#include <array>
#include <cstring>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "bench/comparison.h"
#include "train/optimiser/adam.h"
#include "train/optimiser/adam_kernel.h"
#include "train/optimiser/image_loss.h"
#include "train/optimiser/image_loss_kernel.h"

// The loop of the floor below: built for the widest vectors, chosen when it is first called.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define STIPPLE_BENCH_TARGETS \
  __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define STIPPLE_BENCH_TARGETS
#endif

namespace stipple::bench {
namespace {

struct Size {
  const char* name;
  uint32_t width, height;
};

constexpr Size kSizes[] = {{"256x464", 256, 464}, {"800x800", 800, 800}, {"1280x720", 1280, 720}};

/// [H,W,4] as rendered, [H,W,3] as photographed.
struct Pictures {
  std::vector<float> rendered, target, gradient;
};

Pictures& picturesOf(const Size& size) {
  static std::map<std::string, Pictures> all;
  const auto [found, is_new] = all.try_emplace(size.name);
  if (is_new) {
    std::mt19937 random(1);
    std::uniform_real_distribution<float> uniform(0.0f, 1.0f);
    const size_t pixels = static_cast<size_t>(size.width) * size.height;
    found->second.rendered.resize(pixels * 4);
    found->second.target.resize(pixels * 3);
    found->second.gradient.resize(pixels * 4);
    for (float& value : found->second.rendered) value = uniform(random);
    for (float& value : found->second.target) value = uniform(random);
  }
  return found->second;
}

enum class Output { kValue, kGradient };

void evaluate(ImageLoss& loss, const Size& size, unsigned threads, Output output) {
  Pictures& pictures = picturesOf(size);
  const GradientView gradient = {output == Output::kGradient ? pictures.gradient.data() : nullptr,
                                 PixelLayout::kRgba};
  withThreads(threads, [&] {
    benchmark::DoNotOptimize(
        loss.evaluate(size.width, size.height, {pictures.rendered.data(), PixelLayout::kRgba},
                      {pictures.target.data(), PixelLayout::kRgb}, nullptr, gradient)
            .loss);
  });
}

constexpr size_t kFloorWidth = 256;
constexpr size_t kFloorPitch = kFloorWidth + 16;
constexpr size_t kFloorHeight = 96;

/// One separable 11-tap blur of 256 x 96 pixels that lie in the second cache, symmetric taps
/// folded, each row going through a buffer in the first.
STIPPLE_BENCH_TARGETS void blurTile(const float* in, float* out) {
  alignas(64) float row[kFloorPitch] = {};
  for (size_t y = 0; y < kFloorHeight; ++y) {
    const float* rows = in + y * kFloorPitch;
    for (size_t x = 0; x < kFloorPitch; ++x) {
      float sum = kBlurWindow[5] * rows[5 * kFloorPitch + x];
      for (size_t k = 0; k < 5; ++k) {
        sum = __builtin_fmaf(kBlurWindow[k],
                             rows[k * kFloorPitch + x] + rows[(10 - k) * kFloorPitch + x], sum);
      }
      row[x] = sum;
    }
    for (size_t x = 0; x < kFloorWidth; ++x) {
      float sum = kBlurWindow[5] * row[x + 5];
      for (size_t k = 0; k < 5; ++k) {
        sum = __builtin_fmaf(kBlurWindow[k], row[x + k] + row[x + 10 - k], sum);
      }
      out[x] = sum;
    }
  }
}

/// As many blurs as the textbook's SSIM takes: five a channel forward and five backward.
void blurFloor(size_t pixels, unsigned threads, size_t blurs) {
  const size_t tiles =
      (pixels * blurs + kFloorWidth * kFloorHeight - 1) / (kFloorWidth * kFloorHeight);
  withThreads(threads, [&] {
    parallelFor(tiles, 15, [](size_t begin, size_t end) {
      alignas(64) thread_local float in[(kFloorHeight + 10) * kFloorPitch] = {};
      alignas(64) thread_local float out[kFloorWidth];
      for (size_t i = begin; i < end; ++i) {
        blurTile(in, out);
        benchmark::DoNotOptimize(&out[0]);
        benchmark::ClobberMemory();
      }
    });
  });
}

void label(benchmark::State& state, const Size& size) {
  const double pixels = static_cast<double>(size.width) * size.height;
  state.SetItemsProcessed(static_cast<int64_t>(pixels) * state.iterations());
  state.counters["ns_per_pixel"] = state.counters["best_ms"] * 1e6 / pixels;
}

/// ratio_floor: time of the blurs alone over ours; above 1 as we take seven blurs, not ten.
void lossAgainstFloor(benchmark::State& state, const Size& size, Output output, unsigned threads) {
  ImageLoss loss;
  evaluate(loss, size, threads, output);
  const size_t pixels = static_cast<size_t>(size.width) * size.height;
  compare(
      state, "floor", [&] { evaluate(loss, size, threads, output); },
      [&] { blurFloor(pixels, threads, output == Output::kGradient ? 30 : 15); });
  label(state, size);
  state.counters["workspace_bytes"] = static_cast<double>(loss.workspaceBytes());
}

void lossAgainstOneThread(benchmark::State& state, const Size& size) {
  ImageLoss loss;
  evaluate(loss, size, 2, Output::kGradient);
  compare(
      state, "one_thread", [&] { evaluate(loss, size, 2, Output::kGradient); },
      [&] { evaluate(loss, size, 1, Output::kGradient); });
  label(state, size);
}

/// AVX2, or the widest target below it, against the best one.
void lossAvx2AgainstBest(benchmark::State& state, const Size& size) {
  LossKernel avx2 = scalarLossKernel();
  for (const LossKernel& kernel : lossKernels()) {
    if (!std::strcmp(kernel.target, "AVX2")) avx2 = kernel;
  }
  ImageLoss ours(avx2), best;
  evaluate(ours, size, 2, Output::kGradient);
  evaluate(best, size, 2, Output::kGradient);
  state.SetLabel(avx2.target);
  compare(
      state, "best_target", [&] { evaluate(ours, size, 2, Output::kGradient); },
      [&] { evaluate(best, size, 2, Output::kGradient); });
  label(state, size);
}

/// Parameters of `count` Gaussians of degree 3: 3 + 4 + 3 + 1 + 48 = 59 numbers each.
class Parameters {
 public:
  explicit Parameters(size_t count) {
    for (size_t g = 0; g < kLengths.size(); ++g) {
      for (size_t a = 0; a < 4; ++a) arrays_[g][a].assign(count * kLengths[g], 0.001f);
      groups_[g] = {arrays_[g][0].data(),
                    arrays_[g][1].data(),
                    arrays_[g][2].data(),
                    arrays_[g][3].data(),
                    count,
                    kLengths[g],
                    1e-3};
    }
  }
  void step(unsigned threads, const AdamKernel& kernel, const uint8_t* visible) {
    withThreads(threads, [&] { adamStepWith(kernel, groups_, ++step_, {}, visible); });
  }

 private:
  static constexpr std::array<size_t, 5> kLengths = {3, 4, 3, 1, 48};
  std::array<std::array<std::vector<float>, 4>, 5> arrays_;
  std::array<AdamGroup, 5> groups_;
  uint64_t step_ = 0;
};

/// Reads gradients and reads and writes parameters and two moments: 59 * 28 = 1652 bytes for each
/// Gaussian; a copy of half as many reads and writes the same.
constexpr size_t kCopiedBytes = 826;

class Copy {
 public:
  explicit Copy(size_t count) : from_(count * kCopiedBytes, 'a'), to_(count * kCopiedBytes, 'b') {}
  void run(unsigned threads) {
    withThreads(threads, [&] {
      parallelFor(from_.size(), from_.size() / 2 + 1, [&](size_t begin, size_t end) {
        std::memcpy(to_.data() + begin, from_.data() + begin, end - begin);
      });
    });
    benchmark::DoNotOptimize(to_.data());
    benchmark::ClobberMemory();
  }

 private:
  std::vector<char> from_, to_;
};

void adamAgainstFloor(benchmark::State& state, size_t count) {
  Parameters parameters(count);
  Copy copy(count);
  const AdamKernel kernel = chosenAdamKernel();
  parameters.step(2, kernel, nullptr);
  copy.run(2);
  compare(
      state, "floor", [&] { parameters.step(2, kernel, nullptr); }, [&] { copy.run(2); });
  state.counters["ns_per_gaussian"] = state.counters["best_ms"] * 1e6 / static_cast<double>(count);
}

void adamAgainstOneThread(benchmark::State& state, size_t count) {
  Parameters parameters(count);
  const AdamKernel kernel = chosenAdamKernel();
  parameters.step(2, kernel, nullptr);
  compare(
      state, "one_thread", [&] { parameters.step(2, kernel, nullptr); },
      [&] { parameters.step(1, kernel, nullptr); });
}

/// A third of the rows, in runs of 1 to 8, against all of them.
void sparseAdamAgainstDense(benchmark::State& state, size_t count) {
  Parameters parameters(count);
  const AdamKernel kernel = chosenAdamKernel();
  std::vector<uint8_t> visible(count);
  std::mt19937 random(1);
  for (size_t i = 0; i < count;) {
    for (size_t run = 1 + random() % 8; run > 0 && i < count; --run) visible[i++] = 1;
    i += 2 + random() % 14;
  }
  parameters.step(2, kernel, nullptr);
  compare(
      state, "dense", [&] { parameters.step(2, kernel, visible.data()); },
      [&] { parameters.step(2, kernel, nullptr); });
}

template <class... Arguments>
void add(const std::string& name, int iterations, const Arguments&... arguments) {
  benchmark::RegisterBenchmark(name.c_str(), arguments...)
      ->UseManualTime()
      ->Iterations(iterations)
      ->Unit(benchmark::kMillisecond);
}

const bool registered = [] {
  for (const Size& size : kSizes) {
    const std::string name = std::string("loss.l1_ssim.") + size.name;
    add(name, 20, lossAgainstFloor, size, Output::kGradient, 2u);
    add(name + ".1_thread", 20, lossAgainstFloor, size, Output::kGradient, 1u);
    add(name + ".value", 20, lossAgainstFloor, size, Output::kValue, 2u);
    add(name + ".2_threads", 20, lossAgainstOneThread, size);
    add(name + ".avx2", 20, lossAvx2AgainstBest, size);
  }
  add("adam.dense.150kx59", 10, adamAgainstFloor, size_t{150000});
  add("adam.dense.150kx59.2_threads", 10, adamAgainstOneThread, size_t{150000});
  add("adam.sparse.150kx59", 10, sparseAdamAgainstDense, size_t{150000});
  add("adam.dense.1Mx59", 5, adamAgainstFloor, size_t{1000000});
  return true;
}();

}  // namespace
}  // namespace stipple::bench
