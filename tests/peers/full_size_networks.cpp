// Runs the image encoders in the sizes of their published files, with weights that are made up.
//
//   full_size_networks FOLDER SIZE [dino] [vae] [bfloat16]
//
// Writes dino.safetensors (1.7 GB, BF16) and vae.safetensors (138 MB, F32) into FOLDER unless they
// are there, as files with holes: one page of random numbers in 16. Encodes an image of SIZE x SIZE
// pixels by each and prints seconds, processor seconds, operations, and the most memory that no
// file lies behind, beside the pages of the mapped file. With bfloat16 each runs once more with the
// factors of products cut to 16 bits, and what comes out is compared.

#include <sys/resource.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "generate/dino_encoder.h"
#include "generate/encoder_shapes.h"
#include "generate/vae_encoder.h"
#include "io/assets/weight_file.h"
#include "nn/matrix_backend.h"

namespace stipple {
namespace {

constexpr size_t kPage = 4096;
/// Of so many pages of a tensor one has numbers; tensors that are smaller have all.
constexpr size_t kPagesApart = 16;

float randomNumber(size_t index) {
  return 2.0f * unitFloat(keyedBits(1, RandomUse::kNetworkStart, index)) - 1.0f;
}

uint64_t countOf(const std::vector<uint64_t>& shape) {
  uint64_t count = 1;
  for (const uint64_t size : shape) count *= size;
  return count;
}

/// Numbers that keep what a network computes at a usual size: the sums of layers about as large as
/// their inputs, factors of norms near 1, variances 1, everything else small.
class Numbers {
 public:
  Numbers(const std::string& name, const std::vector<uint64_t>& shape) {
    const uint64_t count = countOf(shape);
    if (name.ends_with("running_var") || (name.ends_with(".weight") && shape.size() == 1)) {
      middle_ = 1.0f;
      spread_ = 0.2f;
    } else if (name.ends_with(".weight")) {
      spread_ =
          std::sqrt(3.0f * kPagesApart * static_cast<float>(shape[0]) / static_cast<float>(count));
    } else {
      spread_ = 0.2f;
    }
  }
  float operator()(size_t index) const { return middle_ + spread_ * randomNumber(index); }

 private:
  float middle_ = 0.0f, spread_ = 0.0f;
};

void writeTensor(std::ofstream& file, uint64_t offset, const std::string& name,
                 const std::vector<uint64_t>& shape, size_t number_bytes) {
  const uint64_t bytes = countOf(shape) * number_bytes;
  const Numbers numbers(name, shape);
  const uint64_t step = bytes < kPage * kPagesApart ? kPage : kPage * kPagesApart;
  std::vector<uint8_t> page;
  for (uint64_t begin = 0; begin < bytes; begin += step) {
    page.resize(std::min<uint64_t>(kPage, bytes - begin));
    for (size_t i = 0; i < page.size() / number_bytes; ++i) {
      const float value = numbers(begin / number_bytes + i);
      uint8_t bits[4];
      std::memcpy(bits, &value, 4);
      // BF16 is the upper half of F32, which comes last.
      std::memcpy(page.data() + i * number_bytes, bits + 4 - number_bytes, number_bytes);
    }
    file.seekp(static_cast<std::streamoff>(offset + begin));
    file.write(reinterpret_cast<const char*>(page.data()),
               static_cast<std::streamsize>(page.size()));
  }
}

void writeWeights(const std::string& path, const WeightShapes& shapes, size_t number_bytes) {
  std::ostringstream table;
  uint64_t size = 0;
  for (const auto& [name, shape] : shapes) {
    table << (size == 0 ? '{' : ',') << '"' << name << "\":{\"dtype\":\""
          << (number_bytes == 2 ? "BF16" : "F32") << "\",\"shape\":";
    for (size_t i = 0; i < shape.size(); ++i) table << (i == 0 ? '[' : ',') << shape[i];
    table << "],\"data_offsets\":[" << size;
    size += countOf(shape) * number_bytes;
    table << ',' << size << "]}";
  }
  table << '}';
  std::string header = table.str();
  // Numbers begin at a page, so that holes are whole pages.
  header.resize((header.size() + 8 + kPage - 1) / kPage * kPage - 8, ' ');
  const uint64_t first = 8 + header.size(), header_bytes = header.size();
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(&header_bytes), 8);
  file << header;
  file.close();
  std::filesystem::resize_file(path, first + size);
  file.open(path, std::ios::binary | std::ios::in);
  uint64_t offset = first;
  for (const auto& [name, shape] : shapes) {
    writeTensor(file, offset, name, shape, number_bytes);
    offset += countOf(shape) * number_bytes;
  }
  if (!file) fail(ErrorCode::kIo, path + " cannot be written.");
}

/// Bytes that /proc/self/status says of this process.
struct Memory {
  size_t own = 0, mapped = 0;

  static Memory now() {
    Memory memory;
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);) {
      if (line.starts_with("RssAnon:")) memory.own = std::stoul(line.substr(8)) * 1024;
      if (line.starts_with("RssFile:")) memory.mapped = std::stoul(line.substr(8)) * 1024;
    }
    return memory;
  }
};

