#include "densify/strategies.h"

#include <stipple/stipple.h>

#include <algorithm>
#include <string>
#include <vector>

#include "api/guard.h"
#include "api/handles.h"
#include "base/parallel.h"
#include "data/clouds/splat_quantities.h"

using namespace stipple;
using namespace stipple::api;

namespace {

void deliverEntry(const StrategyEntry& entry, StippleFitModel model, StippleStrategyInfo* info) {
  const EntryFacts& facts = *findFacts(entry.name);
  StippleStrategyInfo out = {};
  out.model = model;
  out.name_utf8 = entry.name;
  out.summary_utf8 = entry.summary;
  out.label_utf8 = entry.label;
  out.decides_utf8 = facts.decides.c_str();
  out.bit = entry.bit == kNoPartBit ? STIPPLE_NO_INDEX : entry.bit;
  out.setting_count = static_cast<uint32_t>(facts.settings.size());
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

StippleStatus stipple_strategy_setting(const char* name_utf8, uint64_t index,
                                       StippleStrategySetting* setting) {
  return guarded([&] {
    const std::string name = &require(name_utf8, "name_utf8");
    const EntryFacts* found = findFacts(name);
    if (!found) {
      fail(ErrorCode::kInvalidArgument, "name_utf8 is '" + name +
                                            "', which is no strategy and no part; "
                                            "stipple_strategy_info lists them");
    }
    const std::vector<StrategySetting>& settings = found->settings;
    if (settings.empty()) fail(ErrorCode::kInvalidArgument, name + " has no settings");
    requireIndex(index, settings.size());
    const StrategySetting& wanted = settings[static_cast<size_t>(index)];
    StippleStrategySetting out = {};
    out.is_whole = wanted.is_whole ? 1 : 0;
    out.name_utf8 = wanted.name.c_str();
    out.default_value = wanted.otherwise;
    out.minimum = wanted.least;
    out.maximum = wanted.most;
    deliver(setting, out, "setting");
  });
}

StippleStatus stipple_strategy_check(const char* strategy_utf8) {
  return guarded([&] { makeStrategy(&require(strategy_utf8, "strategy_utf8")); });
}

StippleStatus stipple_cloud_quantity(const StippleCloud* cloud, uint32_t quantity,
                                     uint64_t capacity, float* values, uint64_t* count) {
  return guarded([&] {
    require(cloud, "cloud");
    require(count, "count") = 0;
    const SplatQuantity wanted =
        enumValue<SplatQuantity>(quantity, kSplatQuantityCount - 1, "quantity");
    const size_t splats = cloud->cloud->size();
    const bool is_axis = wanted == SplatQuantity::kSplitAxis;
    const bool is_known = cloud->seen && !is_axis && cloud->seen->of(wanted).size() == splats;
    *count = is_axis ? splats * 3 : is_known ? splats : 0;
    if (!values || *count == 0) return;
    requireCapacity(*count, capacity, "floats");
    std::vector<float> axes;
    if (is_axis) {
      withThreads(cloud->context->thread_count, [&] { axes = splitAxes(*cloud->cloud); });
    }
    const std::vector<float>& found = is_axis ? axes : cloud->seen->of(wanted);
    std::copy(found.begin(), found.end(), values);
  });
}

}  // extern "C"
