#pragma once

#include <vector>

#include "data/clouds/splat_cloud.h"
#include "math/camera.h"

namespace stipple::testing {

/// Premultiplied colour and alpha, [height * width * 4], of a camera that sees directions, in long
/// double: the classic low-pass, the order of largest responses, nothing left out but alphas below
/// 1e-9. Every splat is met by every ray, with formulas of its own for directions, sizes and
/// responses. In: a cloud of degree 0 with nothing outside the near and the far plane.
std::vector<double> wideReference(const SplatCloud& cloud, const Camera& camera);

}  // namespace stipple::testing
