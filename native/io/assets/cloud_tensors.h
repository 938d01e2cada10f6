#pragma once

#include <string>

#include "data/clouds/splat_cloud.h"
#include "io/bytes/safetensors.h"

namespace stipple {

// A cloud of splats in an asset file, bit for bit: its numbers as tensors, and what they are said
// to be as metadata ("colour_space", "antialias", "frame", "sh_degree"), which all clouds of a file
// share.

void setCloudFlags(SafeTensorsWriter& file, const SplatCloud& cloud);
/// A cloud without splats that has the flags of the file. Errors: kFormat.
SplatCloud readCloudFlags(const SafeTensorsReader& file);

/// Tensors STEMpositions [N,3], STEMrotations [N,4], STEMscales [N,3], STEMopacities [N] and STEMsh
/// [N,(degree+1)^2*3]. In: cloud, which must live until the file is written.
void addCloudTensors(SafeTensorsWriter& file, const std::string& stem, const SplatCloud& cloud);
/// In: flags, of readCloudFlags(). Errors: kFormat; arrays may be of different lengths.
SplatCloud readCloudTensors(const SafeTensorsReader& file, const std::string& stem,
                            const SplatCloud& flags);

}  // namespace stipple
