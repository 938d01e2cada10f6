#pragma once

#include <cctype>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#include "base/error.h"

namespace stipple {

/// Calls `visit` once for every instruction set that is compiled and runs on this processor, while
/// Highway dispatches to it. That is a choice of the whole process: for tests and for
/// STIPPLE_FORCE_TARGET.
void withEveryTarget(const std::function<void()>& visit);

/// `plain`, and what `dispatched` gives for every instruction set (withEveryTarget).
template <class Kernel, class Dispatched>
std::vector<Kernel> onEveryTarget(const Kernel& plain, Dispatched dispatched) {
  std::vector<Kernel> kernels = {plain};
  withEveryTarget([&] { kernels.push_back(dispatched()); });
  return kernels;
}

/// The kernel to use: `best`, or the one of `all()` whose `target` the environment variable
/// STIPPLE_FORCE_TARGET names, in upper or lower case. `all` is called only where it is set.
/// Errors: kInvalidArgument where it names none of them.
template <class Kernel>
Kernel chooseKernel(const Kernel& best, std::vector<Kernel> (*all)()) {
  const char* forced = std::getenv("STIPPLE_FORCE_TARGET");
  if (!forced || !*forced) return best;
  const auto lowerCase = [](std::string text) {
    for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return text;
  };
  std::string names;
  for (const Kernel& kernel : all()) {
    if (lowerCase(kernel.target) == lowerCase(forced)) return kernel;
    names += (names.empty() ? "" : ", ") + lowerCase(kernel.target);
  }
  fail(ErrorCode::kInvalidArgument,
       "STIPPLE_FORCE_TARGET is \"" + std::string(forced) + "\"; this machine has " + names);
}

}  // namespace stipple
