#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace stipple {

/// Sines and cosines of positions, added to tokens by networks of density-sampled Gaussians
/// (arXiv 2605.16355 and its released code). F = width / 6 frequencies; for each of three axes
/// after the other F sines, then F cosines; and zeros up to the width.
enum class PositionEncoding {
  /// sin((x f) pi) in float32, f = 2^(10 i / (F - 1)) with exponents in the float32 of
  /// torch.linspace, which the highest frequencies show: octree and Gaussian decoders, encoder.
  kGeometric,
  kPowers,  ///< sin(((x f) 2) pi) in float32, f = 2^e, e = 0..15 and F - 16 more, 16 k / (F - 16)
            ///< for k = 0...: the flow network
};
/// out[r, i] += encoding of points[r]. In: points [rows, 3].
void addPositions(PositionEncoding encoding, size_t rows, size_t width, const float* points,
                  float* out);

/// [cos(t w_i), sin(t w_i)], w_i = exp(-ln(longest) i / (width / 2)), with angles in float32
/// as the released networks compute them.
/// In: t, times 2 pi already where the network asks for it; width, even.
std::vector<float> timeEncoding(double t, double longest, size_t width);

/// Angles of a rotation of pairs of channels: [rows, pairs] cosines and sines.
struct RotaryTable {
  size_t pairs = 0;
  std::vector<float> cosines, sines;
};
/// Rotates the pairs (i, i + head_width / 2) of each head: DINOv3. In: table of as many rows, the
/// same for all heads.
void rotateHalves(const RotaryTable& table, size_t rows, size_t heads, size_t head_width,
                  float* values, size_t row_stride);
/// Rotates the pairs (2 i, 2 i + 1): the flow network. In: table [rows, heads * head_width / 2].
void rotateAdjacent(const RotaryTable& table, size_t rows, size_t heads, size_t head_width,
                    float* values, size_t row_stride);

}  // namespace stipple
