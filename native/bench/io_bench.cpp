// Splat files against what the disk cache gives: the same bytes through fread and fwrite alone.
// Files lie in memory (/dev/shm), so that a slow disk does not hide the work of the reader.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "base/random.h"
#include "io/splat_file.h"

namespace stipple {
namespace {

constexpr size_t kSplats = 1000000;
constexpr int kDegree = 3;

std::string scratchPath() {
  return "/dev/shm/stipple_bench_" + std::to_string(::getpid()) + ".ply";
}

const SplatCloud& cloud() {
  static const SplatCloud kCloud = [] {
    SplatCloud made;
    made.sh_degree = kDegree;
    made.resize(kSplats);
    uint64_t index = 0;
    const auto next = [&index] {
      return unitFloat(keyedBits(1, RandomUse::kDecoder, index++)) * 0.98f + 0.01f;
    };
    for (float& value : made.positions) value = next();
    for (float& value : made.scales) value = next();
    for (float& value : made.opacities) value = next();
    for (float& value : made.sh) value = next();
    for (size_t i = 0; i < kSplats; ++i) made.rotations[i * 4] = 1.0f;
    return made;
  }();
  return kCloud;
}

/// The file that every benchmark here reads or makes again; removed at the end of the program.
struct ScratchFile {
  std::string path = scratchPath();
  ScratchFile() { writeSplatFile(cloud(), path, {}); }
  ~ScratchFile() { ::unlink(path.c_str()); }
};

const std::string& scratchFile() {
  static const ScratchFile kFile;
  return kFile.path;
}

struct Closer {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, Closer>;

std::vector<char> readWhole(const std::string& path) {
  const File file(std::fopen(path.c_str(), "rb"));
  std::fseek(file.get(), 0, SEEK_END);
  std::vector<char> bytes(static_cast<size_t>(std::ftell(file.get())));
  std::rewind(file.get());
  bytes.resize(std::fread(bytes.data(), 1, bytes.size(), file.get()));
  return bytes;
}

void count(benchmark::State& state, size_t bytes) {
  state.SetBytesProcessed(static_cast<int64_t>(bytes) * state.iterations());
  state.counters["splats"] = benchmark::Counter(static_cast<double>(kSplats),
                                                benchmark::Counter::kIsIterationInvariantRate);
}

void plyRead(benchmark::State& state) {
  const std::string& path = scratchFile();
  for (auto _ : state) benchmark::DoNotOptimize(readSplatFile(path));
  count(state, readWhole(path).size());
}

void plyReadFloor(benchmark::State& state) {
  const std::string& path = scratchFile();
  size_t bytes = 0;
  for (auto _ : state) bytes = readWhole(path).size();
  count(state, bytes);
}

void plyWrite(benchmark::State& state) {
  const std::string& path = scratchFile();
  for (auto _ : state) writeSplatFile(cloud(), path, {});
  count(state, readWhole(path).size());
}

void plyWriteFloor(benchmark::State& state) {
  const std::vector<char> bytes = readWhole(scratchFile());
  const std::string path = scratchFile() + ".floor";
  for (auto _ : state) {
    const File file(std::fopen(path.c_str(), "wb"));
    if (std::fwrite(bytes.data(), 1, bytes.size(), file.get()) != bytes.size()) {
      state.SkipWithError("the file cannot be written");
    }
  }
  ::unlink(path.c_str());
  count(state, bytes.size());
}

// Wall time: the reader uses every thread, and fread waits in the kernel.
BENCHMARK(plyRead)->Name("io.ply_read.1M")->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(plyReadFloor)->Name("io.ply_read_fread.1M")->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(plyWrite)->Name("io.ply_write.1M")->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(plyWriteFloor)
    ->Name("io.ply_write_fwrite.1M")
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

}  // namespace
}  // namespace stipple
