// Steps of trainings whose work is networks alone, at the usual sizes of a config: the matrix
// products that a step needs, at the rate of a large layer in the same run, against the step. Steps
// in bfloat16 also against the same ones in float32.
#include <benchmark/benchmark.h>

#include <cmath>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "base/random.h"
#include "bench/comparison.h"
#include "bench/nn/large_layer.h"
#include "math/morton.h"
#include "nn/matrix_backend.h"
#include "train/networks/autoencoder_trainer.h"
#include "train/networks/flow_trainer.h"

namespace stipple::bench {
namespace {

constexpr int kRepeats = 5;
constexpr size_t kHeadWidth = 32, kLatent = 16, kRatio = 4;
constexpr size_t kPoints = 4096, kTokens = 128;
/// Objects of a step.
constexpr size_t kBatch = 2, kFlowBatch = 8;
constexpr int kLeafLevel = 6;
constexpr size_t kPatches = 64, kPatchNumbers = 768, kPlaceNumbers = 32, kRotary = 16;

/// Rows through linear layers with so many weights for each: forward, once more when a block is run
/// again, and twice on the way back. What is kept, in place of being run again, has three.
double inBlocks(double rows, double weights) {
  return 4 * 2 * rows * weights;
}
double kept(double rows, double weights) {
  return 3 * 2 * rows * weights;
}
/// Two products forward, twice, and five on the way back.
double attentions(double queries, double keys, double width) {
  return 9 * 2 * queries * keys * width;
}

/// A step of the first part: encoder and density, from the surface alone.
class AutoencoderSteps {
 public:
  AutoencoderSteps(size_t width, FactorPrecision precision)
      : object_(std::make_shared<const Ball>()),
        trainer_(sizesOf(width), {partOf()}, 1, object_, nullptr, TrainerRun{nullptr, precision}) {}

  void step() { benchmark::DoNotOptimize(trainer_.step().losses.total); }

  static double operations(size_t width) {
    const AutoencoderSizes sizes = sizesOf(width);
    const auto w = static_cast<double>(width), tokens = static_cast<double>(kTokens);
    const auto points = static_cast<double>(kPoints), cells = static_cast<double>(cellCount());
    const double encoder =
        static_cast<double>(sizes.encoder_blocks) *
        (inBlocks(tokens, (4 + 2 + 2 * kRatio) * w * w) + attentions(tokens, tokens, w) +
         attentions(tokens, points, w) + kept(points, 2 * w * w));
    const double octree =
        static_cast<double>(sizes.octree_blocks) *
        (inBlocks(cells, (2 + 2 * kRatio) * w * w) + attentions(cells, tokens, w));
    return static_cast<double>(kBatch) * (encoder + octree + kept(cells, w * w));
  }

 private:
  class Ball final : public ObjectSource {
   public:
    Ball() : object_(std::make_shared<TrainingObject>()) {
      object_->points.resize(1);
      object_->features.resize(1);
      for (size_t i = 0; i < kPoints; ++i) {
        const double z = 1 - 2 * (static_cast<double>(i) + 0.5) / static_cast<double>(kPoints);
        const double turn = 2.399963229728653 * static_cast<double>(i), flat = std::sqrt(1 - z * z);
        const double at[3] = {flat * std::cos(turn), flat * std::sin(turn), z};
        for (const double axis : at) {
          object_->points[0].push_back(static_cast<float>(0.5 + 0.4 * axis));
          object_->features[0].push_back(static_cast<float>(0.5 + 0.5 * std::sin(9 * axis)));
        }
      }
      object_->surface = object_->points[0];
    }
    size_t count() const override { return 1; }
    std::shared_ptr<const TrainingObject> object(size_t) const override { return object_; }

   private:
    std::shared_ptr<TrainingObject> object_;
  };

  /// Cells of all levels that the surface reaches into: the density is asked about each.
  static size_t cellCount() {
    const auto object = Ball().object(0);
    std::set<std::pair<int, uint64_t>> cells;
    constexpr float kSide = 1 << kLeafLevel;
    for (size_t i = 0; i < kPoints; ++i) {
      const float* at = &object->surface[i * 3];
      const auto cell = [&](size_t axis) { return static_cast<uint32_t>(at[axis] * kSide); };
      const uint64_t code = mortonEncode(cell(0), cell(1), cell(2));
      for (int level = 0; level < kLeafLevel; ++level) {
        cells.insert({level, code >> (3 * (kLeafLevel - level))});
      }
    }
    return cells.size();
  }

  static AutoencoderSizes sizesOf(size_t width) {
    AutoencoderSizes sizes;
    sizes.heads = width / kHeadWidth;
    sizes.head_width = kHeadWidth;
    sizes.latent_width = kLatent;
    sizes.mlp_ratio = kRatio;
    sizes.leaf_level = kLeafLevel;
    return sizes;
  }

  static AutoencoderSchedule partOf() {
    AutoencoderSchedule part;
    part.batch = kBatch;
    part.most_tokens = kTokens;
    part.surface = kPoints;
    return part;
  }

