#include "nn/matrix_backend.h"

#include <cstdlib>
#include <vector>

#include "base/error.h"
#include "nn/highway_backend.h"
#include "nn/onednn_backend.h"

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

const MatrixBackend& backendOf(const NetworkRun& run) {
  return run.backend != nullptr ? *run.backend : defaultMatrixBackend();
}

FactorPrecision precisionOf(const NetworkRun& run) {
  return backendOf(run).has(run.precision) ? run.precision : FactorPrecision::kFloat32;
}

void requirePrecision(FactorPrecision precision) {
  const MatrixBackend& backend = defaultMatrixBackend();
  if (backend.has(precision)) return;
  std::string why, reason;
  if (onednnBackend(&why) == nullptr) {
    reason = "oneDNN cannot be loaded: " + why;
  } else if (&backend != onednnBackend()) {
    reason = "STIPPLE_MATRIX_BACKEND is \"" + std::string(backend.name()) +
             "\", which multiplies in float32 alone";
  } else {
    reason = "the processor does not have the instructions AVX512_BF16; oneDNN uses " +
             backend.instructionSets();
  }
  fail(ErrorCode::kUnavailable,
       "matrix products in bfloat16 are asked for and not to be had here, because " + reason);
}

std::span<const MatrixBackend* const> matrixBackends() {
  static const std::vector<const MatrixBackend*> backends = [] {
    std::vector<const MatrixBackend*> all = {&highwayBackend()};
    if (const MatrixBackend* onednn = onednnBackend()) all.push_back(onednn);
    return all;
  }();
  return backends;
}

}  // namespace stipple
