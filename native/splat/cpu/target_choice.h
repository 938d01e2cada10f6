#pragma once

#include <hwy/highway.h>
#include <strings.h>

#include <cstdlib>
#include <vector>

namespace stipple {

/// The plain code and what `dispatched` gives for every instruction set that is compiled and runs
/// on this processor. It changes Highway's global choice for a moment. Named has a member `target`.
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

/// The one of all() that STIPPLE_FORCE_TARGET names, else the best. A name that no target has is
/// refused by chosenTileKernel.
template <typename Named, typename Dispatched>
Named chosenTarget(std::vector<Named> (*all)(), Dispatched dispatched) {
  if (const char* forced = std::getenv("STIPPLE_FORCE_TARGET")) {
    for (const Named& named : all()) {
      if (strcasecmp(named.target, forced) == 0) return named;
    }
  }
  return dispatched();
}

}  // namespace stipple
