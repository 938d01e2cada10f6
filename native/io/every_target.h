#pragma once

#include <hwy/highway.h>

#include <vector>

namespace stipple {

/// The plain code and what `dispatched` gives for every instruction set that is compiled and runs
/// on this processor. It changes Highway's global choice for a moment.
template <typename Named, typename Dispatched>
std::vector<Named> onEveryTarget(const Named& scalar, Dispatched dispatched) {
  std::vector<Named> list = {scalar};
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    list.push_back(dispatched());
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  return list;
}

}  // namespace stipple
