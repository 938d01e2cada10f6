#include <cmath>
#include <utility>

#include "data/position_bounds.h"
#include "api/field.h"
#include "api/guard.h"
#include "api/handles.h"
#include "api/hierarchy.h"
#include "api/job.h"
#include "base/parallel.h"
#include "io/assets/asset_header.h"
#include "io/assets/surface_asset.h"

using namespace stipple;
using namespace stipple::api;

namespace {

constexpr uint64_t kMinSampleCount = 1000;
constexpr uint64_t kMaxSampleCount = uint64_t{1} << 26;
constexpr uint32_t kMaxGaussiansPerAnchor = 32;

SurfaceModelOptions modelOptions(const StippleModelFromMeshOptions& given) {
  SurfaceModelOptions options;
  if (given.leaf_level < 1 || given.leaf_level > static_cast<uint32_t>(kMaxLeafLevel)) {
    fail(ErrorCode::kInvalidArgument,
         "options->leaf_level is " + std::to_string(given.leaf_level) + "; 1 to 10 is allowed");
  }
  options.density.leaf_level = static_cast<int>(given.leaf_level);
  if (given.sample_count != 0) {
    if (given.sample_count < kMinSampleCount || given.sample_count > kMaxSampleCount) {
      fail(ErrorCode::kInvalidArgument, "options->sample_count is " +
                                            std::to_string(given.sample_count) +
                                            "; 0 (automatic) or 1000 to 67108864 is allowed");
    }
    options.sampling.count = given.sample_count;
  }
  if (!(given.detail_weight >= 0) || !std::isfinite(given.detail_weight)) {
    fail(ErrorCode::kInvalidArgument, "options->detail_weight is " +
                                          std::to_string(given.detail_weight) +
                                          "; 0 or more is allowed");
  }
  options.sampling.detail_weight = given.detail_weight;
  options.sampling.seed = given.seed;
  return options;
}

struct DecodeSettings {
  AnchorSamplingOptions sampling;
  uint32_t gaussians_per_anchor = 1;
};

DecodeSettings decodeSettings(const StippleDecodeOptions* options) {
  StippleDecodeOptions defaults;
  stipple_decode_options_init(&defaults);
  const StippleDecodeOptions given = completed(options, defaults, "options");
  DecodeSettings settings;
  settings.sampling.count = given.anchor_count;
  settings.sampling.order = enumValue<AnchorOrder>(given.order, 1, "options->order");
  settings.sampling.seed = given.seed;
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
  settings.gaussians_per_anchor = given.gaussians_per_anchor;
  return settings;
}

/// Density and decoder of a model that has both.
struct Sampled {
  const OctreeDensity* density;
  const Decoder* decoder;
  LearnedDraws draws;
};
Sampled sampledOf(const ModelParts& parts) {
  if (const FieldSource* field = fieldOf(parts)) {
    return {field->density.get(), field->decoder.get(), field->draws};
  }
  const auto& surface = std::get<SurfaceModel>(parts.source);
  return {surface.density.get(), surface.decoder.get(), {}};
}

/// Of a field: its own count of Gaussians where one is asked for, which is the default.
DecodeSettings settingsFor(const ModelParts& parts, DecodeSettings settings) {
  const FieldSource* field = fieldOf(parts);
  if (field && settings.gaussians_per_anchor == 1) {
    settings.gaussians_per_anchor = field->decoder->field().layout.gaussians;
  }
  return settings;
}

std::shared_ptr<const SplatCloud> decode(const ModelParts& parts, const DecodeSettings& settings,
                                         Progress* progress) {
  if (const Hierarchy* hierarchy = hierarchyOf(parts)) {
    DecodeRequest request;
    request.budget = settings.sampling.count;
    request.gaussians_per_anchor = settings.gaussians_per_anchor;
    return std::make_shared<const SplatCloud>((*hierarchy)->decode(request));
  }
  const Sampled model = sampledOf(parts);
  const AnchorSet anchors = drawLearned(*model.density, settings.sampling, model.draws, progress);
  DecodeRequest request;
  request.anchors = &anchors;
  request.gaussians_per_anchor = settings.gaussians_per_anchor;
  request.seed = settings.sampling.seed;
  request.progress = progress;
  return std::make_shared<const SplatCloud>(model.decoder->decode(request));
}

uint64_t decodeMemoryBound(const ModelParts& parts, const DecodeSettings& settings) {
  if (const Hierarchy* hierarchy = hierarchyOf(parts)) {
    return (*hierarchy)->memoryBound(settings.sampling.count, settings.gaussians_per_anchor);
  }
  const Sampled model = sampledOf(parts);
  return sampleMemoryBound(settings.sampling.count, settings.sampling.with_ranks) +
         model.decoder->memoryBound(settings.sampling.count, settings.gaussians_per_anchor);
}

SurfaceAsset toAsset(const SurfaceModel& model, const ModelNotes& notes) {
  SurfaceAsset asset;
  asset.settings_json = notes.settings_json;
  asset.extras = notes.extras;
  static_cast<OctreeTensors&>(asset) = octreeOf(*model.density);
  asset.surface = *model.surface;
  return asset;
}

ModelParts loadSurface(const std::string& path) {
  SurfaceAsset asset = readSurfaceAsset(path);
  auto notes = std::make_shared<const ModelNotes>(
      ModelNotes{std::move(asset.settings_json), std::move(asset.extras)});
  RootCube root;
  root.origin = asset.root_origin;
  root.side = asset.root_side;
  try {
    auto density = std::make_shared<const OctreeDensity>(OctreeDensity::fromLevels(
        root, std::move(asset.cells), std::move(asset.log_probabilities)));
    auto surface = std::make_shared<const PointSet>(std::move(asset.surface));
    return {surfaceModelFromParts(std::move(surface), std::move(density)), std::move(notes)};
  } catch (const Error& error) {
    fail(ErrorCode::kFormat, path + ": " + error.what());
  }
}

ModelParts loaded(const std::string& path) {
  const std::string kind = readAssetKind(path);
  if (kind == kAssetHierarchy) return loadHierarchy(path);
  return kind == kAssetField ? loadField(path) : loadSurface(path);
}

}  // namespace

