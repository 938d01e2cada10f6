// Based on: Nam et al., Generative Densification, CVPR 2025: training on input and other views.
// Differs: the loss is of the finer splats alone, since the coarse ones are given.
#include "train/detail/detail_trainer.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/random.h"
#include "train/networks/example_views.h"
#include "train/networks/trainer_tensors.h"

namespace stipple {

namespace {

[[noreturn]] void refuse(const std::string& message) {
  fail(ErrorCode::kInvalidArgument, message);
}

void require(uint64_t value, uint64_t least, uint64_t most, const char* what) {
  if (value >= least && value <= most) return;
  refuse(std::string(what) + " is " + std::to_string(value) + "; " + std::to_string(least) +
         " to " + std::to_string(most) + " is allowed");
}

}  // namespace

void validate(const DetailSchedule& schedule) {
  validate(schedule.optimiser);
  require(schedule.batch, 1, 4096, "the number of objects in a step of the detail network");
  require(schedule.least_splats, 1, uint64_t{1} << 24, "the least number of coarse splats");
  require(schedule.most_splats, schedule.least_splats, uint64_t{1} << 24,
          "the largest number of coarse splats");
  require(schedule.views, 1, 64, "the number of views that the detail network is told of");
  require(schedule.seen, 1, 64, "the number of views that the loss looks at");
  if (!(schedule.least_share > 0 && schedule.least_share <= 1)) {
    refuse("the least share of splats that become finer is " +
           std::to_string(schedule.least_share) + "; more than 0, up to 1, is allowed");
  }
  if (!(schedule.ssim >= 0 && schedule.ssim <= 100)) {
    refuse("the weight of 1 - SSIM is " + std::to_string(schedule.ssim) + "; 0 to 100 is allowed");
  }
}

std::vector<DetailView> detailViews(const ObjectViews& views, const std::vector<size_t>& chosen) {
  std::vector<DetailView> made;
  for (const size_t index : chosen) {
    ObjectView view = views.view(index);
    made.push_back({view.camera, std::move(view.image), std::move(view.alpha)});
  }
  return made;
}

DetailTrainer::DetailTrainer(const DetailModelSizes& sizes, const DetailSchedule& schedule,
                             uint64_t seed, std::shared_ptr<const DetailSource> objects,
                             std::shared_ptr<const BackendFactory> backends, TrainerRun run)
    : model_(sizes, run.precision),
      schedule_(schedule),
      seed_(seed),
      objects_(std::move(objects)),
      backends_(std::move(backends)),
      exchange_(run.exchange ? std::move(run.exchange) : noExchange()),
      values_(model_.startValues(seed)),
      gradients_(values_.size()) {
  validate(schedule);
  requireExamples(*exchange_, schedule_.batch, "the detail network");
  if (objects_->count() == 0) refuse("there are 0 objects to learn from; one or more are needed");
  optimiser_.emplace(schedule_.optimiser, values_);
}

std::vector<float> DetailTrainer::meanValues() const {
  const std::vector<double>& mean = optimiser_->state().mean;
  return {mean.begin(), mean.end()};
}

DetailTrainer::Losses DetailTrainer::addExample(size_t index, uint64_t key, double share,
                                                std::span<float> gradients,
                                                Progress* progress) const {
  const double octaves = std::log2(static_cast<double>(schedule_.most_splats) /
                                   static_cast<double>(schedule_.least_splats));
  const double height = unitDouble(keyedBits(key, RandomUse::kAnchorBudget, 0));
  const auto splats = static_cast<uint64_t>(
      std::lround(static_cast<double>(schedule_.least_splats) * std::exp2(octaves * height)));
  const SplatCloud coarse = objects_->coarse(index, splats);
  const ObjectViews& views = objects_->views(index);
  const double part =
      schedule_.least_share +
      (1 - schedule_.least_share) * unitDouble(keyedBits(key, RandomUse::kAnchorBudget, 1));
  const auto points = static_cast<size_t>(std::ceil(part * static_cast<double>(coarse.size())));
  const CoarseEvidence evidence = gatherEvidence(
      *backends_, coarse, detailViews(views, drawnViews(views.count(), schedule_.views, key)),
      points, progress);
  DetailModel::Tape tape;
  const SplatCloud fine = model_.forward(values_, coarse, evidence, tape);
  SplatCloud by_fine = zerosLike(fine), by_view;
  const std::vector<size_t> seen = drawnViews(views.count(), schedule_.seen, mixBits(key));
  const std::unique_ptr<ViewPass> pass = backends_->makeViewPass();
  const double view_share = share / static_cast<double>(seen.size());
  const double scaled_share = view_share * optimiser_->lossScale();
  Losses losses;
  for (const size_t at : seen) {
    if (progress != nullptr) progress->throwIfCancelled();
    const ObjectView view = views.view(at);
    const bool is_white = keyedBits(key, RandomUse::kBackground, at) & 1;
    const ImageLossValue loss = addViewLoss(*pass, view, is_white, fine, {}, schedule_.ssim,
                                            scaled_share, by_view, by_fine, progress);
    losses.l1 += view_share * loss.l1;
    losses.ssim += view_share * loss.ssim;
    losses.loss += view_share * (1 + schedule_.ssim) * loss.loss;
  }
  model_.backward(values_, coarse, evidence, tape, fine, by_fine, gradients);
  return losses;
}

DetailStep DetailTrainer::step(Progress* progress) {
  DetailStep done;
  done.step = taken_;
  const std::vector<size_t> own = ownExamples(*exchange_, schedule_.batch);
  std::vector<Losses> of_examples(own.size());
  example_gradients_.sum(own.size(), gradients_, [&](size_t example, std::span<float> gradients) {
    const size_t b = own[example];
    const uint64_t key = keyedBits(seed_ + taken_, RandomUse::kAnchorSeed, b);
    const size_t index = objectInRounds(seed_, taken_ * schedule_.batch + b, objects_->count());
    of_examples[example] =
        addExample(index, key, 1 / static_cast<double>(schedule_.batch), gradients, progress);
  });
  std::vector<double> losses(3);
  for (const Losses& of : of_examples) {
    losses[0] += of.loss;
    losses[1] += of.l1;
    losses[2] += of.ssim;
  }
  sumStep(*exchange_, values_, gradients_, losses);
  done.loss = losses[0];
  done.l1 = losses[1];
  done.ssim = losses[2];
  done.weights = optimiser_->step(gradients_, values_);
  ++taken_;
  return done;
}

TensorTable DetailTrainer::state() const {
  return trainerState("detail.", values_, optimiser_->state(), taken_);
}

void DetailTrainer::resume(const TensorTable& table) {
  TrainerState state = takeTrainerState(table, "detail.", values_.size(), schedule_.optimiser);
  optimiser_.emplace(schedule_.optimiser, std::move(state.optimiser));
  values_ = std::move(state.values);
  taken_ = state.taken;
}

}  // namespace stipple
