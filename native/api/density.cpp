#include "api/guard.h"
#include "api/handles.h"
#include "base/parallel.h"
#include "density/anchor_sampling.h"
#include "density/octree_density.h"

using namespace stipple;
using namespace stipple::api;

namespace {

template <typename Values, typename T>
void copyTo(const Values& values, T* out) {
  if (out && !values.empty()) std::memcpy(out, values.data(), values.size() * sizeof(T));
}

}  // namespace

extern "C" {

void stipple_sample_options_init(StippleSampleOptions* options) {
  if (!options) return;
  *options = {};
  options->struct_size = sizeof(StippleSampleOptions);
  options->order = STIPPLE_ORDER_SYSTEMATIC;
  options->count = 1000;
}

StippleStatus stipple_density_from_points(StippleContext* context, const float* positions,
                                          const float* weights, uint64_t count, uint32_t leaf_level,
                                          StippleDensity** density) {
  return guarded([&] {
    require(context, "context");
    require(positions, "positions");
    require(density, "density");
    if (leaf_level < 1 || leaf_level > static_cast<uint32_t>(kMaxLeafLevel)) {
      fail(ErrorCode::kInvalidArgument,
           "leaf_level is " + std::to_string(leaf_level) + "; 1 to 10 is allowed");
    }
    OctreeDensityOptions options;
    options.leaf_level = static_cast<int>(leaf_level);
    const std::vector<float> ones(weights ? 0 : count, 1.0f);
    withThreads(context->state->thread_count, [&] {
      auto made = OctreeDensity::fromPoints({positions, count * 3},
                                            {weights ? weights : ones.data(), count}, options);
      *density = new StippleDensity{context->state,
                                    std::make_shared<const OctreeDensity>(std::move(made))};
    });
  });
}

void stipple_density_free(StippleDensity* density) {
  delete density;
}

StippleStatus stipple_density_info(const StippleDensity* density, StippleDensityInfo* info) {
  return guarded([&] {
    const DensityModel& model = *require(density, "density").density;
    StippleDensityInfo out = {};
    out.leaf_level = static_cast<uint32_t>(model.leafLevel());
    out.leaf_count = model.leafCount();
    std::copy(model.root().origin.begin(), model.root().origin.end(), out.root_origin);
    out.root_side = model.root().side;
    deliver(info, out, "info");
  });
}

StippleStatus stipple_density_sample(const StippleDensity* density,
                                     const StippleSampleOptions* options,
                                     const StippleAnchorBuffers* buffers) {
  return guarded([&] {
    require(density, "density");
    StippleSampleOptions defaults;
    stipple_sample_options_init(&defaults);
    const StippleSampleOptions given = completed(options, defaults, "options");
    const StippleAnchorBuffers out = complete(buffers, "buffers");
    AnchorSamplingOptions sampling;
    sampling.count = given.count;
    sampling.order = enumValue<AnchorOrder>(given.order, 1, "options->order");
    sampling.seed = given.seed;
    sampling.with_ranks = out.ranks != nullptr;
    density->context->requireBudget(given.count, "anchors", [&](uint64_t count) {
      return sampleMemoryBound(count, sampling.with_ranks);
    });
    withThreads(density->context->thread_count, [&] {
      const AnchorSet anchors = sampleAnchors(*density->density, sampling);
      if (out.positions) anchorPositions(anchors, density->density->root(), out.positions);
      copyTo(anchors.log_q, out.log_q);
      copyTo(anchors.leaves, out.leaves);
      copyTo(anchors.ranks, out.ranks);
    });
  });
}

}  // extern "C"
