#pragma once

#include <memory>
#include <span>

#include "train/backend/backend_factory.h"

namespace stipple {

/// A row of the table of backends.
struct BackendKind {
  const char* name;
  std::shared_ptr<const BackendFactory> (*backends)();
};

/// All rows; the first is what is used where nobody says otherwise.
std::span<const BackendKind> backendKinds();

/// The row that the environment variable STIPPLE_BACKEND names, or the first where it is not set.
/// Errors: kInvalidArgument where it names none; those of the row.
std::shared_ptr<const BackendFactory> chosenBackends();

}  // namespace stipple
