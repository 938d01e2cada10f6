// Runs the image encoders in the sizes of their published files, with weights that are made up.
//
//   full_size_networks FOLDER SIZE [dino] [vae] [bfloat16]
//
// Writes dino.safetensors (1.7 GB) and vae.safetensors (336 MB) into FOLDER unless they are there.
// Encodes an image of SIZE x SIZE pixels by each and prints seconds, processor seconds, operations,
// and the most memory that no file lies behind, beside the pages of the mapped file. With bfloat16
// each runs once more with the factors of products cut to 16 bits, and what comes out is compared.

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "base/random.h"
#include "generate/dino_encoder.h"
#include "generate/vae_encoder.h"
#include "io/assets/weight_file.h"
#include "nn/matrix_backend.h"
#include "peers/full_size_clock.h"
#include "peers/full_size_files.h"

namespace stipple {
namespace {

float randomNumber(size_t index) {
  return 2.0f * unitFloat(keyedBits(1, RandomUse::kNetworkStart, index)) - 1.0f;
}

/// Returns what `encode` gives.
std::vector<float> measure(const char* name, double flops,
                           const std::function<std::vector<float>()>& encode) {
  ProcessMemory most;
  const ProcessMemory before = ProcessMemory::now();
  std::atomic<bool> is_done{false};
  std::thread watch([&] {
    while (!is_done.load()) {
      const ProcessMemory now = ProcessMemory::now();
      most.own = std::max(most.own, now.own);
      most.mapped = std::max(most.mapped, now.mapped);
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  });
  const double processor_begin = processorSeconds(), begin = seconds();
  const std::vector<float> numbers = encode();
  const double took = seconds() - begin, processor_took = processorSeconds() - processor_begin;
  is_done = true;
  watch.join();
  double squares = 0.0;
  for (const float value : numbers)
    squares += static_cast<double>(value) * static_cast<double>(value);
  std::printf(
      "%-5s %6.2f TFLOP  %7.1f s (%.0f GFLOP/s)  %7.1f processor s (%.0f GFLOP/s each)  own "
      "memory %zu MiB (%zu before)  mapped pages %zu MiB  root of mean square %.3f of %zu\n",
      name, flops * 1e-12, took, flops / took * 1e-9, processor_took, flops / processor_took * 1e-9,
      most.own >> 20, before.own >> 20, most.mapped >> 20,
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

void run(const std::string& folder, size_t size, bool with_dino, bool with_vae,
         bool with_bfloat16) {
  std::vector<float> rgb(size * size * 3);
  for (size_t i = 0; i < rgb.size(); ++i) rgb[i] = 0.5f + 0.5f * randomNumber(i);
  printMachine();
  std::printf("%zu x %zu pixels\n", size, size);
  if (with_dino) {
    const DinoEncoder encoder(openWeightFile(structureFileIn(folder)));
    measureBoth("dino", encoder.flops(size, size), with_bfloat16,
                [&](const NetworkRun& run) { return encoder.encode(run, rgb, size, size); });
  }
  if (with_vae) {
    const VaeEncoder encoder(openWeightFile(colourFileIn(folder)));
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
