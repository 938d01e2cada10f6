#include <unistd.h>

#include "api/guard.h"
#include "api/handles.h"

namespace stipple::api {

namespace {

/// Bytes of main memory; where the system does not tell, as many as can be named.
uint64_t machineMemory() {
  const long pages = sysconf(_SC_PHYS_PAGES);
  const long page_bytes = sysconf(_SC_PAGESIZE);
  if (pages <= 0 || page_bytes <= 0) return UINT64_MAX;
  return static_cast<uint64_t>(pages) * static_cast<uint64_t>(page_bytes);
}

}  // namespace

void ContextState::requireMemory(uint64_t bytes, const char* what) const {
  if (bytes > memory_limit_bytes) {
    fail(ErrorCode::kMemoryLimit, std::string(what) + " would need up to " + std::to_string(bytes) +
                                      " bytes; the memory limit is " +
                                      std::to_string(memory_limit_bytes));
  }
}

void ContextState::requirePictureMemory(uint64_t bytes, const std::string& what,
                                        uint64_t pair_bytes) const {
  const uint64_t machine = machineMemory();
  if (bytes <= std::min(machine, memory_limit_bytes)) return;
  const std::string allowed = memory_limit_bytes <= machine
                                  ? "the memory limit is " + std::to_string(memory_limit_bytes)
                                  : "this machine has " + std::to_string(machine);
  fail(ErrorCode::kMemoryLimit, what + " would need up to " + std::to_string(bytes) + " bytes, " +
                                    std::to_string(pair_bytes) +
                                    " of them for pairs of splat and tile; " + allowed);
}

}  // namespace stipple::api

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
      stipple::fail(stipple::ErrorCode::kInvalidArgument, "options->thread_count is " +
                                                              std::to_string(given.thread_count) +
                                                              "; 0 (all) to 1024 is allowed");
    }
    auto state = std::make_shared<ContextState>();
    state->thread_count = given.thread_count;
    if (given.memory_limit_bytes != 0) state->memory_limit_bytes = given.memory_limit_bytes;
    *context = new StippleContext{std::move(state)};
  });
}

void stipple_context_free(StippleContext* context) {
  delete context;
}

}  // extern "C"
