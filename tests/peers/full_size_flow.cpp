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
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "generate/flow_cost.h"
#include "generate/flow_network.h"
#include "generate/flow_sampler.h"
#include "nn/matrix_backend.h"

namespace stipple {
namespace {

/// Random numbers of half precision that all tensors share: a network of 741 MB in 13.
class MadeNetwork {
 public:
  explicit MadeNetwork(size_t block_count) : numbers_(6 * kChannels * kChannels + kOffsets) {
    for (size_t i = 0; i < numbers_.size(); ++i) {
      // Any sign and 1/64 to 1/32, so that sums of 1024 are about as large as what goes in.
      constexpr uint64_t kExponent = 9 << 10, kSignAndFraction = 0x83ff;
      numbers_[i] = static_cast<uint16_t>((mixBits(i) & kSignAndFraction) | kExponent);
    }
    addEnds();
    for (size_t i = 0; i < 2; ++i) {
      addBlock("noise_refiner.", "noise_repo_layers.", i, FlowModulation::kTime);
      addBlock("context_refiner.", "context_repo_layers.", i, FlowModulation::kNone);
    }
    for (size_t i = 0; i < block_count; ++i) {
      addBlock("blocks.", "repo_layers.", i, FlowModulation::kTime);
    }
  }

  WeightTable table() const { return WeightTable("made up", tensors_, nullptr); }

 private:
  static constexpr uint64_t kChannels = 1024;
  static constexpr size_t kOffsets = 4096;

  void add(const std::string& name, std::vector<uint64_t> shape) {
    const size_t offset = (37 * tensors_.size()) % kOffsets;
    tensors_[name] = {WeightType::kFloat16, "F16", std::move(shape),
                      reinterpret_cast<const uint8_t*>(numbers_.data() + offset)};
  }
  void addLinear(const std::string& name, uint64_t outputs, uint64_t inputs) {
    add(name + ".weight", {outputs, inputs});
    add(name + ".bias", {outputs});
  }
  void addEnds() {
    constexpr uint64_t c = kChannels;
    addLinear("t_embedder.mlp.0", c, 256);
    addLinear("t_embedder.mlp.2", c, c);
    addLinear("adaLN_modulation.1", 6 * c, c);
    addLinear("input_layer", c, 16);
    addLinear("cond_embedder", c, 1280);
    addLinear("cond_embedder2", c, 128);
    addLinear("cam_refiner.mlp.0", c, kCameraWidth);
    addLinear("cam_refiner.mlp.2", c, c);
    addLinear("out_layer", 16, c);
    addLinear("cam_out_layer", kCameraWidth, c);
    add("shift_table", {1, 2, c});
  }
  void addBlock(const std::string& block_list, const std::string& rotary_list, size_t index,
                FlowModulation modulation) {
    constexpr uint64_t c = kChannels;
    const std::string rotary = rotary_list + std::to_string(index);
    const std::string block = block_list + std::to_string(index);
    add(rotary + ".norm.weight", {c});
    add(rotary + ".norm.bias", {c});
    add(rotary + ".gate_map.weight", {128, c});
    add(rotary + ".content_map.weight", {128, c});
    add(rotary + ".final_map.weight", {48, 128});
    add(rotary + ".freqs_0", {10});
    add(rotary + ".freqs_1", {10});
    add(rotary + ".freqs_2", {12});
    addLinear(block + ".attn.qkv", 3 * c, c);
    addLinear(block + ".attn.out", c, c);
    add(block + ".attn.q_norm.gamma", {16, 64});
    add(block + ".attn.k_norm.gamma", {16, 64});
    addLinear(block + ".mlp.mlp.0", 4 * c, c);
    addLinear(block + ".mlp.mlp.2", c, 4 * c);
    if (modulation == FlowModulation::kTime) {
      add(block + ".shift_table", {1, 6 * c});
      return;
    }
    for (const char* norm : {".norm1", ".norm2"}) {
      add(block + norm + ".weight", {c});
      add(block + norm + ".bias", {c});
    }
  }

  std::vector<uint16_t> numbers_;
  std::map<std::string, WeightTensor> tensors_;
};

double seconds() {
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  return std::chrono::duration<double>(now).count();
}

double processorSeconds() {
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  const auto of = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return of(usage.ru_utime) + of(usage.ru_stime);
}

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
  const MadeNetwork made(blocks);
  const FlowNetwork network(made.table());
  const FlowSizes& sizes = network.sizes();
  std::printf("%s %s, %zu threads; %zu tokens, %zu rows, %zu blocks\n",
              defaultMatrixBackend().name(), defaultMatrixBackend().instructionSets().c_str(),
              threadLimit(), static_cast<size_t>(tokens), static_cast<size_t>(rows), blocks);
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
