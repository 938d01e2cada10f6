#pragma once

#include <string>

#include "base/error.h"
#include "data/clouds/splat_cloud.h"
#include "data/tensor_table.h"
#include "io/bytes/safetensors.h"

namespace stipple {

// What assets of learned models have in common: named tensors of float32 behind a stem, and for
// which colours and which smoothing of edges their splats are made.

/// Refuses none at all, names without the stem, other types, and numbers that are not finite.
/// In: name of the asset in messages.
void requireNetworkTensors(const TensorTable& tensors, const std::string& stem,
                           const std::string& name, ErrorCode code);

/// All tensors whose names begin with the stem. Errors: kFormat, kIo.
TensorTable readNetworkTensors(const SafeTensorsReader& file, const std::string& stem);

/// The metadata "colour_space" and "antialias".
void setSplatFlags(SafeTensorsWriter& file, ColourSpace colour_space, Antialias antialias);
/// Errors: kFormat.
void readSplatFlags(const SafeTensorsReader& file, ColourSpace& colour_space, Antialias& antialias);

}  // namespace stipple
