#include <cmath>
#include <memory>

#include "api/guard.h"
#include "api/handles.h"
#include "api/job.h"
#include "mesh/view_harmonics.h"
#include "model/surface_splats.h"

using namespace stipple;
using namespace stipple::api;

namespace {

constexpr uint64_t kMinSampleCount = 1000;
constexpr uint64_t kMaxSampleCount = uint64_t{1} << 26;

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
  } else {
    options.sampling.detail_count = options.sampling.count;
  }
  if (!(given.detail_weight >= 0) || !std::isfinite(given.detail_weight)) {
    fail(ErrorCode::kInvalidArgument, "options->detail_weight is " +
                                          std::to_string(given.detail_weight) +
                                          "; 0 or more is allowed");
  }
  options.sampling.detail_weight = given.detail_weight;
  options.sampling.seed = given.seed;
  if (given.harmonic_degree > static_cast<uint32_t>(kMaxViewDegree)) {
    fail(ErrorCode::kInvalidArgument, "options->harmonic_degree is " +
                                          std::to_string(given.harmonic_degree) +
                                          "; 0 to 3 is allowed");
  }
  options.sampling.harmonic_degree = static_cast<int>(given.harmonic_degree);
  return options;
}

}  // namespace

extern "C" {

void stipple_model_from_mesh_options_init(StippleModelFromMeshOptions* options) {
  if (!options) return;
  *options = {};
  options->struct_size = sizeof(StippleModelFromMeshOptions);
  options->leaf_level = static_cast<uint32_t>(kMaxLeafLevel);
  options->detail_weight = 1.0;
  options->harmonic_degree = static_cast<uint32_t>(SurfaceSamplingOptions().harmonic_degree);
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
      return makeSurfaceSplats(buildSurfaceModel(*triangles, settings, &progress));
    });
  });
}

}  // extern "C"
