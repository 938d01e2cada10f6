// SOG, glTF and USD splats against what their containers take alone: the same pictures through
// libwebp, the same bytes through fread and fwrite, the same numbers through the standard library.
// Files lie in memory (/dev/shm).
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "base/random.h"
#include "bench/comparison.h"
#include "bench/plain_file.h"
#include "io/splats/sog_file.h"
#include "io/splats/splat_file.h"
#include "io/webp_image.h"

namespace stipple::bench {
namespace {

constexpr uint64_t kMostPixels = uint64_t{1} << 28;
constexpr size_t kSogSplats = 200000;
constexpr size_t kGlbSplats = 1000000;
constexpr size_t kUsdSplats = 200000;

float uniform(uint64_t index) {
  return unitFloat(keyedBits(2, RandomUse::kDecoder, index));
}

/// Splats whose harmonics are mixtures of few shapes, as those of trained scenes are.
SplatCloud makeCloud(size_t count, int degree) {
  SplatCloud cloud;
  cloud.sh_degree = degree;
  cloud.resize(count);
  constexpr size_t kShapes = 12;
  const size_t stride = cloud.shStride();
  parallelFor(count, 4096, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      uint64_t key = i << 8;
      for (size_t k = 0; k < 3; ++k) cloud.positions[i * 3 + k] = 4.0f * uniform(key++) - 2.0f;
      for (size_t k = 0; k < 3; ++k) {
        cloud.scales[i * 3 + k] = std::exp(-6.0f + 2.0f * uniform(key++));
      }
      float squares = 0;
      for (size_t k = 0; k < 4; ++k) {
        float& q = cloud.rotations[i * 4 + k];
        q = uniform(key++) - 0.5f;
        squares += q * q;
      }
      for (size_t k = 0; k < 4; ++k) cloud.rotations[i * 4 + k] /= std::sqrt(squares);
      cloud.opacities[i] = uniform(key++);
      for (size_t k = 0; k < 3; ++k) cloud.sh[i * stride + k] = 2.0f * uniform(key++) - 1.0f;
      float weights[kShapes];
      for (size_t s = 0; s < kShapes; ++s) {
        weights[s] = (uniform(key++) - 0.5f) / static_cast<float>(1 + s);
      }
      for (size_t k = 3; k < stride; ++k) {
        float sum = 0;
        for (size_t s = 0; s < kShapes; ++s) {
          sum += weights[s] * (uniform((uint64_t{1} << 60) + k * kShapes + s) - 0.5f);
        }
        cloud.sh[i * stride + k] = sum;
      }
    }
  });
  return cloud;
}

const SplatCloud& sogCloud() {
  static const SplatCloud kCloud = makeCloud(kSogSplats, 3);
  return kCloud;
}

const std::vector<SogPart>& sogParts() {
  static const std::vector<SogPart> kParts = encodeSog(sogCloud(), {}, nullptr);
  return kParts;
}

std::vector<RgbaBytes> decodeAll() {
  std::vector<RgbaBytes> pictures(sogParts().size() - 1);
  parallelFor(pictures.size(), 1, [&](size_t i, size_t) {
    pictures[i] = decodeWebp(sogParts()[i].bytes, kMostPixels, "picture");
  });
  return pictures;
}

std::string scratch(const char* name) {
  return "/dev/shm/stipple_bench_" + std::to_string(::getpid()) + name;
}

void sogRead(benchmark::State& state) {
  const std::string path = scratch(".sog");
  writeSog(sogCloud(), path, {}, nullptr);
  const SplatCloud decoded = readSog(path, nullptr);
  const auto plain = [&] {
    benchmark::DoNotOptimize(readPlainly(path));
    benchmark::DoNotOptimize(decodeAll());
  };
  compareWithAll(state, [&] { benchmark::DoNotOptimize(readSog(path, nullptr)); },
                 {{"fread+libwebp", plain}, {"fread+libwebp+arrays", [&] {
                                               plain();
                                               copyArrays(decoded);
                                             }}});
  ::unlink(path.c_str());
  state.SetItemsProcessed(static_cast<int64_t>(kSogSplats) * state.iterations());
}

void sogWrite(benchmark::State& state, int degree) {
  SplatCloud cloud = makeCloud(kSogSplats, degree);
  const std::string path = scratch(".sog");
  std::vector<RgbaBytes> pictures;
  for (const SogPart& part : encodeSog(cloud, {}, nullptr)) {
    if (part.name != "meta.json")
      pictures.push_back(decodeWebp(part.bytes, kMostPixels, part.name));
  }
  writeSog(cloud, path, {}, nullptr);
  const PlainBytes bytes = readPlainly(path);
  const std::string floor_path = path + ".floor";
  compare(
      state, "libwebp+fwrite", [&] { writeSog(cloud, path, {}, nullptr); },
      [&] {
        parallelFor(pictures.size(), 1, [&](size_t i, size_t) {
          benchmark::DoNotOptimize(encodeWebp(pictures[i], "picture"));
        });
        writePlainly(floor_path, bytes);
      });
  ::unlink(floor_path.c_str());
  ::unlink(path.c_str());
  state.SetItemsProcessed(static_cast<int64_t>(kSogSplats) * state.iterations());
}

