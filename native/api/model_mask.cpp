#include "api/guard.h"
#include "api/handles.h"
#include "api/hierarchy.h"
#include "base/parallel.h"
#include "decode/tree/masked_tree.h"

using namespace stipple;
using namespace stipple::api;

extern "C" {

StippleStatus stipple_model_keep(const StippleModel* model, const uint8_t* mask,
                                 uint64_t mask_count, StippleModel** kept) {
  return guarded([&] {
    require(model, "model");
    require(mask, "mask");
    require(kept, "kept");
    const Hierarchy* hierarchy = hierarchyOf(model->parts);
    if (!hierarchy) {
      fail(ErrorCode::kUnsupported,
           "this model is that of a mesh, which has no splats to leave out; that of a cloud has");
    }
    const SplatCloud& leaves = *(*hierarchy)->leaves();
    model->context->requireMemory(2 * mergeTreeMemoryBound(leaves.size(), leaves.sh_degree),
                                  "leaving splats out of a tree");
    withThreads(model->context->thread_count, [&] {
      MaskedTree masked =
          maskedTree(leaves, *(*hierarchy)->tree(), {mask, static_cast<size_t>(mask_count)});
      *kept = new StippleModel{model->context,
                               {std::make_shared<const HierarchyDecoder>(
                                   std::make_shared<const SplatCloud>(std::move(masked.leaves)),
                                   std::make_shared<const MergeTree>(std::move(masked.tree)))}};
    });
  });
}

}  // extern "C"
