#include "bench/plain_file.h"

#include <benchmark/benchmark.h>
#include <unistd.h>

#include <cstdio>
#include <cstring>
#include <memory>
#include <stdexcept>

namespace stipple::bench {

namespace {

struct Closer {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, Closer>;

void require(bool done, const std::string& path) {
  if (!done) throw std::runtime_error(path + " cannot be read or written");
}

}  // namespace

PlainBytes readPlainly(const std::string& path) {
  const File file(std::fopen(path.c_str(), "rb"));
  require(file != nullptr, path);
  std::fseek(file.get(), 0, SEEK_END);
  PlainBytes bytes(static_cast<size_t>(std::ftell(file.get())));
  std::rewind(file.get());
  require(std::fread(bytes.data(), 1, bytes.size(), file.get()) == bytes.size(), path);
  return bytes;
}

void writePlainly(const std::string& path, const PlainBytes& bytes) {
  const std::string temporary = path + ".temporary";
  {
    const File file(std::fopen(temporary.c_str(), "wb"));
    require(file != nullptr, temporary);
    require(std::fwrite(bytes.data(), 1, bytes.size(), file.get()) == bytes.size(), temporary);
    require(std::fflush(file.get()) == 0 && ::fsync(::fileno(file.get())) == 0, temporary);
  }
  require(std::rename(temporary.c_str(), path.c_str()) == 0, path);
}

void copyArrays(const SplatCloud& cloud) {
  for (const std::vector<float>* array :
       {&cloud.positions, &cloud.rotations, &cloud.scales, &cloud.opacities, &cloud.sh}) {
    PlainBytes copy(array->size() * sizeof(float));
    std::memcpy(copy.data(), array->data(), copy.size());
    benchmark::DoNotOptimize(copy.data());
    benchmark::ClobberMemory();
  }
}

}  // namespace stipple::bench