double processorSeconds() {
  rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
         1e-6 * static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

/// Returns what `encode` gives.
std::vector<float> measure(const char* name, double flops,
                           const std::function<std::vector<float>()>& encode) {
  Memory most;
  const Memory before = Memory::now();
  std::atomic<bool> is_done{false};
  std::thread watch([&] {
    while (!is_done.load()) {
      const Memory now = Memory::now();
      most.own = std::max(most.own, now.own);
      most.mapped = std::max(most.mapped, now.mapped);
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  });
  const double processor_begin = processorSeconds();
  const auto begin = std::chrono::steady_clock::now();
  const std::vector<float> numbers = encode();
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  const double processor_seconds = processorSeconds() - processor_begin;
  is_done = true;
  watch.join();
  double squares = 0.0;
  for (const float value : numbers)
    squares += static_cast<double>(value) * static_cast<double>(value);
  std::printf(
      "%-5s %6.2f TFLOP  %7.1f s (%.0f GFLOP/s)  %7.1f processor s (%.0f GFLOP/s each)  own "
      "memory %zu MiB (%zu before)  mapped pages %zu MiB  root of mean square %.3f of %zu\n",
      name, flops * 1e-12, seconds, flops / seconds * 1e-9, processor_seconds,
      flops / processor_seconds * 1e-9, most.own >> 20, before.own >> 20, most.mapped >> 20,
      std::sqrt(squares / static_cast<double>(numbers.size())), numbers.size());
  return numbers;
}

using Encode = std::function<std::vector<float>(const NetworkRun&)>;

void measureBoth(const char* name, double flops, bool with_bfloat16, const Encode& encode) {
  const std::vector<float> exact = measure(name, flops, [&] { return encode({}); });
  if (!with_bfloat16) return;
  NetworkRun run;
  run.precision = FactorPrecision::kBfloat16;
  if (!backendOf(run).has(run.precision)) {
    std::printf("%s has no bfloat16 here\n", backendOf(run).name());
    return;
  }
  const std::vector<float> cut = measure(name, flops, [&] { return encode(run); });
  double squares = 0.0, errors = 0.0;
  for (size_t i = 0; i < exact.size(); ++i) {
    const auto value = static_cast<double>(exact[i]);
    const double error = static_cast<double>(cut[i]) - value;
    squares += value * value;
    errors += error * error;
  }
  std::printf("      in bfloat16, with an error of %.4f of the root of the mean square\n",
              std::sqrt(errors / squares));
}

std::string weightsIn(const std::string& folder, const char* name, const WeightShapes& shapes,
                      size_t number_bytes) {
  const std::string path = folder + "/" + name;
  if (!std::filesystem::exists(path)) writeWeights(path, shapes, number_bytes);
  return path;
}

void run(const std::string& folder, size_t size, bool with_dino, bool with_vae,
         bool with_bfloat16) {
  std::vector<float> rgb(size * size * 3);
  for (size_t i = 0; i < rgb.size(); ++i) rgb[i] = 0.5f + 0.5f * randomNumber(i);
  std::printf("%zu x %zu pixels, at most %zu threads, products by %s with %s\n", size, size,
              threadLimit(), defaultMatrixBackend().name(),
              defaultMatrixBackend().instructionSets().c_str());
  if (with_dino) {
    const DinoEncoder encoder(
        openWeightFile(weightsIn(folder, "dino.safetensors", dinoShapes(1280, 5120, 32), 2)));
    measureBoth("dino", encoder.flops(size, size), with_bfloat16,
                [&](const NetworkRun& run) { return encoder.encode(run, rgb, size, size); });
  }
  if (with_vae) {
    const VaeEncoder encoder(openWeightFile(
        weightsIn(folder, "vae.safetensors", vaeShapes({128, 256, 512, 512}, 32), 4)));
    measureBoth("vae", encoder.flops(size, size), with_bfloat16,
                [&](const NetworkRun& run) { return encoder.encode(run, rgb, size, size, {}); });
  }
}

}  // namespace
}  // namespace stipple

int main(int count, char** arguments) {
  const size_t size = count < 3 ? 0 : std::strtoul(arguments[2], nullptr, 10);
  if (size == 0) {
    std::fprintf(stderr, "full_size_networks FOLDER SIZE [dino] [vae] [bfloat16]\n");
    return 2;
  }
  bool with_dino = false, with_vae = false, with_bfloat16 = false;
  for (int i = 3; i < count; ++i) {
    with_dino |= std::strcmp(arguments[i], "dino") == 0;
    with_vae |= std::strcmp(arguments[i], "vae") == 0;
    with_bfloat16 |= std::strcmp(arguments[i], "bfloat16") == 0;
  }
  if (!with_dino && !with_vae) with_dino = with_vae = true;
  try {
    stipple::run(arguments[1], size, with_dino, with_vae, with_bfloat16);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
