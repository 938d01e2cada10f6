// Based on: DeG, density-sampled Gaussians (arXiv 2605.16355), its stages. Differs: tokens and
// anchors are drawn by keys of the step.
#include "train/networks/autoencoder_trainer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/number_text.h"
#include "base/random.h"
#include "train/networks/trainer_tensors.h"

namespace stipple {

namespace {

[[noreturn]] void refuse(const std::string& message) {
  fail(ErrorCode::kInvalidArgument, message);
}

void requireCount(uint64_t value, uint64_t least, uint64_t most, const char* name) {
  if (value >= least && value <= most) return;
  refuse(std::string("the number of ") + name + " is " + std::to_string(value) + "; " +
         std::to_string(least) + " to " + std::to_string(most) + " is allowed");
}

using LossNumbers = std::array<double, 9>;

LossNumbers numbersOf(const AutoencoderLosses& losses) {
  const SplatLosses& splats = losses.splats;
  return {losses.total,  losses.structure, losses.divergence, losses.l1,     losses.ssim,
          splats.volume, splats.opacity,   splats.off_centre, splats.overlap};
}

AutoencoderLosses lossesOf(const LossNumbers& n) {
  return {n[0], n[1], n[2], n[3], n[4], {n[5], n[6], n[7], n[8]}};
}

/// Adds a share of the losses of an example.
void addLosses(const AutoencoderLosses& from, double share, AutoencoderLosses& to) {
  to.total += share * from.total;
  to.structure += share * from.structure;
  to.divergence += share * from.divergence;
  to.l1 += share * from.l1;
  to.ssim += share * from.ssim;
  to.splats.volume += share * from.splats.volume;
  to.splats.opacity += share * from.splats.opacity;
  to.splats.off_centre += share * from.splats.off_centre;
  to.splats.overlap += share * from.splats.overlap;
}

}  // namespace

void validate(const AutoencoderSchedule& schedule) {
  validate(schedule.optimiser);
  requireCount(schedule.batch, 1, 4096, "objects in a step");
  requireCount(schedule.most_tokens, 1, uint64_t{1} << 16, "tokens of a latent");
  requireCount(schedule.token_halvings, 0, 8, "halvings of the tokens");
  requireCount(schedule.most_tokens >> schedule.token_halvings, 1, uint64_t{1} << 16,
               "tokens of a latent after all halvings");
  requireCount(schedule.least_anchors, 1, uint64_t{1} << 20, "anchors at least");
  requireCount(schedule.most_anchors, schedule.least_anchors, uint64_t{1} << 20, "anchors at most");
  requireCount(schedule.views, 1, 4096, "views of an object");
  requireCount(schedule.surface, 1, uint64_t{1} << 24, "points of the surface");
  if (schedule.keeps_encoder && schedule.optimiser.weight_decay > 0) {
    refuse("the weight decay is " + numberText(schedule.optimiser.weight_decay) +
           "; 0 is allowed where the encoder is kept");
  }
}

AutoencoderTrainer::AutoencoderTrainer(const AutoencoderSizes& sizes,
                                       std::vector<AutoencoderSchedule> parts, uint64_t seed,
                                       std::shared_ptr<const ObjectSource> objects,
                                       std::shared_ptr<const BackendFactory> backends,
                                       TrainerRun run)
    : networks_(sizes, run.precision),
      parts_(std::move(parts)),
      seed_(seed),
      objects_(std::move(objects)),
      backends_(std::move(backends)),
      exchange_(run.exchange ? std::move(run.exchange) : noExchange()),
      values_(networks_.startValues(seed)),
      gradients_(values_.size()) {
  if (parts_.empty()) refuse("a training has 0 parts; one or more are needed");
  for (size_t i = 0; i < parts_.size(); ++i) {
    validate(parts_[i]);
    requireExamples(*exchange_, parts_[i].batch, ("part " + std::to_string(i)).c_str());
  }
  if (objects_->count() == 0) refuse("there are 0 objects to learn from; one or more are needed");
  beginPart();
}

void AutoencoderTrainer::beginPart() {
  in_part_ = 0;
  if (isDone()) return;
  optimiser_.emplace(parts_[part_].optimiser, values_);
}

void AutoencoderTrainer::start(std::vector<float> values) {
  if (values.size() != values_.size()) refuse("weights to begin with are of other networks");
  values_ = std::move(values);
  beginPart();
}

std::vector<float> AutoencoderTrainer::meanValues() const {
  const std::vector<double>& mean = optimiser_->state().mean;
  return {mean.begin(), mean.end()};
}

AutoencoderStep AutoencoderTrainer::step(Progress* progress) {
  const AutoencoderSchedule& part = parts_[part_];
  const uint64_t key = keyedBits(seed_, RandomUse::kAnchorBudget, taken_);
  AutoencoderExample example;
  example.stage = part.stage;
  example.tokens = part.most_tokens >> (key % (part.token_halvings + 1));
  example.anchors =
      part.least_anchors +
      static_cast<uint64_t>(unitDouble(mixBits(key)) *
                            static_cast<double>(part.most_anchors - part.least_anchors + 1));
  example.views = part.views;
  example.surface = part.surface;
  example.keeps_encoder = part.keeps_encoder;
  const double share = 1 / static_cast<double>(part.batch);
  example.share = share * optimiser_->lossScale();
  AutoencoderStep done;
  done.step = taken_;
  done.part = part_;
  done.losses.ssim = 0;
  const std::vector<size_t> own = ownExamples(*exchange_, part.batch);
  std::vector<std::shared_ptr<const TrainingObject>> objects;
  for (const size_t b : own) {
    objects.push_back(objects_->object(objectInRounds(seed_, seen_ + b, objects_->count())));
  }
  std::vector<AutoencoderLosses> losses(own.size());
  example_gradients_.sum(own.size(), gradients_, [&](size_t at, std::span<float> gradients) {
    if (progress != nullptr) progress->throwIfCancelled();
    AutoencoderExample each = example;
    each.object = objects[at].get();
    each.seed = keyedBits(seed_ + taken_, RandomUse::kAnchorSeed, own[at]);
    losses[at] = networks_.addExample(values_, each, part.weights, *backends_, gradients, progress);
  });
  for (const AutoencoderLosses& of : losses) addLosses(of, share, done.losses);
  LossNumbers numbers = numbersOf(done.losses);
  sumStep(*exchange_, values_, gradients_, numbers);
  done.losses = lossesOf(numbers);
  done.weights = optimiser_->step(gradients_, values_);
  seen_ += part.batch;
  ++taken_;
  if (++in_part_ >= part.optimiser.total_steps) {
    ++part_;
    beginPart();
  }
  return done;
}

TensorTable AutoencoderTrainer::state() const {
  const WeightOptimiser::State& state = optimiser_->state();
  TensorTable table;
  putWeights("", values_, state, table);
  putValues("counts",
            std::vector<uint64_t>{state.steps, state.skipped, part_, taken_, in_part_, seen_},
            table);
  return table;
}

void AutoencoderTrainer::resume(const TensorTable& table) {
  const std::vector<uint64_t> counts = takeValues<uint64_t>(table, "counts", 6, 6);
  if (counts[2] > parts_.size()) {
    fail(ErrorCode::kFormat, "the checkpoint is in part " + std::to_string(counts[2]) +
                                 " of a training that has " + std::to_string(parts_.size()));
  }
  const WeightOptimiserOptions& options =
      parts_[std::min<size_t>(counts[2], parts_.size() - 1)].optimiser;
  std::vector<float> values;
  WeightOptimiser::State state = takeWeights(table, "", values_.size(), options, values);
  state.steps = counts[0];
  state.skipped = counts[1];
  optimiser_.emplace(options, std::move(state));
  values_ = std::move(values);
  part_ = counts[2];
  taken_ = counts[3];
  in_part_ = counts[4];
  seen_ = counts[5];
}

}  // namespace stipple
