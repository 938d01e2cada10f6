#include "api/guard.h"
#include "api/handles.h"
#include "base/parallel.h"

using namespace stipple;
using namespace stipple::api;

extern "C" {

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
