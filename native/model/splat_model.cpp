#include "model/splat_model.h"

#include <algorithm>
#include <string>

#include "base/error.h"
#include "density/anchor_sampling.h"
#include "model/budget_octaves.h"
#include "model/model_kinds.h"

namespace stipple {

namespace {

/// Of the time that a decode takes, about: networks spend as much on densities as on splats.
constexpr double kSamplingShare = 0.5;

const char* unitOf(const ModelSettings& settings) {
  return settings.budget_unit == BudgetUnit::kAnchors ? "anchors" : "splats";
}

uint32_t gaussiansOf(const ModelRequest& request, const ModelSettings& settings) {
  const bool is_own =
      request.gaussians_per_anchor == 1 && settings.minimum_gaussians_per_anchor > 1;
  return is_own ? settings.default_gaussians_per_anchor : request.gaussians_per_anchor;
}

AnchorSamplingOptions samplingOf(const ModelRequest& request) {
  AnchorSamplingOptions sampling;
  sampling.count = request.budget;
  sampling.order = request.order;
  sampling.seed = request.seed;
  return sampling;
}

}  // namespace

std::shared_ptr<const SplatModel> SplatModel::keep(std::span<const uint8_t>) const {
  fail(ErrorCode::kUnsupported, std::string("this model is a ") + modelKind(kind()).label +
                                    ", which has no splats of its own to leave out; that of a "
                                    "cloud has");
}

ModelSettings SplatModel::settings() const {
  ModelSettings settings;
  static_cast<ModelTraits&>(settings) = modelKind(kind()).traits;
  limit(settings);
  return settings;
}

/// Makes the steps of smooth requests, each as a request of its own.
class SplatModel::StepMaker final : public BudgetOctaves::Maker {
 public:
  StepMaker(const SplatModel& model, const ModelRequest& request, const ModelSettings& allowed,
            Progress* progress, double begin, double end)
      : model_(model),
        request_(request),
        allowed_(allowed),
        progress_(progress),
        begin_(begin),
        end_(end) {}

  BudgetStep step(uint64_t budget) const override {
    ModelRequest request = request_;
    request.budget = budget;
    return model_.step(request, allowed_, progress_, begin_, end_);
  }

 private:
  const SplatModel& model_;
  const ModelRequest& request_;
  const ModelSettings& allowed_;
  Progress* progress_;
  double begin_, end_;
};

SplatModel::SplatModel() : octaves_(std::make_unique<BudgetOctaves>()) {}

SplatModel::~SplatModel() = default;

BudgetStep SplatModel::step(const ModelRequest& request, const ModelSettings& allowed,
                            Progress* progress, double begin, double end) const {
  DecodeRequest wanted;
  wanted.budget = request.budget;
  wanted.gaussians_per_anchor = gaussiansOf(request, allowed);
  wanted.time = request.time;
  wanted.seed = request.seed;
  wanted.progress = progress;
  const std::shared_ptr<const DensityModel> sampled = density();
  const double middle = sampled ? begin + kSamplingShare * (end - begin) : begin;
  BudgetStep step;
  step.budget = request.budget;
  if (sampled) {
    if (progress) progress->enterPart(begin, middle);
    step.anchors = drawLearned(*sampled, samplingOf(request), draws(), progress);
    wanted.anchors = &step.anchors;
  }
  if (progress) progress->enterPart(middle, end);
  step.splats = decoder().decode(wanted);
  if (progress) progress->enterPart(0, 1);
  return step;
}

SplatCloud SplatModel::decode(const ModelRequest& request, Progress* progress, double begin,
                              double end) const {
  requireFinite(request.time, "the time");
  const ModelSettings allowed = settings();
  if (request.budget < allowed.minimum_budget || request.budget > allowed.maximum_budget) {
    fail(ErrorCode::kInvalidArgument,
         "the budget is " + std::to_string(request.budget) + " " + unitOf(allowed) + "; " +
             std::to_string(allowed.minimum_budget) + " to " +
             std::to_string(allowed.maximum_budget) + " is allowed for this model");
  }
  if (!request.smooth || !allowed.has_smooth) {
    return std::move(step(request, allowed, progress, begin, end).splats);
  }
  if (!density()) {
    DecodeRequest wanted;
    wanted.budget = request.budget;
    wanted.gaussians_per_anchor = gaussiansOf(request, allowed);
    wanted.progress = progress;
    return decoder().decodeSmooth(wanted);
  }
  ModelRequest nested = request;
  nested.order = AnchorOrder::kProgressive;
  return octaves_->splats(nested, allowed, StepMaker(*this, nested, allowed, progress, begin, end));
}

uint64_t SplatModel::stepMemoryBound(const ModelRequest& request) const {
  const uint32_t gaussians = gaussiansOf(request, settings());
  const uint64_t splats = decoder().memoryBound(request.budget, gaussians);
  const std::shared_ptr<const DensityModel> sampled = density();
  if (!sampled) return splats;
  // What sampling needs beside the anchors is free again when they are decoded, apart from what
  // answers leave.
  return std::max(sampleMemoryBound(request.budget, false),
                  anchorSetBytes(request.budget) + splats) +
         sampled->answerMemoryBound();
}

uint64_t SplatModel::memoryBound(const ModelRequest& request) const {
  const ModelSettings allowed = settings();
  if (!request.smooth || !allowed.has_smooth) return stepMemoryBound(request);
  // What grows from what; of anchors also two steps that are kept, a third of the octave before
  // while they are made, and a tree of places.
  constexpr uint64_t kPairing = 64;
  ModelRequest many = request;
  many.budget = density() ? octaveAround(request.budget, allowed).many
                          : std::min(2 * request.budget, allowed.maximum_budget);
  if (!density()) return stepMemoryBound(many) + kPairing * many.budget;
  return 3 * stepMemoryBound(many) + kPairing * many.budget * gaussiansOf(many, allowed);
}

void SplatModel::requireMemory(const ModelRequest& request, const MemoryLimit& limit) const {
  limit.requireBudget(request.budget, unitOf(settings()), [&](uint64_t budget) {
    ModelRequest smaller = request;
    smaller.budget = budget;
    return memoryBound(smaller);
  });
}

}  // namespace stipple
