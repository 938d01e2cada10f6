#include "train/backend/backend_table.h"

#include <array>
#include <cstdlib>
#include <string>

#include "base/error.h"

namespace stipple {

// The backends, each made by a function of its own file.

std::span<const BackendKind> backendKinds() {
  static const std::array kinds = {
      BackendKind{"cpu", cpuBackends},
      // Further backends go here.
  };
  return kinds;
}

std::shared_ptr<const BackendFactory> chosenBackends() {
  const char* wanted = std::getenv("STIPPLE_BACKEND");
  if (!wanted || !*wanted) return backendKinds().front().backends();
  std::string names;
  for (const BackendKind& kind : backendKinds()) {
    if (std::string(kind.name) == wanted) return kind.backends();
    names += (names.empty() ? "" : ", ") + std::string(kind.name);
  }
  fail(ErrorCode::kInvalidArgument,
       "STIPPLE_BACKEND is \"" + std::string(wanted) + "\"; this library has " + names);
}

}  // namespace stipple
