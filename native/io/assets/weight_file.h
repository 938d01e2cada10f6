#pragma once

#include <map>
#include <string>

#include "data/weight_table.h"

namespace stipple {

/// Maps a safetensors file of a network's weights into memory; nothing is read before it is used.
/// Errors: kIo; kFormat for a file that is not one, or whose tensors lie outside it or on each
/// other. Out: metadata: the texts that the file carries, where they are wanted.
WeightTable openWeightFile(const std::string& path,
                           std::map<std::string, std::string>* metadata = nullptr);

}  // namespace stipple
