#pragma once

#include <string>

#include "data/clouds/splat_frame.h"
#include "io/splats/ply/ply_file.h"

namespace stipple {

/// The words of KHR_gaussian_splatting, and ours beside them.
constexpr char kGltfSplats[] = "KHR_gaussian_splatting";
/// Draft: the splats of a primitive as the bytes of an SPZ file.
constexpr char kGltfSpz[] = "KHR_gaussian_splatting_compression_spz_2";
constexpr char kGltfRotation[] = "KHR_gaussian_splatting:ROTATION";
constexpr char kGltfScale[] = "KHR_gaussian_splatting:SCALE";
constexpr char kGltfOpacity[] = "KHR_gaussian_splatting:OPACITY";
constexpr char kGltfKernel[] = "ellipse";
constexpr char kGltfProjection[] = "perspective";

/// glTF's own frame: y up, models look along z.
constexpr Frame kGltfFrame = Frame::kLUF;

/// Extras of a primitive, written where the splats are not as those of other files.
constexpr char kGltfAntialiasKey[] = "stipple_antialias";
constexpr char kGltfMip[] = "mip";
constexpr char kGltfFrameKey[] = "stipple_frame";

/// Attribute of one coefficient. In: degree; index 0..2 degree, m ascending.
inline std::string gltfHarmonic(int degree, int index) {
  return std::string(kGltfSplats) + ":SH_DEGREE_" + std::to_string(degree) + "_COEF_" +
         std::to_string(index);
}

}  // namespace stipple
