// Splat files against what the disk cache gives: the same bytes through fread and fwrite alone,
// through the packing library where the format packs streams, and through plain loops between bits
// and float32 where it packs numbers (plain_unpack.h). Beside it ratios without a target: fread and
// fwrite alone, or the same and one copy of the cloud's arrays.
// Files lie in memory (/dev/shm), so that a slow disk does not hide the work of the reader.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <string>
#include <vector>

#include "base/parallel.h"
#include "base/random.h"
#include "bench/comparison.h"
#include "bench/plain_file.h"
#include "bench/plain_unpack.h"
#include "io/bytes/compression.h"
#include "io/bytes/little_endian.h"
#include "io/splats/splat_file.h"

namespace stipple::bench {
namespace {

constexpr size_t kSplats = 1000000;
constexpr int kDegree = 3;

std::string scratchPath(const std::string& extension) {
  return "/dev/shm/stipple_bench_" + std::to_string(::getpid()) + extension;
}

SplatCloud makeCloud(int degree) {
  SplatCloud made;
  made.sh_degree = degree;
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
}

/// The same cloud with harmonics and without.
const SplatCloud& cloudOf(int degree) {
  static const SplatCloud kPlain = makeCloud(0);
  static const SplatCloud kFull = makeCloud(kDegree);
  return degree == 0 ? kPlain : kFull;
}

void finish(benchmark::State& state, size_t bytes) {
  state.SetBytesProcessed(static_cast<int64_t>(bytes) * state.iterations());
  state.SetItemsProcessed(static_cast<int64_t>(kSplats) * state.iterations());
}

/// A packed stream of a file and what it unpacks to.
struct Stream {
  Compression compression;
  size_t offset, size, plain;
};

/// The streams of an SPZ file of version 3 (one of gzip) or 4 (zstd, listed in a table).
std::vector<Stream> streamsOf(const PlainBytes& file) {
  if (file[0] != 'N') {
    const auto* end = file.data() + file.size() - 4;
    return {{Compression::kGzip, 0, file.size(), loadLittleEndian<uint32_t>(end)}};
  }
  std::vector<Stream> streams;
  const size_t count = static_cast<uint8_t>(file[15]);
  const size_t table = loadLittleEndian<uint32_t>(&file[16]);
  size_t offset = table + count * 16;
  for (size_t s = 0; s < count; ++s) {
    const auto packed = static_cast<size_t>(loadLittleEndian<uint64_t>(&file[table + s * 16]));
    const auto plain = static_cast<size_t>(loadLittleEndian<uint64_t>(&file[table + s * 16 + 8]));
    streams.push_back({Compression::kZstd, offset, packed, plain});
    offset += packed;
  }
  return streams;
}

/// All streams unpacked, several at a time where there are several.
std::vector<ByteVector> unpackAll(const PlainBytes& file, const std::vector<Stream>& streams) {
  std::vector<ByteVector> plain(streams.size());
  parallelFor(streams.size(), 1, [&](size_t begin, size_t end) {
    for (size_t s = begin; s < end; ++s) {
      plain[s].resize(streams[s].plain);
      unpackBytes(streams[s].compression,
                  reinterpret_cast<const uint8_t*>(&file[streams[s].offset]), streams[s].size,
                  plain[s].data(), plain[s].size(), "floor");
    }
  });
  return plain;
}

void packAll(const std::vector<ByteVector>& plain, const std::vector<Stream>& streams) {
  parallelFor(streams.size(), 1, [&](size_t begin, size_t end) {
    for (size_t s = begin; s < end; ++s) {
      const bool gzip = streams[s].compression == Compression::kGzip;
      benchmark::DoNotOptimize(packBytes(streams[s].compression, plain[s].data(), plain[s].size(),
                                         gzip ? 6 : 12, "floor"));
    }
  });
}

/// What lies between a file's bytes and arrays of float32.
enum class Packing {
  kNone,
  kStreams,        ///< of gzip or zstd
  kCompressedPly,  ///< bits of numbers
  kRecords,        ///< the same
};

struct Case {
  const char* name;
  const char* extension;
  SplatWriteOptions options;
  Packing packing;
  int degree;  ///< of the cloud that is written
};

/// Reading against fread, and unpacking where the format packs.
void readCase(benchmark::State& state, const Case& which) {
  const std::string path = scratchPath(which.extension);
  writeSplatFile(cloudOf(which.degree), path, which.options);
  const SplatCloud decoded = readSplatFile(path);
  const size_t bytes = readPlainly(path).size();
  const auto fread = [&] { benchmark::DoNotOptimize(readPlainly(path).data()); };
  std::vector<Reference> references;
  const auto withCopy = [&](const std::string& name, const std::function<void()>& plain) {
    references = {{name, plain}, {name + "+arrays", [&decoded, plain] {
                                         plain();
                                         copyArrays(decoded);
                                       }}};
  };
  switch (which.packing) {
    case Packing::kNone:
      withCopy("fread", fread);
      break;
    case Packing::kStreams:
      withCopy("fread+unpack", [&] {
        const PlainBytes file = readPlainly(path);
        benchmark::DoNotOptimize(unpackAll(file, streamsOf(file)));
      });
      break;
    case Packing::kCompressedPly:
      references = {{"fread+unpack",
                     [&] {
                       const PlainArrays arrays =
                           unpackCompressedPly(readPlainly(path), kSplats, which.degree);
                       benchmark::DoNotOptimize(arrays.sh.data());
                     }},
                    {"fread", fread}};
      break;
    case Packing::kRecords:
      references = {{"fread+unpack",
                     [&] {
                       const PlainArrays arrays = unpackSplat32(readPlainly(path));
                       benchmark::DoNotOptimize(arrays.sh.data());
                     }},
                    {"fread", fread}};
      break;
  }
  compareWithAll(
      state, [&] { benchmark::DoNotOptimize(readSplatFile(path)); }, references);
  ::unlink(path.c_str());
  finish(state, bytes);
}

/// Writing against fwrite, and packing the same where the format packs.
void writeCase(benchmark::State& state, const Case& which) {
  const SplatCloud& cloud = cloudOf(which.degree);
  const std::string path = scratchPath(which.extension);
  writeSplatFile(cloud, path, which.options);
  const PlainBytes bytes = readPlainly(path);
  std::vector<Stream> streams;
  if (which.packing == Packing::kStreams) streams = streamsOf(bytes);
  const std::vector<ByteVector> plain = unpackAll(bytes, streams);
  const std::string floor_path = path + ".floor";
  const auto fwrite = [&] { writePlainly(floor_path, bytes); };
  std::vector<Reference> references;
  const auto withCopy = [&](const std::string& name, const std::function<void()>& write) {
    references = {{name, write}, {name + "+arrays", [&cloud, write] {
                                         copyArrays(cloud);
                                         write();
                                       }}};
  };
  switch (which.packing) {
    case Packing::kNone:
      withCopy("fwrite", fwrite);
      break;
    case Packing::kStreams:
      withCopy("pack+fwrite", [&] {
        packAll(plain, streams);
        fwrite();
      });
      break;
    case Packing::kCompressedPly:
      references = {{"pack+fwrite",
                     [&] { writePlainly(floor_path, packCompressedPly(cloud, bytes.size())); }},
                    {"sort+pack+fwrite",
                     [&] {
                       benchmark::DoNotOptimize(sortPlainly(cloud).data());
                       writePlainly(floor_path, packCompressedPly(cloud, bytes.size()));
                     }},
                    {"fwrite", fwrite}};
      break;
    case Packing::kRecords:
      references = {{"pack+fwrite", [&] { writePlainly(floor_path, packSplat32(cloud)); }},
                    {"fwrite", fwrite}};
      break;
  }
  compareWithAll(
      state, [&] { writeSplatFile(cloud, path, which.options); }, references);
  ::unlink(floor_path.c_str());
  ::unlink(path.c_str());
  finish(state, bytes.size());
}

const Case kCases[] = {
    {"ply", ".ply", {}, Packing::kNone, kDegree},
    {"compressed_ply", ".compressed.ply", {}, Packing::kCompressedPly, kDegree},
    {"compressed_ply_degree0", ".compressed.ply", {}, Packing::kCompressedPly, 0},
    {"splat", ".splat", {}, Packing::kRecords, kDegree},
    {"splat_degree0", ".splat", {}, Packing::kRecords, 0},
    {"spz3", ".spz", {.version = 3}, Packing::kStreams, kDegree},
    {"spz4", ".spz", {.version = 4}, Packing::kStreams, kDegree}};

const bool kRegistered = [] {
  for (const Case& which : kCases) {
    // Packing a million splats takes seconds: fewer rounds there.
    const int rounds = which.packing == Packing::kStreams ? 2 : 8;
    benchmark::RegisterBenchmark((std::string("io.") + which.name + "_read.1M").c_str(), readCase,
                                 which)
        ->UseManualTime()
        ->Iterations(8)
        ->Unit(benchmark::kMillisecond);
    benchmark::RegisterBenchmark((std::string("io.") + which.name + "_write.1M").c_str(), writeCase,
                                 which)
        ->UseManualTime()
        ->Iterations(rounds)
        ->Unit(benchmark::kMillisecond);
  }
  return true;
}();

}  // namespace
}  // namespace stipple::bench
