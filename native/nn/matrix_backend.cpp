#include "nn/matrix_backend.h"

#include <cstdlib>
#include <vector>

#include "base/error.h"
#include "nn/highway_backend.h"

namespace stipple {

namespace {

const MatrixBackend& chooseBackend() {
  const std::span<const MatrixBackend* const> backends = matrixBackends();
  const char* asked = std::getenv("STIPPLE_MATRIX_BACKEND");
  if (asked == nullptr || *asked == '\0') return *backends.back();
  std::string names;
  for (const MatrixBackend* backend : backends) {
    if (std::string(asked) == backend->name()) return *backend;
    names += (names.empty() ? "" : ", ") + std::string(backend->name());
  }
  fail(ErrorCode::kInvalidArgument,
       "STIPPLE_MATRIX_BACKEND is \"" + std::string(asked) + "\"; this machine has " + names);
}

}  // namespace

const MatrixBackend& defaultMatrixBackend() {
  static const MatrixBackend& backend = chooseBackend();
  return backend;
}

std::span<const MatrixBackend* const> matrixBackends() {
  static const std::vector<const MatrixBackend*> backends = [] {
    return std::vector<const MatrixBackend*>{&highwayBackend()};
  }();
  return backends;
}

}  // namespace stipple
