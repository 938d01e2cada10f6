// Splat files against what the disk cache gives: the same bytes through fread and fwrite alone.
// Files lie in memory (/dev/shm), so that a slow disk does not hide the work of the reader.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "base/random.h"
#include "bench/comparison.h"
#include "io/splat_file.h"

namespace stipple::bench {
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

void writeWhole(const std::string& path, const std::vector<char>& bytes) {
  const File file(std::fopen(path.c_str(), "wb"));
  std::fwrite(bytes.data(), 1, bytes.size(), file.get());
}

void finish(benchmark::State& state, size_t bytes) {
  state.SetBytesProcessed(static_cast<int64_t>(bytes) * state.iterations());
  state.SetItemsProcessed(static_cast<int64_t>(kSplats) * state.iterations());
}

void plyRead(benchmark::State& state) {
  const std::string& path = scratchFile();
  size_t bytes = 0;
  compare(
      state, "fread", 0.0, [&] { benchmark::DoNotOptimize(readSplatFile(path)); },
      [&] { bytes = readWhole(path).size(); });
  finish(state, bytes);
}

void plyWrite(benchmark::State& state) {
  const std::string& path = scratchFile();
  const std::vector<char> bytes = readWhole(path);
  const std::string floor_path = path + ".floor";
  compare(
      state, "fwrite", 0.0, [&] { writeSplatFile(cloud(), path, {}); },
      [&] { writeWhole(floor_path, bytes); });
  ::unlink(floor_path.c_str());
  finish(state, bytes.size());
}

BENCHMARK(plyRead)
    ->Name("io.ply_read.1M")
    ->UseManualTime()
    ->Iterations(8)
    ->Unit(benchmark::kMillisecond);
BENCHMARK(plyWrite)
    ->Name("io.ply_write.1M")
    ->UseManualTime()
    ->Iterations(8)
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace stipple::bench
