#include "api/guard.h"
#include "api/handles.h"
#include "api/job.h"
#include "base/parallel.h"
#include "model/model_kinds.h"

using namespace stipple;
using namespace stipple::api;

namespace {

constexpr uint32_t kMaxGaussiansPerAnchor = 32;

ModelRequest requestFrom(const StippleDecodeOptions* options) {
  StippleDecodeOptions defaults;
  stipple_decode_options_init(&defaults);
  const StippleDecodeOptions given = completed(options, defaults, "options");
  ModelRequest request;
  request.budget = given.anchor_count;
  request.order = enumValue<AnchorOrder>(given.order, 1, "options->order");
  request.seed = given.seed;
  if (given.anchor_count < 1 || given.anchor_count > kMaxAnchorCount) {
    fail(ErrorCode::kInvalidArgument, "options->anchor_count is " +
                                          std::to_string(given.anchor_count) +
                                          "; 1 to 268435456 is allowed");
  }
  if (given.gaussians_per_anchor < 1 || given.gaussians_per_anchor > kMaxGaussiansPerAnchor) {
    fail(ErrorCode::kInvalidArgument, "options->gaussians_per_anchor is " +
                                          std::to_string(given.gaussians_per_anchor) +
                                          "; 1 to 32 is allowed");
  }
  request.gaussians_per_anchor = given.gaussians_per_anchor;
  if (given.smooth > 1) {
    fail(ErrorCode::kInvalidArgument,
         "options->smooth is " + std::to_string(given.smooth) + "; 0 or 1 is allowed");
  }
  request.smooth = given.smooth == 1;
  requireFinite(given.time, "options->time");
  request.time = given.time;
  return request;
}

StippleModelInfo infoFrom(const SplatModel& model) {
  const ModelInfo info = model.info();
  const ModelSettings settings = model.settings();
  const ModelKind& kind = modelKind(model.kind());
  StippleModelInfo out = {};
  out.leaf_level = static_cast<uint32_t>(info.leaf_level);
  out.leaf_count = info.leaf_count;
  out.sample_count = info.sample_count;
  std::copy(info.bounds_min.begin(), info.bounds_min.end(), out.bounds_min);
  std::copy(info.bounds_max.begin(), info.bounds_max.end(), out.bounds_max);
  out.kind = kind.number;
  out.kind_label = kind.label;
  out.sh_degree = static_cast<uint32_t>(info.sh_degree);
  out.min_anchors = settings.minimum_learned_budget;
  out.max_anchors = settings.maximum_learned_budget;
  const bool makes_several = settings.minimum_gaussians_per_anchor > 1;
  out.gaussians_per_anchor = makes_several ? settings.default_gaussians_per_anchor : 0;
  return out;
}

StippleModelSettings settingsFrom(const ModelSettings& settings) {
  StippleModelSettings out = {};
  out.budget_unit = static_cast<uint32_t>(settings.budget_unit);
  out.minimum_budget = settings.minimum_budget;
  out.maximum_budget = settings.maximum_budget;
  out.default_budget = settings.default_budget;
  out.minimum_learned_budget = settings.minimum_learned_budget;
  out.maximum_learned_budget = settings.maximum_learned_budget;
  out.minimum_gaussians_per_anchor = settings.minimum_gaussians_per_anchor;
  out.maximum_gaussians_per_anchor = settings.maximum_gaussians_per_anchor;
  out.default_gaussians_per_anchor = settings.default_gaussians_per_anchor;
  out.has_order = settings.has_order;
  out.has_seed = settings.has_seed;
  out.takes_mask = settings.takes_mask;
  out.has_smooth = settings.has_smooth ? 1 : 0;
  out.has_time = settings.time.has_value();
  const TimeRange time = settings.time.value_or(TimeRange());
  out.time_begin = time.begin;
  out.time_end = time.end;
  return out;
}

}  // namespace

