// Runs the two networks of the decoder in the sizes of their published file, with weights that are
// made up.
//
//   full_size_decoder TOKENS ANCHORS BLOCKS
//
// TOKENS of a latent (8192), ANCHORS (1024), BLOCKS of the Gaussian network (16). Asks the density
// once about as many cells as a sampler does, decodes ANCHORS random anchors, cancels one decode,
// and then draws and decodes small budgets again and again: the best of some turns. Prints seconds,
// processor seconds, operations and memory.

#include <sys/resource.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <thread>
#include <vector>

#include "base/error.h"
#include "base/random.h"
#include "decode/latent/latent_decoder.h"
#include "decode/latent/latent_density.h"
#include "decode/latent/latent_networks.h"
#include "density/anchor_sampling.h"
#include "peers/full_size_clock.h"
#include "peers/full_size_files.h"
#include "peers/full_size_shapes.h"

namespace stipple {
namespace {

constexpr uint64_t kDensityBlocks = 4;

/// In: operations, multiplications and additions.
template <typename Work>
void measure(const char* name, double operations, const Work& work) {
  const double begin = seconds(), processor_begin = processorSeconds();
  work();
  const double processor = processorSeconds() - processor_begin;
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  std::printf("%-28s %8.2f s %8.2f processor s %8.3f TFLOP %6.0f GFLOP/processor s %6ld MiB\n",
              name, seconds() - begin, processor, operations * 1e-12, operations * 1e-9 / processor,
              usage.ru_maxrss >> 10);
}

/// Draws and decodes budgets that a slider may have, the best of some turns.
void measureSmallBudgets(const LatentDensity& density, const LatentDecoder& decoder,
                         DecodeRequest request) {
  constexpr int kTurns = 7;
  request.progress = nullptr;
  for (const uint64_t count : {32, 64, 128, 256}) {
    double draw = 1e300, decode = 1e300;
    for (int turn = 0; turn < kTurns; ++turn) {
      const double begin = seconds();
      const AnchorSet anchors = sampleAnchors(density, {.count = count, .seed = 1});
      const double middle = seconds();
      request.anchors = &anchors;
      decoder.decode(request);
      draw = std::min(draw, middle - begin);
      decode = std::min(decode, seconds() - middle);
    }
    std::printf("%3llu anchors, warm: %.3f s to draw, %.3f s to decode\n",
                static_cast<unsigned long long>(count), draw, decode);
  }
}

void run(uint64_t tokens, uint64_t anchors, uint64_t blocks) {
  printMachine();
  const LatentNetworks networks = readLatentNetworks(ownWeights(decoderShapes(blocks)));
  auto latent = std::make_shared<Latent>();
  latent->token_count = tokens;
  latent->width = kLatentWidth;
  for (uint64_t i = 0; i < tokens * kLatentWidth; ++i) {
    latent->tokens.push_back(static_cast<float>(unitDouble(mixBits(i)) * 2 - 1));
  }
  const LatentDensity density(networks.octree, latent);
  std::vector<uint64_t> cells(OctreeNetwork::kRows);
  for (size_t i = 0; i < cells.size(); ++i) cells[i] = 1000 * i;
  std::vector<float> out(8 * cells.size());
  const auto c = static_cast<double>(kFlowChannels), m = static_cast<double>(tokens);
  const double keys = kDensityBlocks * m * 2 * c * 2 * kLatentWidth;
  // Queries and weights of 16 heads meet the tokens' numbers, and a 1.
  const double shared = 16 * m * (2 * kLatentWidth + 1);
  measure("keys of the latent", keys, [&] {
    const uint64_t root = 0;
    density.childLogProbabilities(0, std::span(&root, 1), std::span(out).first(8));
  });
  // A linear layer behind the points; query, output, MLP and both products of attention.
  const double cell = 2 * (c * c + kDensityBlocks * (10 * c * c + shared));
  measure("a question to the density", cell * static_cast<double>(cells.size()),
          [&] { density.childLogProbabilities(7, cells, out); });

  AnchorSet set;
  set.positions.resize(3 * anchors);
  set.log_q.resize(anchors);
  for (uint64_t i = 0; i < 3 * anchors; ++i) {
    set.positions[i] = static_cast<float>(unitDouble(mixBits(i + 7)));
  }
  const LatentDecoder decoder(networks.gaussians, latent);
  DecodeRequest request;
  request.anchors = &set;
  request.gaussians_per_anchor = networks.gaussians->gaussians();
  const auto p = static_cast<double>(anchors), b = static_cast<double>(blocks);
  const double anchor = 2 * (c * c + b * (14 * c * c + shared + 2 * p * c));
  const double latent_keys = b * m * 2 * c * 2 * kLatentWidth;
  measure("a decode", anchor * p + latent_keys, [&] { decoder.decode(request); });

  Progress progress;
  request.progress = &progress;
  double cancelled = 0;
  std::thread canceller([&] {
    while (progress.fraction() == 0.0) std::this_thread::yield();
    cancelled = seconds();
    progress.cancel();
  });
  try {
    decoder.decode(request);
  } catch (const Error&) {
    std::printf("%.3f s from cancelling to the end\n", seconds() - cancelled);
  }
  canceller.join();
  measureSmallBudgets(density, decoder, request);
}

}  // namespace
}  // namespace stipple

int main(int count, char** arguments) {
  if (count != 4) {
    std::fprintf(stderr, "full_size_decoder TOKENS ANCHORS BLOCKS\n");
    return 2;
  }
  const auto number = [&](int i) { return std::strtoull(arguments[i], nullptr, 10); };
  stipple::run(number(1), number(2), number(3));
  return 0;
}