extern "C" {

void stipple_model_from_mesh_options_init(StippleModelFromMeshOptions* options) {
  if (!options) return;
  *options = {};
  options->struct_size = sizeof(StippleModelFromMeshOptions);
  options->leaf_level = static_cast<uint32_t>(kMaxLeafLevel);
  options->detail_weight = 1.0;
}

void stipple_decode_options_init(StippleDecodeOptions* options) {
  if (!options) return;
  *options = {};
  options->struct_size = sizeof(StippleDecodeOptions);
  options->order = STIPPLE_ORDER_SYSTEMATIC;
  options->anchor_count = 20000;
  options->gaussians_per_anchor = 1;
}

StippleStatus stipple_model_from_mesh_start(StippleContext* context, const StippleMesh* mesh,
                                            const StippleModelFromMeshOptions* options,
                                            StippleJob** job) {
  return guarded([&] {
    require(context, "context");
    require(mesh, "mesh");
    require(job, "job");
    StippleModelFromMeshOptions defaults;
    stipple_model_from_mesh_options_init(&defaults);
    const SurfaceModelOptions settings = modelOptions(completed(options, defaults, "options"));
    std::shared_ptr<const TriMesh> triangles = mesh->mesh;
    *job = startJob(context->state, [triangles, settings](Progress& progress) -> JobResult {
      return ModelParts{buildSurfaceModel(*triangles, settings, &progress)};
    });
  });
}

StippleStatus stipple_model_load(StippleContext* context, const char* path_utf8,
                                 StippleModel** model) {
  return guarded([&] {
    require(context, "context");
    require(model, "model");
    const std::string path = &require(path_utf8, "path_utf8");
    withThreads(context->state->thread_count, [&] {
      *model = new StippleModel{context->state, loaded(path)};
    });
  });
}

StippleStatus stipple_model_load_start(StippleContext* context, const char* path_utf8,
                                       StippleJob** job) {
  return guarded([&] {
    const Context state = require(context, "context").state;
    const std::string path = &require(path_utf8, "path_utf8");
    require(job, "job") = startJob(state, [path](Progress&) -> JobResult { return loaded(path); });
  });
}

StippleStatus stipple_model_save(const StippleModel* model, const char* path_utf8) {
  return guarded([&] {
    const ModelParts& parts = require(model, "model").parts;
    const std::string path = &require(path_utf8, "path_utf8");
    const ModelNotes notes = parts.notes ? *parts.notes : ModelNotes();
    if (const Hierarchy* hierarchy = hierarchyOf(parts)) {
      saveHierarchy(**hierarchy, notes, path);
    } else if (const FieldSource* field = fieldOf(parts)) {
      saveField(*field, notes, path);
    } else {
      writeSurfaceAsset(toAsset(std::get<SurfaceModel>(parts.source), notes), path);
    }
  });
}

void stipple_model_free(StippleModel* model) {
  delete model;
}

StippleStatus stipple_model_info(const StippleModel* model, StippleModelInfo* info) {
  return guarded([&] {
    const ModelParts& parts = require(model, "model").parts;
    StippleModelInfo out = {};
    if (const Hierarchy* hierarchy = hierarchyOf(parts)) {
      const SplatCloud& leaves = *(*hierarchy)->leaves();
      out.kind = STIPPLE_MODEL_HIERARCHY;
      out.leaf_count = leaves.size();
      out.sh_degree = static_cast<uint32_t>(leaves.sh_degree);
      fillBounds(leaves.positions, out.bounds_min, out.bounds_max);
    } else if (const FieldSource* field = fieldOf(parts)) {
      const FieldParameters& learned = field->decoder->field();
      out.kind = STIPPLE_MODEL_FIELD;
      out.leaf_level = static_cast<uint32_t>(field->density->leafLevel());
      out.leaf_count = field->density->leafCount();
      out.sh_degree = static_cast<uint32_t>(learned.layout.sh_degree);
      out.gaussians_per_anchor = learned.layout.gaussians;
      out.least_anchors = learned.least_anchors;
      out.most_anchors = learned.most_anchors;
      const RootCube& root = field->density->root();
      for (size_t axis = 0; axis < 3; ++axis) {
        out.bounds_min[axis] = static_cast<float>(root.origin[axis]);
        out.bounds_max[axis] = static_cast<float>(root.origin[axis] + root.side);
      }
    } else {
      const auto& surface = std::get<SurfaceModel>(parts.source);
      out.kind = STIPPLE_MODEL_SURFACE;
      out.leaf_level = static_cast<uint32_t>(surface.density->leafLevel());
      out.leaf_count = surface.density->leafCount();
      out.sample_count = surface.surface->size();
      fillBounds(surface.surface->positions, out.bounds_min, out.bounds_max);
    }
    deliver(info, out, "info");
  });
}

StippleStatus stipple_model_density(const StippleModel* model, StippleDensity** density) {
  return guarded([&] {
    require(model, "model");
    require(density, "density");
    if (hierarchyOf(model->parts)) {
      fail(ErrorCode::kUnsupported,
           "this model is the hierarchy of a cloud and has no density; that of a mesh has one");
    }
    const FieldSource* field = fieldOf(model->parts);
    *density = new StippleDensity{
        model->context,
        field ? field->density : std::get<SurfaceModel>(model->parts.source).density};
  });
}

StippleStatus stipple_model_decode(const StippleModel* model, const StippleDecodeOptions* options,
                                   StippleCloud** cloud) {
  return guarded([&] {
    require(model, "model");
    require(cloud, "cloud");
    const DecodeSettings settings = settingsFor(model->parts, decodeSettings(options));
    model->context->requireMemory(decodeMemoryBound(model->parts, settings), "this budget");
    withThreads(model->context->thread_count, [&] {
      *cloud = new StippleCloud{model->context, decode(model->parts, settings, nullptr)};
    });
  });
}

StippleStatus stipple_model_decode_start(const StippleModel* model,
                                         const StippleDecodeOptions* options, StippleJob** job) {
  return guarded([&] {
    require(model, "model");
    require(job, "job");
    const DecodeSettings settings = settingsFor(model->parts, decodeSettings(options));
    model->context->requireMemory(decodeMemoryBound(model->parts, settings), "this budget");
    const ModelParts parts = model->parts;
    *job = startJob(model->context, [parts, settings](Progress& progress) -> JobResult {
      return decode(parts, settings, &progress);
    });
  });
}

StippleStatus stipple_model_decode_memory_bound(const StippleModel* model,
                                                const StippleDecodeOptions* options,
                                                uint64_t* bytes) {
  return guarded([&] {
    require(model, "model");
    require(bytes, "bytes") =
        decodeMemoryBound(model->parts, settingsFor(model->parts, decodeSettings(options)));
  });
}

}  // extern "C"
