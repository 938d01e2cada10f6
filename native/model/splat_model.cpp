#include "model/splat_model.h"

#include <algorithm>
#include <string>

#include "base/error.h"
#include "density/anchor_sampling.h"
#include "model/model_kinds.h"

namespace stipple {

namespace {

uint32_t gaussiansOf(const ModelRequest& request, const ModelSettings& settings) {
  const bool is_own =
      request.gaussians_per_anchor == 1 && settings.minimum_gaussians_per_anchor > 1;
  return is_own ? settings.default_gaussians_per_anchor : request.gaussians_per_anchor;
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

SplatCloud SplatModel::decode(const ModelRequest& request, Progress* progress) const {
  requireFinite(request.time, "the time");
  DecodeRequest wanted;
  wanted.budget = request.budget;
  wanted.gaussians_per_anchor = gaussiansOf(request, settings());
  wanted.time = request.time;
  wanted.seed = request.seed;
  wanted.progress = progress;
  const std::shared_ptr<const DensityModel> sampled = density();
  if (!sampled) return decoder().decode(wanted);
  AnchorSamplingOptions sampling;
  sampling.count = request.budget;
  sampling.order = request.order;
  sampling.seed = request.seed;
  const AnchorSet anchors = drawLearned(*sampled, sampling, draws(), progress);
  wanted.anchors = &anchors;
  return decoder().decode(wanted);
}

uint64_t SplatModel::memoryBound(const ModelRequest& request) const {
  const uint32_t gaussians = gaussiansOf(request, settings());
  const uint64_t splats = decoder().memoryBound(request.budget, gaussians);
  if (!density()) return splats;
  // What sampling needs beside the anchors is free again when they are decoded.
  return std::max(sampleMemoryBound(request.budget, false),
                  anchorSetBytes(request.budget) + splats);
}

void SplatModel::requireMemory(const ModelRequest& request, const MemoryLimit& limit) const {
  const bool in_anchors = settings().budget_unit == BudgetUnit::kAnchors;
  limit.requireBudget(request.budget, in_anchors ? "anchors" : "splats", [&](uint64_t budget) {
    ModelRequest smaller = request;
    smaller.budget = budget;
    return memoryBound(smaller);
  });
}

}  // namespace stipple
