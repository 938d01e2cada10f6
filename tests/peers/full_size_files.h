#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "data/weight_table.h"
#include "generate/encoder_shapes.h"

namespace stipple {

uint64_t countOf(const std::vector<uint64_t>& shape);

/// The numbers of a network that nobody trained, in a safetensors file: seeded, and scaled so that
/// what a network computes keeps its usual size: sums of layers about as large as what goes in,
/// factors of norms near 1, variances near 1, everything else small.
/// In: type: float32, float16 or bfloat16. Errors: kIo.
void writeWeights(const std::string& path, const WeightShapes& shapes, WeightType type);

/// The same names and shapes in memory, of float16, where all tensors share the same few megabytes.
WeightTable sharedWeights(const WeightShapes& shapes);
/// Likewise, each tensor at its own place: no cache has them all, as it has none of a file.
WeightTable ownWeights(const WeightShapes& shapes);

// The four files, in the types of the published ones. Each returns the path of one that is in the
// folder, and writes it where it is missing or of another size.
std::string structureFileIn(const std::string& folder);
std::string colourFileIn(const std::string& folder);
std::string flowFileIn(const std::string& folder);
std::string decoderFileIn(const std::string& folder);

}  // namespace stipple
