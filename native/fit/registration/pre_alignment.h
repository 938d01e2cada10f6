#pragma once

#include <cstdint>
#include <span>

#include "fit/registration/registration_loss.h"
#include "fit/registration/registration_target.h"
#include "math/vec.h"

namespace stipple {

/// What is done to the whole template before its vertices move.
enum class PreAlignment : uint32_t {
  kNone = 0,        ///< it lies over the target already
  kSize = 1,        ///< the target's middle and its size
  kRigid = 2,       ///< turned and moved to the nearest points, at its own size
  kSimilarity = 3,  ///< the same, and scaled
};

/// p -> scale * turn * p + offset.
struct Similarity {
  double scale = 1;
  Mat3d turn = Mat3d::Identity();
  Vec3d offset = Vec3d::Zero();

  Vec3d operator()(const Vec3d& p) const { return scale * (turn * p) + offset; }
};

/// The similarity (with_scale) or rigid motion that brings points nearest to others, pair by pair,
/// by the sum of weighted squared distances; never a mirror. In: from, to [N]; weights [N] >= 0,
/// sum > 0. Where the pairs leave a turn open, it is the smallest. Source: Horn, Hilden,
/// Negahdaripour, Closed-form solution of absolute orientation using orthonormal matrices, JOSA A
/// 1988.
Similarity similarityOf(std::span<const Vec3d> from, std::span<const Vec3d> to,
                        std::span<const double> weights, bool with_scale);

/// Where the template goes before it is adapted. Three landmarks or more say it alone; else the
/// turn is found from nearest points, which leads to the next of the turns that fit (less than some
/// 45 degrees away). In: landmarks as of RegistrationLoss; target in the unit ball.
Similarity preAligned(std::span<const uint32_t> triangles, std::span<const Vec3d> positions,
                      const RegistrationTarget& target, std::span<const Landmark> landmarks,
                      PreAlignment alignment);

}  // namespace stipple