void glbRead(benchmark::State& state) {
  const std::string path = scratch(".glb");
  writeSplatFile(makeCloud(kGlbSplats, 3), path, {.frame = Frame::kLUF});
  const SplatCloud decoded = readSplatFile(path);
  const auto plain = [&] { benchmark::DoNotOptimize(readPlainly(path)); };
  compareWithAll(state, [&] { benchmark::DoNotOptimize(readSplatFile(path)); },
                 {{"fread", plain}, {"fread+arrays", [&] {
                                       plain();
                                       copyArrays(decoded);
                                     }}});
  ::unlink(path.c_str());
  state.SetItemsProcessed(static_cast<int64_t>(kGlbSplats) * state.iterations());
}

void glbWrite(benchmark::State& state) {
  SplatCloud cloud = makeCloud(kGlbSplats, 3);
  cloud.frame = Frame::kLUF;
  const std::string path = scratch(".glb");
  writeSplatFile(cloud, path, {});
  const PlainBytes bytes = readPlainly(path);
  const std::string plain = scratch(".plain");
  compare(
      state, "fwrite", [&] { writeSplatFile(cloud, path, {}); },
      [&] { writePlainly(plain, bytes); });
  ::unlink(path.c_str());
  ::unlink(plain.c_str());
  state.SetItemsProcessed(static_cast<int64_t>(kGlbSplats) * state.iterations());
}

/// Every number of a text, one after the other.
void parseNumbers(const PlainBytes& text, std::vector<float>& numbers) {
  numbers.clear();
  const char* at = text.data();
  const char* const end = at + text.size();
  while (at < end) {
    float number = 0;
    const auto [next, error] = std::from_chars(at, end, number);
    if (error == std::errc()) numbers.push_back(number);
    at = next == at ? at + 1 : next;
  }
}

/// Every number of a cloud as text, a separator behind each, by all threads.
std::vector<std::string> printNumbers(const SplatCloud& cloud) {
  constexpr size_t kPiece = 65536;
  std::vector<std::string> pieces;
  for (const std::vector<float>* values :
       {&cloud.positions, &cloud.rotations, &cloud.scales, &cloud.opacities, &cloud.sh}) {
    const size_t first = pieces.size();
    pieces.resize(first + (values->size() + kPiece - 1) / kPiece);
    parallelFor(pieces.size() - first, 1, [&](size_t piece, size_t) {
      std::string& text = pieces[first + piece];
      char digits[32];
      const size_t begin = piece * kPiece;
      for (size_t i = begin; i < std::min(begin + kPiece, values->size()); ++i) {
        text.append(digits, std::to_chars(digits, digits + sizeof(digits), (*values)[i]).ptr);
        text.append(", ");
      }
    });
  }
  return pieces;
}

void usdRead(benchmark::State& state) {
  const std::string path = scratch(".usda");
  SplatCloud cloud = makeCloud(kUsdSplats, 3);
  cloud.frame = Frame::kRUB;
  writeSplatFile(cloud, path, {});
  std::vector<float> numbers;
  compare(
      state, "fread+from_chars", [&] { benchmark::DoNotOptimize(readSplatFile(path)); },
      [&] { parseNumbers(readPlainly(path), numbers); });
  ::unlink(path.c_str());
  state.SetItemsProcessed(static_cast<int64_t>(kUsdSplats) * state.iterations());
}

void usdWrite(benchmark::State& state) {
  SplatCloud cloud = makeCloud(kUsdSplats, 3);
  cloud.frame = Frame::kRUB;
  const std::string path = scratch(".usda");
  writeSplatFile(cloud, path, {});
  const PlainBytes bytes = readPlainly(path);
  const std::string plain = scratch(".plain");
  compare(
      state, "to_chars+fwrite", [&] { writeSplatFile(cloud, path, {}); },
      [&] {
        benchmark::DoNotOptimize(printNumbers(cloud));
        writePlainly(plain, bytes);
      });
  ::unlink(path.c_str());
  ::unlink(plain.c_str());
  state.SetItemsProcessed(static_cast<int64_t>(kUsdSplats) * state.iterations());
}

BENCHMARK(usdRead)
    ->Name("io.usd_read.200k")
    ->UseManualTime()
    ->Iterations(3)
    ->Unit(benchmark::kMillisecond);
BENCHMARK(usdWrite)
    ->Name("io.usd_write.200k")
    ->UseManualTime()
    ->Iterations(3)
    ->Unit(benchmark::kMillisecond);
BENCHMARK(sogRead)
    ->Name("io.sog_read.200k")
    ->UseManualTime()
    ->Iterations(5)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(sogWrite, degree0, 0)
    ->Name("io.sog_write_degree0.200k")
    ->UseManualTime()
    ->Iterations(3)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(sogWrite, degree3, 3)
    ->Name("io.sog_write_degree3.200k")
    ->UseManualTime()
    ->Iterations(2)
    ->Unit(benchmark::kMillisecond);
BENCHMARK(glbRead)
    ->Name("io.glb_read.1M")
    ->UseManualTime()
    ->Iterations(5)
    ->Unit(benchmark::kMillisecond);
BENCHMARK(glbWrite)
    ->Name("io.glb_write.1M")
    ->UseManualTime()
    ->Iterations(5)
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace stipple::bench
