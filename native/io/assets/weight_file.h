#pragma once

#include <string>

#include "data/weight_table.h"

namespace stipple {

/// Maps a safetensors file of a network's weights into memory; nothing is read before it is used.
/// Errors: kIo; kFormat for a file that is not one, or whose tensors lie outside it or on each
/// other.
WeightTable openWeightFile(const std::string& path);

}  // namespace stipple
