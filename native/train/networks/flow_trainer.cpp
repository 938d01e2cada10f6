// Based on: DeG, density-sampled Gaussians (arXiv 2605.16355), the training of its flow network.
#include "train/networks/flow_trainer.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "generate/seeded_noise.h"
#include "train/networks/start_weights.h"
#include "train/networks/trainer_tensors.h"

namespace stipple {

namespace {

constexpr double kFirstFrequency = 1, kLastFrequency = 16;  // of places

[[noreturn]] void refuse(const std::string& message) {
  fail(ErrorCode::kInvalidArgument, message);
}

void require(uint64_t value, uint64_t least, uint64_t most, const char* name) {
  if (value >= least && value <= most) return;
  refuse(std::string(name) + " is " + std::to_string(value) + "; " + std::to_string(least) +
         " to " + std::to_string(most) + " is allowed");
}

/// Gates are 0 at first, so that each block hands on what it gets; places are those of the content
/// nowhere; velocities are 0.
std::vector<float> firstValues(const ParameterLayout& layout, const FlowSizes& sizes,
                               uint64_t seed) {
  std::vector<std::string> silent = {"adaLN_modulation.1.weight", "out_layer.weight",
                                     "cam_out_layer.weight"};
  for (const Parameter& parameter : layout.parameters()) {
    if (parameter.name.ends_with(".final_map.weight")) silent.push_back(parameter.name);
  }
  std::vector<float> values = startWeights(layout, seed, silent);
  const double spread = 1 / std::sqrt(static_cast<double>(sizes.block.channels));
  for (const Parameter& parameter : layout.parameters()) {
    const bool is_frequency = parameter.name.find(".freqs_") != std::string::npos;
    const bool is_table = parameter.name.ends_with("shift_table");
    for (size_t i = 0; i < parameter.count; ++i) {
      float& value = values[parameter.first + i];
      if (is_frequency) {
        const double share = parameter.count > 1
                                 ? static_cast<double>(i) / static_cast<double>(parameter.count - 1)
                                 : 0;
        value = static_cast<float>(kFirstFrequency + share * (kLastFrequency - kFirstFrequency));
      }
      if (is_table) {
        const uint64_t bits = keyedBits(seed, RandomUse::kNetworkStart, parameter.first + i);
        value = static_cast<float>(spread *
                                   portableNormal(unitDouble(bits), unitDouble(mixBits(bits))));
      }
    }
  }
  return values;
}

}  // namespace

void validate(const FlowSchedule& schedule) {
  validate(schedule.optimiser);
  require(schedule.batch, 1, 4096, "the number of objects in a step of the flow");
  if (!(schedule.image_dropout >= 0 && schedule.image_dropout <= 1)) {
    refuse("the share of examples without an image is " + std::to_string(schedule.image_dropout) +
           "; 0 to 1 is allowed");
  }
  if (!(std::abs(schedule.time_mean) <= 10)) {
    refuse("the mean of times is " + std::to_string(schedule.time_mean) + "; -10 to 10 is allowed");
  }
}

void validate(const FlowSizes& sizes) {
  require(sizes.block.heads, 1, 64, "the number of heads of the flow");
  require(sizes.block.head_width, 6, 256, "the width of a head of the flow");
  if (sizes.block.head_width % 2 != 0) {
    refuse("the width of a head of the flow is " + std::to_string(sizes.block.head_width) +
           "; an even number is needed");
  }
  require(sizes.block.mlp_width, 1, 65536, "the width of the flow's MLPs");
  require(sizes.block.rotary_width, 1, 4096, "the rotary width of the flow");
  require(sizes.block_count, 1, 64, "the number of the flow's blocks");
  require(sizes.noise_refiner_count, 0, 64, "the number of the flow's refiners of noise");
  require(sizes.context_refiner_count, 0, 64, "the number of the flow's refiners of the image");
}

/// What a step asks of one object.
struct FlowTrainer::Drawn {
  double time = 0;
  FlowExample example;
  ImageCondition condition;
  double count = 0;  ///< numbers of its velocity
};

FlowTrainer::FlowTrainer(const FlowSizes& sizes, const FlowSchedule& schedule, uint64_t seed,
                         std::shared_ptr<const FlowSource> objects, TrainerRun run)
    : layout_(run.precision),
      schedule_(schedule),
      seed_(seed),
      objects_(std::move(objects)),
      exchange_(run.exchange ? std::move(run.exchange) : noExchange()),
      flow_((validate(sizes), layout_), sizes),
      values_(firstValues(layout_, sizes, seed)),
      gradients_(values_.size()) {
  validate(schedule);
  requireExamples(*exchange_, schedule_.batch, "the flow");
  if (objects_->count() == 0) refuse("there are 0 objects to learn from; one or more are needed");
  optimiser_.emplace(schedule_.optimiser, values_);
}

void FlowTrainer::start(std::vector<float> values) {
  if (values.size() != values_.size()) refuse("weights to begin with are of another flow");
  values_ = std::move(values);
  optimiser_.emplace(schedule_.optimiser, values_);
}

std::vector<float> FlowTrainer::meanValues() const {
  const std::vector<double>& mean = optimiser_->state().mean;
  return {mean.begin(), mean.end()};
}

TensorTable FlowTrainer::tensors(std::span<const float> values) const {
  TensorTable table;
  for (const Parameter& parameter : layout_.parameters()) {
    const float* const first = values.data() + parameter.first;
    table[parameter.name] = {parameter.shape, std::vector<float>(first, first + parameter.count)};
  }
  return table;
}

FlowTrainer::Drawn FlowTrainer::drawn(FlowObject object, uint64_t key) const {
  Drawn made;
  const auto normal = [&](uint64_t bits) {
    return portableNormal(unitDouble(bits), unitDouble(mixBits(bits)));
  };
  Latent noise = object.latent;
  for (size_t i = 0; i < noise.tokens.size(); ++i) {
    noise.tokens[i] = static_cast<float>(normal(keyedBits(key, RandomUse::kTokenNoise, i)));
  }
  for (size_t i = 0; i < noise.camera.size(); ++i) {
    noise.camera[i] = static_cast<float>(normal(keyedBits(key, RandomUse::kCameraNoise, i)));
  }
  const double at = schedule_.time_mean + normal(keyedBits(key, RandomUse::kFlowTime, 0));
  made.time = 1 / (1 + std::exp(-at));
  made.example = flowExample(object.latent, noise, made.time);
  made.condition = std::move(object.condition);
  const bool is_unseen =
      unitDouble(keyedBits(key, RandomUse::kFlowTime, 1)) < schedule_.image_dropout;
  if (is_unseen) {
    std::fill(made.condition.structure.begin(), made.condition.structure.end(), 0.0f);
    std::fill(made.condition.colour.begin(), made.condition.colour.end(), 0.0f);
  }
  made.count = static_cast<double>(noise.tokens.size() + noise.camera.size());
  return made;
}

FlowStep FlowTrainer::step(Progress* progress) {
  FlowStep done;
  done.step = taken_;
  const double scale = optimiser_->lossScale();
  const double parts = static_cast<double>(schedule_.batch) / scale;
  const std::vector<size_t> own = ownExamples(*exchange_, schedule_.batch);
  std::vector<double> losses(own.size());
  example_gradients_.sum(own.size(), gradients_, [&](size_t example, std::span<float> gradients) {
    if (progress != nullptr) progress->throwIfCancelled();
    const size_t b = own[example];
    const uint64_t key = keyedBits(seed_ + taken_, RandomUse::kAnchorSeed, b);
    const size_t index = objectInRounds(seed_, taken_ * schedule_.batch + b, objects_->count());
    const Drawn at = drawn(objects_->object(index, mixBits(key)), key);
    TrainedFlow::Tape tape;
    const Latent seen = flow_.forward(values_, at.example.state, at.time, at.condition, tape);
    Latent by;
    losses[example] = flowLoss(seen, at.example.velocity, at.count * parts, by) / scale;
    flow_.backward(values_, at.example.state, at.condition, tape, by, gradients);
  });
  for (const double loss : losses) done.loss += loss;
  sumStep(*exchange_, values_, gradients_, {&done.loss, 1});
  done.weights = optimiser_->step(gradients_, values_);
  ++taken_;
  return done;
}

double FlowTrainer::loss(std::span<const float> values, const FlowSource& objects, size_t draws,
                         uint64_t seed, Progress* progress) const {
  const size_t all = objects.count() * draws;
  std::vector<double> losses(all);
  parallelFor(all, 1, [&](size_t i, size_t) {
    if (progress != nullptr) progress->throwIfCancelled();
    const size_t index = i / draws, draw = i % draws;
    const uint64_t key = keyedBits(seed + index, RandomUse::kAnchorSeed, draw);
    const Drawn at = drawn(objects.object(index, mixBits(key)), key);
    TrainedFlow::Tape tape;
    Latent by;
    losses[i] = flowLoss(flow_.forward(values, at.example.state, at.time, at.condition, tape),
                         at.example.velocity, at.count * static_cast<double>(all), by);
  });
  double sum = 0;
  for (const double loss : losses) sum += loss;
  return sum;
}

TensorTable FlowTrainer::state() const {
  return trainerState("flow.", values_, optimiser_->state(), taken_);
}

void FlowTrainer::resume(const TensorTable& table) {
  TrainerState state = takeTrainerState(table, "flow.", values_.size(), schedule_.optimiser);
  optimiser_.emplace(schedule_.optimiser, std::move(state.optimiser));
  values_ = std::move(state.values);
  taken_ = state.taken;
}

}  // namespace stipple
