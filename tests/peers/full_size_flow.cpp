// Runs the flow network in the sizes of its published file, with weights that are made up.
//
//   full_size_flow TOKENS ROWS BLOCKS CANCELS
//
// TOKENS of a latent (8192), ROWS of an image's context (4101), BLOCKS of the network (24); one
// call with the image and one without. Prints seconds, processor seconds, operations and memory,
// and the longest time from cancelling to the end, of CANCELS calls that are cancelled at random
// moments.

#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>
#include <vector>

#include "base/error.h"
#include "base/random.h"
#include "generate/flow_cost.h"
#include "generate/flow_network.h"
#include "generate/flow_sampler.h"
#include "peers/full_size_clock.h"
#include "peers/full_size_files.h"
#include "peers/full_size_shapes.h"

namespace stipple {
namespace {

/// The most memory that this process has had, MiB.
double mostMemory() {
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

template <typename Work>
void measure(const char* name, const StageCost& cost, const Work& work) {
  const double start = seconds(), processor_start = processorSeconds();
  work();
  const double took = seconds() - start, processor_took = processorSeconds() - processor_start;
  std::printf(
      "%-18s %7.2f s, %7.2f processor seconds, %6.3f TFLOP (%2.0f %% attention), %6.1f GFLOP per "
      "processor second\n",
      name, took, processor_took, 1e-12 * cost.flops, 100 * cost.attention_flops / cost.flops,
      1e-9 * cost.flops / processor_took);
  std::fflush(stdout);
}

int run(uint64_t tokens, uint64_t rows, size_t blocks, int cancels) {
  const FlowNetwork network(sharedWeights(flowShapes(blocks)));
  const FlowSizes& sizes = network.sizes();
  printMachine();
  std::printf("%zu tokens, %zu rows, %zu blocks\n", static_cast<size_t>(tokens),
              static_cast<size_t>(rows), blocks);
  ImageCondition condition;
  condition.rows = rows;
  condition.structure_width = static_cast<uint32_t>(sizes.structure_width);
  condition.colour_width = static_cast<uint32_t>(sizes.colour_width);
  const GenerationNoise noise =
      drawNoise({.colour = rows * sizes.colour_width, .tokens = tokens * sizes.token_width}, {});
  condition.colour = noise.colour;
  condition.structure = drawNoise({.tokens = rows * sizes.structure_width}, {.seed = 1}).tokens;
  const Latent state = startSampling(network, tokens, noise, {}).latent;
  const double memory_before = mostMemory();
  FlowContext context;
  measure("context", flowContextCost(sizes, rows),
          [&] { context = network.context({}, condition); });
  Latent velocity;
  const double start = seconds();
  measure("call, image", flowCallCost(sizes, tokens, rows),
          [&] { network.velocity({}, state, 0.9, context, velocity); });
  const double call_seconds = seconds() - start;
  std::printf("memory             %.0f MiB more than before, bound %.0f MiB\n",
              mostMemory() - memory_before,
              static_cast<double>(network.memoryBound(tokens, rows)) / (1 << 20));
  const FlowContext nothing = network.emptyContext({}, rows);
  measure("call, no image", flowCallCost(sizes, tokens, 1),
          [&] { network.velocity({}, state, 0.9, nothing, velocity); });
  double longest = 0;
  for (int i = 0; i < cancels; ++i) {
    Progress progress;
    double cancelled_at = 0;
    const double wait = 0.8 * call_seconds * unitDouble(mixBits(static_cast<uint64_t>(i)));
    std::thread canceller([&] {
      std::this_thread::sleep_for(std::chrono::duration<double>(wait));
      cancelled_at = seconds();
      progress.cancel();
    });
    bool cancelled = false;
    try {
      network.velocity({.progress = &progress}, state, 0.9, context, velocity);
    } catch (const Error&) {
      cancelled = true;
    }
    const double ended_at = seconds();
    canceller.join();
    if (cancelled) longest = std::max(longest, ended_at - cancelled_at);
  }
  if (cancels > 0) std::printf("cancel             %.3f s at the longest\n", longest);
  return 0;
}

}  // namespace
}  // namespace stipple

int main(int count, char** arguments) {
  const auto number = [&](int index, int usual) {
    return index < count ? std::atoi(arguments[index]) : usual;
  };
  try {
    return stipple::run(static_cast<uint64_t>(number(1, 8192)),
                        static_cast<uint64_t>(number(2, 4101)), static_cast<size_t>(number(3, 24)),
                        number(4, 0));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
