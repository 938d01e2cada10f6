#include "model/splat_model.h"

#include <algorithm>
#include <string>

#include "base/error.h"
#include "density/anchor_sampling.h"
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
  DecodeRequest wanted;
  wanted.budget = request.budget;
  wanted.gaussians_per_anchor = gaussiansOf(request, allowed);
  wanted.time = request.time;
  wanted.seed = request.seed;
  wanted.progress = progress;
  const std::shared_ptr<const DensityModel> sampled = density();
  const double middle = sampled ? begin + kSamplingShare * (end - begin) : begin;
  AnchorSet anchors;
  if (sampled) {
    if (progress) progress->enterPart(begin, middle);
    anchors = drawLearned(*sampled, samplingOf(request), draws(), progress);
    wanted.anchors = &anchors;
  }
  if (progress) progress->enterPart(middle, end);
  SplatCloud cloud = decoder().decode(wanted);
  if (progress) progress->enterPart(0, 1);
  return cloud;
}

uint64_t SplatModel::memoryBound(const ModelRequest& request) const {
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

void SplatModel::requireMemory(const ModelRequest& request, const MemoryLimit& limit) const {
  limit.requireBudget(request.budget, unitOf(settings()), [&](uint64_t budget) {
    ModelRequest smaller = request;
    smaller.budget = budget;
    return memoryBound(smaller);
  });
}

}  // namespace stipple