  std::shared_ptr<const Ball> object_;
  AutoencoderTrainer trainer_;
};

/// A step of the flow.
class FlowSteps {
 public:
  FlowSteps(size_t width, FactorPrecision precision)
      : trainer_(sizesOf(width), scheduleOf(), 1, std::make_shared<const Noise>(),
                 TrainerRun{nullptr, precision}) {}

  void step() { benchmark::DoNotOptimize(trainer_.step().loss); }

  static double operations(size_t width) {
    const FlowSizes sizes = sizesOf(width);
    const auto w = static_cast<double>(width), rotary = static_cast<double>(kRotary);
    const auto heads = static_cast<double>(sizes.block.heads);
    const auto block = [&](double rows) {
      return inBlocks(rows, (4 + 2 * kRatio) * w * w + 2 * w * rotary + 3 * heads * rotary) +
             attentions(rows, rows, w);
    };
    const auto tokens = static_cast<double>(kTokens), patches = static_cast<double>(kPatches);
    return static_cast<double>(kFlowBatch) *
           (static_cast<double>(sizes.block_count) * block(tokens + patches + 1) +
            static_cast<double>(sizes.noise_refiner_count) * block(tokens) +
            static_cast<double>(sizes.context_refiner_count) * block(patches) +
            kept(patches, w * static_cast<double>(kPatchNumbers + kPlaceNumbers)));
  }

 private:
  class Noise final : public FlowSource {
   public:
    size_t count() const override { return 1; }
    FlowObject object(size_t, uint64_t) const override {
      FlowObject made;
      made.latent.token_count = kTokens;
      made.latent.width = kLatent;
      made.latent.tokens = layerNumbers(kTokens * kLatent, 1, 1.0f);
      made.condition.rows = kPatches;
      made.condition.structure_width = kPatchNumbers;
      made.condition.colour_width = kPlaceNumbers;
      made.condition.structure = layerNumbers(kPatches * kPatchNumbers, 2, 1.0f);
      made.condition.colour = layerNumbers(kPatches * kPlaceNumbers, 3, 1.0f);
      return made;
    }
  };

  static FlowSizes sizesOf(size_t width) {
    FlowSizes sizes;
    sizes.block.heads = width / kHeadWidth;
    sizes.block.head_width = kHeadWidth;
    sizes.block.channels = width;
    sizes.block.mlp_width = kRatio * width;
    sizes.block.rotary_width = kRotary;
    sizes.block_count = 4;
    sizes.noise_refiner_count = 1;
    sizes.context_refiner_count = 2;
    sizes.token_width = kLatent;
    sizes.structure_width = kPatchNumbers;
    sizes.colour_width = kPlaceNumbers;
    sizes.time_width = 256;
    return sizes;
  }

  static FlowSchedule scheduleOf() {
    FlowSchedule schedule;
    schedule.batch = kFlowBatch;
    schedule.image_dropout = 0;
    return schedule;
  }

  FlowTrainer trainer_;
};

template <class Steps>
void takeSteps(benchmark::State& state, FactorPrecision precision) {
  const auto width = static_cast<size_t>(state.range(0));
  if (!defaultMatrixBackend().has(precision)) {
    state.SkipWithError("this machine has no products in bfloat16");
    return;
  }
  Steps steps(width, precision), wide(width, FactorPrecision::kFloat32);
  LargeLayer layer;
  std::vector<Reference> references = {
      {"large_layer", [&] { layer.run(); }},
      {"one_thread", [&] { withThreads(1, [&] { steps.step(); }); }}};
  if (precision != FactorPrecision::kFloat32) {
    references.push_back({"float32", [&] { wide.step(); }});
  }
  steps.step();
  wide.step();
  compareWithAll(
      state, [&] { steps.step(); }, references);
  const double operations = Steps::operations(width);
  state.counters["ratio_large_layer"] =
      state.counters["ratio_large_layer"] * operations / LargeLayer::kOperations;
  state.counters["GFLOP"] = 1e-9 * operations;
}

void structure(benchmark::State& state) {
  takeSteps<AutoencoderSteps>(state, FactorPrecision::kFloat32);
}
void narrowStructure(benchmark::State& state) {
  takeSteps<AutoencoderSteps>(state, FactorPrecision::kBfloat16);
}
void flow(benchmark::State& state) {
  takeSteps<FlowSteps>(state, FactorPrecision::kFloat32);
}
void narrowFlow(benchmark::State& state) {
  takeSteps<FlowSteps>(state, FactorPrecision::kBfloat16);
}

void atWidths(benchmark::internal::Benchmark* made) {
  made->Arg(128)->Arg(256)->Iterations(kRepeats)->UseManualTime()->Unit(benchmark::kMillisecond);
}

BENCHMARK(structure)->Name("train.autoencoder.step.structure_f32")->Apply(atWidths);
BENCHMARK(narrowStructure)->Name("train.autoencoder.step.structure_bf16")->Apply(atWidths);
BENCHMARK(flow)->Name("train.flow.step.f32")->Apply(atWidths);
BENCHMARK(narrowFlow)->Name("train.flow.step.bf16")->Apply(atWidths);

}  // namespace
}  // namespace stipple::bench
