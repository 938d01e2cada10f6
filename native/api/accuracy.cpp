#include <string>

#include "api/conversions.h"

using namespace stipple;
using namespace stipple::api;

extern "C" {

StippleStatus stipple_accuracy_init(uint32_t level, StippleAccuracy* accuracy) {
  return guarded([&] {
    const auto wanted = enumValue<AccuracyLevel>(level, kAccuracyLevelCount - 1, "level");
    require(accuracy, "accuracy") = accuracyTo(accuracyOf(wanted));
  });
}

StippleStatus stipple_accuracy_check(const StippleAccuracy* accuracy) {
  return guarded([&] { accuracyFrom(accuracy, "accuracy"); });
}

StippleStatus stipple_accuracy_knob_count(uint64_t* count) {
  return guarded([&] { require(count, "count") = accuracyKnobs().size(); });
}

StippleStatus stipple_accuracy_knob_info(uint64_t index, StippleAccuracyKnobInfo* info) {
  return guarded([&] {
    const size_t count = accuracyKnobs().size();
    if (index >= count) {
      fail(ErrorCode::kInvalidArgument, "index is " + std::to_string(index) + "; 0 to " +
                                            std::to_string(count - 1) + " is allowed");
    }
    const AccuracyKnob& knob = accuracyKnobs()[index];
    StippleAccuracyKnobInfo out = {};
    out.has_bound = knob.has_bound ? 1 : 0;
    out.name_utf8 = knob.name;
    out.label_utf8 = knob.label;
    out.bound_utf8 = knob.bound;
    deliver(info, out, "info");
  });
}

const char* stipple_accuracy_level_name(uint32_t level) {
  return level < kAccuracyLevelCount ? accuracyLevelName(static_cast<AccuracyLevel>(level))
                                     : nullptr;
}

const char* stipple_accuracy_verdict(double psnr) {
  return accuracyVerdict(psnr);
}

}  // extern "C"
