#pragma once

namespace stipple {

/// Logit of `factor` times the opacity of this logit, 0 < factor <= 1. No digits are lost near
/// opacities of 0 and 1, where logistic and logarithm one after the other lose all.
float scaledOpacityLogit(float logit, double factor);

/// Logit of the opacity o' of which two layers are as opaque as one of opacity o, (1 - o')^2 =
/// 1 - o. Finite for every finite logit.
float sharedOpacityLogit(float logit);

}  // namespace stipple
