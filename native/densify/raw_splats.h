#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "data/clouds/splat_cloud.h"

namespace stipple {

/// Splats as training moves them: any number is allowed. Linear scale = exp(log scale), opacity =
/// 1 / (1 + exp(-logit)); quaternions need not be unit. The same struct holds moments and
/// derivatives.
struct RawSplats {
  std::vector<float> positions;   ///< [N,3] metres
  std::vector<float> rotations;   ///< [N,4] w,x,y,z, not zero
  std::vector<float> log_scales;  ///< [N,3] natural logarithm of metres
  std::vector<float> logits;      ///< [N]
  std::vector<float> sh;          ///< [N,(degree+1)^2,3]
  /// Numbers that a strategy trains beside them, one array per parameter: [N, extra_lengths[k]].
  std::vector<std::vector<float>> extras;
  std::vector<size_t> extra_lengths;
  int sh_degree = 0;
  ColourSpace colour_space = ColourSpace::kDisplay;
  Antialias antialias = Antialias::kClassic;

  size_t size() const { return logits.size(); }
  size_t shStride() const { return shCoefficientCount(sh_degree) * 3; }
  void resize(size_t count);  ///< new numbers are 0
};

/// An array of RawSplats; those of extras follow, see extraArray().
enum class RawArray : uint32_t {
  kPositions = 0,
  kRotations = 1,
  kLogScales = 2,
  kLogits = 3,
  kSh = 4,
};
constexpr size_t kRawArrayCount = 5;  ///< without extras

constexpr RawArray extraArray(size_t extra) {
  return static_cast<RawArray>(kRawArrayCount + extra);
}
inline size_t arrayCount(const RawSplats& splats) {
  return kRawArrayCount + splats.extra_lengths.size();
}

std::vector<float>& arrayOf(RawSplats& splats, RawArray array);
const std::vector<float>& arrayOf(const RawSplats& splats, RawArray array);

/// Numbers of one splat in an array.
size_t rowLength(const RawSplats& splats, RawArray array);

/// As many splats of the same kind, every number 0.
RawSplats zerosLike(const RawSplats& splats);

/// Splats of these rows, in this order.
RawSplats rowsOf(const RawSplats& splats, const std::vector<uint32_t>& rows);

/// Ends of what rawSplats() can take: a scale of 0 and an opacity of 0 or 1 have no finite raw
/// number.
constexpr float kLeastRawScale = 1e-30f;   ///< metres
constexpr float kLeastRawOpacity = 1e-6f;  ///< and 1 minus it is the largest
constexpr float kLargestLogScale = 88.0f;  ///< its exponential is finite; larger ones count as this
float activatedScale(float log_scale);
float activatedOpacity(float logit);
float rawScale(float scale);
float rawOpacity(float opacity);

/// Stored splats to raw numbers. Scales and opacities are held to the ends above.
RawSplats rawSplats(const SplatCloud& cloud);

/// The other way round; quaternions stay as they are.
SplatCloud activated(const RawSplats& splats);

}  // namespace stipple
