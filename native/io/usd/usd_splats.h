#pragma once

#include <cstdint>
#include <string>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "io/splats/splat_format.h"

namespace stipple {

/// True for USD layers, those of the binary kind included, which readUsdSplats() refuses by name.
bool startsAsUsd(const SplatFileStart& start);
/// True for zip archives that are named .usdz.
bool startsAsUsdz(const SplatFileStart& start);

/// Reads the prims of type ParticleField3DGaussianSplat that a layer of text (.usda, .usd) or a
/// package with such a layer (.usdz) draws, placed by their transformations, as one cloud; splats
/// of a lower degree than others get zeros. Arrays at several times give those of the first.
/// Errors: kIo, kFormat (file, line or prim, attribute), kUnsupported (binary layers, references
/// that leave the file's folder).
SplatCloud readUsdSplats(const std::string& path, Progress* progress);

/// Writes a layer of text with one prim, or a package with it. Errors: kUnsupported for a cloud
/// without splats, and for packages above 4 GiB.
void writeUsdSplats(const SplatCloud& cloud, const std::string& path,
                    const SplatWriteOptions& options, Progress* progress);
double estimateUsdSplats(uint64_t count, int degree, const SplatWriteOptions& options);

}  // namespace stipple
