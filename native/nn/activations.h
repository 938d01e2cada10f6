#pragma once

#include <cstddef>
#include <span>

namespace stipple {

/// In place, in parallel; float32 with errors of at most 4 ulp of the result or 1e-7, whichever is
/// greater.
enum class Activation { kSilu, kRelu, kGeluTanh, kGeluErf };
void activate(Activation activation, std::span<float> values);

/// gradient[i] *= the derivative of the activation at in[i], in parallel; the derivative is within
/// 2e-6 of the exact one, and that of ReLU at 0 is 0. In: in, what was activated [as gradient].
void activateBackward(Activation activation, std::span<const float> in, std::span<float> gradient);

/// out[i] = silu(gate[i]) * up[i]; out may be either.
void siluGate(size_t count, const float* gate, const float* up, float* out);

/// x[r, i] += factor[i] * y[r, i]; factor [width], or empty for 1.
void addScaled(size_t rows, size_t width, std::span<const float> factor, const float* y, float* x);

}  // namespace stipple
