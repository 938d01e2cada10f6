#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "train/optimiser/image_loss.h"

namespace stipple {

constexpr size_t kBlurReach = 5;
constexpr size_t kBlurTaps = 2 * kBlurReach + 1;
constexpr float kSsimC1 = 0.01f * 0.01f;
constexpr float kSsimC2 = 0.03f * 0.03f;

/// exp(-k^2 / (2 * 1.5^2)) for k = -5..5, scaled to the sum 1.
constexpr std::array<float, kBlurTaps> kBlurWindow = {
    1.0283800845e-03f, 7.5987581352e-03f, 3.6000772128e-02f, 1.0936068951e-01f,
    2.1300553771e-01f, 2.6601172486e-01f, 2.1300553771e-01f, 1.0936068951e-01f,
    3.6000772128e-02f, 7.5987581352e-03f, 1.0283800845e-03f};

/// Rows that one call blurs along columns: each row that is read serves several, else reading rows
/// out of the second cache eleven times would take longer than the arithmetic.
constexpr size_t kBlockRows = 4;
constexpr size_t kBlockInputs = kBlockRows + kBlurTaps - 1;

/// Floats that a kernel may read or write past the end of a working row: a vector's width.
constexpr size_t kRowSlack = 64;

/// Pixels of one row of a picture. plane_stride: floats from channel to channel of kPlanar.
template <class Float>
struct PixelRun {
  Float* first;
  PixelLayout layout;
  size_t plane_stride;
};

/// The inner loops of the loss, along one row. Working rows are planar, followed by kRowSlack
/// floats that hold finite numbers. With p = rendered + target and d = rendered - target:
/// statistics are the blurred p, d, p^2, d^2; maps are the derivatives of a pixel's SSIM by the
/// blurred rendered colour (first) and, halved, by blurred p^2 and d^2.
struct LossKernel {
  const char* target;  ///< "scalar", or Highway's name of an instruction set ("AVX2")

  /// p and d of `count` pixels, exactly `count` written per channel. Numbers that are not finite or
  /// beyond kLargestColour count as 0. Returns whether there was none.
  bool (*readPixels)(PixelRun<const float> rendered, PixelRun<const float> target_picture,
                     size_t count, float* const sums[3], float* const differences[3]);

  /// Statistics of four rows blurred along columns, from 14 rows of p and of d: output row r is
  /// centred on input row r + 5. Out: statistics[4 * row + statistic].
  void (*blurStatistics)(const float* const* sums, const float* const* differences, size_t count,
                         float* const* statistics);

  /// Blurs the statistics along the row, output i centred on input i + 5, and evaluates SSIM: 1 -
  /// SSIM to `errors` and, unless maps[0] is null, the maps, times weights[i] where not null.
  void (*evaluateSsim)(const float* const statistics[4], const float* weights, size_t count,
                       float* errors, float* const maps[3]);

  /// Fourteen rows blurred along columns into four.
  void (*blurColumns)(const float* const* rows, size_t count, float* const* out);

  /// l1_scale w sign(d) - ssim_scale (G map0 + p G map1 + d G map2), G the blur along the row with
  /// output i centred on input i + 5. weights: null for 1.
  void (*combineGradient)(const float* const blurred_maps[3], const float* sums,
                          const float* differences, const float* weights, size_t count,
                          float l1_scale, float ssim_scale, float* out);

  /// Puts three working rows into the picture; alpha becomes 0.
  void (*writePixels)(const float* const rows[3], size_t count, PixelRun<float> out);

  /// Sum of |values[i]| weights[i] in float64; weights: null for 1.
  double (*sumMagnitudes)(const float* values, const float* weights, size_t count);
};

/// The kernel to use: the best for this processor, or what STIPPLE_FORCE_TARGET names.
LossKernel chosenLossKernel();

/// Every kernel that is compiled and runs on this processor, "scalar" first. It changes Highway's
/// global choice for a moment: for tests and for STIPPLE_FORCE_TARGET.
std::vector<LossKernel> lossKernels();

LossKernel scalarLossKernel();

}  // namespace stipple
