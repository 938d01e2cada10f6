#pragma once

#include <span>
#include <string>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "io/splats/splat_format.h"
#include "math/vec.h"

namespace stipple {

/// Splats where an object has them.
struct UsdObject {
  std::string name;  ///< UTF-8; any
  const SplatCloud* cloud = nullptr;
  Mat4d matrix = Mat4d::Identity();  ///< from the cloud to the scene
};

/// Writes objects as a layer of text, or a package with it: a prim for each, with its name and its
/// transformation. Splats that several objects show, the same cloud or clouds that are alike to the
/// bit, are written once, and the objects are instances of them. In: objects, at least one; frame
/// that the matrices lead to, unknown: kConventionalFrame; options as of writeSplatFile, whose
/// frame is that of the scene: splats keep their own numbers. Errors: kInvalidArgument for no
/// objects, clouds that validate() refuses and matrices that are not affine or singular;
/// kUnsupported for clouds without splats, of several colour spaces or low-pass filters, other
/// formats' paths, packages above 4 GiB; kIo.
void writeUsdScene(std::span<const UsdObject> objects, Frame frame, const std::string& path,
                   const SplatWriteOptions& options, Progress* progress = nullptr);

}  // namespace stipple
