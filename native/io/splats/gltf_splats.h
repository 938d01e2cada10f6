#pragma once

#include <cstdint>
#include <string>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "io/splats/splat_format.h"

namespace stipple {

/// True for glTF and GLB files whose JSON names KHR_gaussian_splatting; others are meshes.
bool startsAsGltfSplats(const SplatFileStart& start);

/// Reads the splats of a glTF or GLB file's scene, placed by their nodes, as one cloud; splats of a
/// lower degree than others get zeros. Errors: kIo, kFormat (file, mesh, primitive, attribute),
/// kUnsupported (kernels, colour spaces and compression that are not known).
SplatCloud readGltfSplats(const std::string& path, Progress* progress);

/// Writes .glb, or .gltf with a .bin beside it. Renderers that do not know splats see points with
/// linear colours.
void writeGltfSplats(const SplatCloud& cloud, const std::string& path,
                     const SplatWriteOptions& options, Progress* progress);
double estimateGltfSplats(uint64_t count, int degree, const SplatWriteOptions& options);

}  // namespace stipple