extern "C" {

void stipple_decode_options_init(StippleDecodeOptions* options) {
  if (!options) return;
  *options = {};
  options->struct_size = sizeof(StippleDecodeOptions);
  options->order = STIPPLE_ORDER_SYSTEMATIC;
  options->anchor_count = 20000;
  options->gaussians_per_anchor = 1;
}

StippleStatus stipple_model_load(StippleContext* context, const char* path_utf8,
                                 StippleModel** model) {
  return guarded([&] {
    require(context, "context");
    require(model, "model");
    const std::string path = &require(path_utf8, "path_utf8");
    withThreads(context->state->thread_count, [&] {
      const ReadingAid aid = {context->state->weights->folders(), nullptr, context->state->backends};
      *model = new StippleModel{context->state, loadModel(path, aid)};
    });
  });
}

StippleStatus stipple_model_load_start(StippleContext* context, const char* path_utf8,
                                       StippleJob** job) {
  return guarded([&] {
    const Context state = require(context, "context").state;
    const std::string path = &require(path_utf8, "path_utf8");
    require(job, "job") = startJob(state, [path, state](Progress& progress) -> JobResult {
      return loadModel(path, {state->weights->folders(), &progress, state->backends});
    });
  });
}

StippleStatus stipple_model_save(const StippleModel* model, const char* path_utf8) {
  return guarded([&] { require(model, "model").model->save(&require(path_utf8, "path_utf8")); });
}

void stipple_model_free(StippleModel* model) {
  delete model;
}

StippleStatus stipple_model_info(const StippleModel* model, StippleModelInfo* info) {
  return guarded([&] { deliver(info, infoFrom(*require(model, "model").model), "info"); });
}

StippleStatus stipple_model_settings(const StippleModel* model, StippleModelSettings* settings) {
  return guarded([&] {
    deliver(settings, settingsFrom(require(model, "model").model->settings()), "settings");
  });
}

StippleStatus stipple_model_density(const StippleModel* model, StippleDensity** density) {
  return guarded([&] {
    const SplatModel& source = *require(model, "model").model;
    require(density, "density");
    std::shared_ptr<const DensityModel> made = source.density();
    if (!made) {
      fail(ErrorCode::kUnsupported, std::string("this model is a ") +
                                        modelKind(source.kind()).label +
                                        " and has no density; that of a mesh has one");
    }
    *density = new StippleDensity{model->context, std::move(made)};
  });
}

StippleStatus stipple_model_decode(const StippleModel* model, const StippleDecodeOptions* options,
                                   StippleCloud** cloud) {
  return guarded([&] {
    const SplatModel& source = *require(model, "model").model;
    require(cloud, "cloud");
    const ModelRequest request = requestFrom(options);
    source.requireMemory(request, *model->context);
    withThreads(model->context->thread_count, [&] {
      *cloud = new StippleCloud{model->context,
                                std::make_shared<const SplatCloud>(source.decode(request))};
    });
  });
}

StippleStatus stipple_model_decode_start(const StippleModel* model,
                                         const StippleDecodeOptions* options, StippleJob** job) {
  return guarded([&] {
    const std::shared_ptr<const SplatModel> source = require(model, "model").model;
    require(job, "job");
    const ModelRequest request = requestFrom(options);
    source->requireMemory(request, *model->context);
    *job = startJob(model->context, [source, request](Progress& progress) -> JobResult {
      return std::make_shared<const SplatCloud>(source->decode(request, &progress));
    });
  });
}

StippleStatus stipple_model_decode_memory_bound(const StippleModel* model,
                                                const StippleDecodeOptions* options,
                                                uint64_t* bytes) {
  return guarded([&] {
    const SplatModel& source = *require(model, "model").model;
    require(bytes, "bytes") = source.memoryBound(requestFrom(options));
  });
}

StippleStatus stipple_model_keep(const StippleModel* model, const uint8_t* mask,
                                 uint64_t mask_count, StippleModel** kept) {
  return guarded([&] {
    const SplatModel& source = *require(model, "model").model;
    require(mask, "mask");
    require(kept, "kept");
    model->context->requireMemory(source.keepMemoryBound(), "leaving splats out of a tree");
    withThreads(model->context->thread_count, [&] {
      *kept =
          new StippleModel{model->context, source.keep({mask, static_cast<size_t>(mask_count)})};
    });
  });
}

}  // extern "C"
