#include "api/guard.h"
#include "api/handles.h"

using namespace stipple;
using namespace stipple::api;

extern "C" {

void stipple_context_options_init(StippleContextOptions* options) {
  if (options) *options = StippleContextOptions{sizeof(StippleContextOptions), 0, 0};
}

StippleStatus stipple_context_create(const StippleContextOptions* options,
                                     StippleContext** context) {
  return guarded([&] {
    require(context, "context");
    StippleContextOptions defaults;
    stipple_context_options_init(&defaults);
    const StippleContextOptions given = completed(options, defaults, "options");
    if (given.thread_count > 1024) {
      fail(ErrorCode::kInvalidArgument, "options->thread_count is " +
                                            std::to_string(given.thread_count) +
                                            "; 0 (all) to 1024 is allowed");
    }
    auto state = std::make_shared<ContextState>();
    state->thread_count = given.thread_count;
    state->memory_limit_bytes =
        given.memory_limit_bytes != 0 ? given.memory_limit_bytes : MemoryLimit::ofThisMachine();
    *context = new StippleContext{std::move(state)};
  });
}

StippleStatus stipple_context_set_weights_folder(StippleContext* context, const char* folder_utf8) {
  return guarded([&] {
    stipple::WeightsPlace& weights = *require(context, "context").state->weights;
    if (folder_utf8 != nullptr) {
      weights.set(folder_utf8);
    } else {
      weights.setByEnvironment();
    }
  });
}

StippleStatus stipple_context_set_shipped_weights_folder(StippleContext* context,
                                                         const char* folder_utf8) {
  return guarded([&] {
    stipple::WeightsPlace& weights = *require(context, "context").state->weights;
    weights.setShipped(folder_utf8 != nullptr ? folder_utf8 : "");
  });
}

StippleStatus stipple_context_memory_limit(const StippleContext* context, uint64_t* bytes) {
  return guarded([&] {
    const uint64_t limit = require(context, "context").state->memory_limit_bytes;
    require(bytes, "bytes") = limit;
  });
}

void stipple_context_free(StippleContext* context) {
  delete context;
}

}  // extern "C"
