#pragma once

#include <memory>
#include <string>
#include <vector>

#include "densify/strategy.h"

namespace stipple {

/// Names that makeStrategy() knows, in the order in which they are shown.
const std::vector<std::string>& strategyNames();

/// A strategy with the settings of its publication.
/// Errors: kInvalidArgument for a name that is not there; the message says which are.
std::unique_ptr<Strategy> makeStrategy(const std::string& name);

}  // namespace stipple
