#include "densify/strategies.h"

#include <stipple/stipple.h>

#include "api/guard.h"

using namespace stipple;
using namespace stipple::api;

namespace {

void deliverEntry(const StrategyEntry& entry, StippleFitModel model, StippleStrategyInfo* info) {
  StippleStrategyInfo out = {};
  out.model = model;
  out.name_utf8 = entry.name;
  out.summary_utf8 = entry.summary;
  deliver(info, out, "info");
}

void requireIndex(uint64_t index, size_t count) {
  if (index < count) return;
  fail(ErrorCode::kInvalidArgument,
       "index is " + std::to_string(index) + "; 0 to " + std::to_string(count - 1) + " is allowed");
}

}  // namespace

extern "C" {

StippleStatus stipple_strategy_count(uint64_t* count) {
  return guarded(
      [&] { require(count, "count") = strategyEntries().size() + fieldStrategyEntries().size(); });
}

StippleStatus stipple_strategy_info(uint64_t index, StippleStrategyInfo* info) {
  return guarded([&] {
    const size_t of_splats = strategyEntries().size();
    requireIndex(index, of_splats + fieldStrategyEntries().size());
    if (index < of_splats) {
      deliverEntry(strategyEntries()[index], STIPPLE_FIT_EXPLICIT, info);
    } else {
      deliverEntry(fieldStrategyEntries()[index - of_splats], STIPPLE_FIT_FIELD, info);
    }
  });
}

StippleStatus stipple_strategy_part_count(uint64_t* count) {
  return guarded([&] { require(count, "count") = partEntries().size(); });
}

StippleStatus stipple_strategy_part_info(uint64_t index, StippleStrategyInfo* info) {
  return guarded([&] {
    requireIndex(index, partEntries().size());
    deliverEntry(partEntries()[index], STIPPLE_FIT_EXPLICIT, info);
  });
}

StippleStatus stipple_strategy_check(const char* strategy_utf8) {
  return guarded([&] { makeStrategy(&require(strategy_utf8, "strategy_utf8")); });
}

}  // extern "C"
