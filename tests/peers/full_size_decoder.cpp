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
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "base/error.h"
#include "base/random.h"
#include "decode/latent/latent_decoder.h"
#include "decode/latent/latent_density.h"
#include "decode/latent/latent_networks.h"
#include "density/anchor_sampling.h"

namespace stipple {
namespace {

constexpr uint64_t kWidth = 1024;
constexpr uint64_t kLatentWidth = 16;
constexpr uint64_t kDensityBlocks = 4;

/// Random numbers of half precision, each tensor at its own place: no cache has them all, as it has
/// none of a file of 576 MB.
class MadeDecoder {
 public:
  explicit MadeDecoder(uint64_t blocks) {
    addLinear("octree.l_embedder.mlp.0", kWidth, 256);
    addLinear("octree.l_embedder.mlp.2", kWidth, kWidth);
    addLinear("octree.adaLN_modulation.1", 6 * kWidth, kWidth);
    addNetwork("octree.", 8, kDensityBlocks);
    add("gs.points_offset_perturbation", {32, 3});
    add("gs.base_offset_scale", {});
    addNetwork("gs.", 480, blocks);
    for (uint64_t i = 0; i < blocks; ++i) {
      const std::string block = "gs.blocks." + std::to_string(i) + ".";
      add(block + "norm2.weight", {kWidth});
      add(block + "norm2.bias", {kWidth});
      addLinear(block + "self_attn.to_qkv", 3 * kWidth, kWidth);
      addLinear(block + "self_attn.to_out", kWidth, kWidth);
      addGammas(block + "self_attn.");
    }
  }

  WeightTable table() const { return WeightTable("made up", tensors_, nullptr); }

 private:
  void add(const std::string& name, std::vector<uint64_t> shape) {
    WeightTensor& tensor = tensors_[name];
    tensor = {WeightType::kFloat16, "F16", std::move(shape), nullptr};
    std::vector<uint16_t>& numbers = numbers_.emplace_back(tensor.count());
    for (size_t i = 0; i < numbers.size(); ++i) {
      // Any sign and 1/64 to 1/32, so that sums of 1024 are about as large as what goes in.
      constexpr uint64_t kExponent = 9 << 10, kSignAndFraction = 0x83ff;
      const uint64_t bits = mixBits(i + (uint64_t{numbers_.size()} << 32));
      numbers[i] = static_cast<uint16_t>((bits & kSignAndFraction) | kExponent);
    }
    tensor.bytes = reinterpret_cast<const uint8_t*>(numbers.data());
  }
  void addLinear(const std::string& name, uint64_t outputs, uint64_t inputs) {
    add(name + ".weight", {outputs, inputs});
    add(name + ".bias", {outputs});
  }
  void addGammas(const std::string& attention) {
    add(attention + "q_rms_norm.gamma", {16, 64});
    add(attention + "k_rms_norm.gamma", {16, 64});
  }
  void addNetwork(const std::string& prefix, uint64_t outputs, uint64_t blocks) {
    addLinear(prefix + "in_proj", kWidth, 3);
    addLinear(prefix + "input_layer", kWidth, kWidth);
    addLinear(prefix + "out_proj", outputs, kWidth);
    for (uint64_t i = 0; i < blocks; ++i) {
      const std::string block = prefix + "blocks." + std::to_string(i) + ".";
      addLinear(block + "cross_attn.to_q", kWidth, kWidth);
      addLinear(block + "cross_attn.to_kv", 2 * kWidth, kLatentWidth);
      addLinear(block + "cross_attn.to_out", kWidth, kWidth);
      addGammas(block + "cross_attn.");
      addLinear(block + "mlp.mlp.0", 4 * kWidth, kWidth);
      addLinear(block + "mlp.mlp.2", kWidth, 4 * kWidth);
    }
  }

  std::vector<std::vector<uint16_t>> numbers_;
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
  const MadeDecoder made(blocks);
  const LatentNetworks networks = readLatentNetworks(made.table());
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
  const auto c = static_cast<double>(kWidth), m = static_cast<double>(tokens);
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
