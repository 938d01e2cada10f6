#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "fit/registration/registration_target.h"
#include "math/vec.h"
#include "mesh/adapt/moving_samples.h"
#include "mesh/adapt/nearest_points.h"

namespace stipple {

/// A vertex of the template that belongs at a place of the target.
struct Landmark {
  uint32_t vertex = 0;
  Vec3d place = Vec3d::Zero();  ///< metres
};

/// In: vertices [L], places [L,3].
std::vector<Landmark> landmarksOf(std::span<const uint32_t> vertices,
                                  std::span<const float> places);

struct RegistrationWeights {
  double position = 1;   ///< of the mean squared distance, in the target's unit ball
  double normal = 1;     ///< of the mean of 1 - cosine between normals
  double landmark = 1;   ///< of the mean squared distance of landmarks
  double symmetric = 0;  ///< of the mean squared distance from the template to the target
};

/// Which samples of the template meet which points of the target. What is matched stays matched in
/// the derivatives.
struct RegistrationMatches {
  std::vector<SurfaceSample> of_points;  ///< [N] the sample nearest to each point of the target
  std::vector<SurfaceSample> samples;    ///< of the template, for the way back; empty without it
  std::vector<uint32_t> nearest;         ///< of each of them, the nearest point of the target
};

/// How far a template is from its target, and how that falls: of every point of the target the
/// nearest of many samples of the template, and with `symmetric` the other way round. Source: the
/// registration of Jung, Kim et al., Mesh Density Adaptation for Template-based Shape
/// Reconstruction, SIGGRAPH 2023.
class RegistrationLoss {
 public:
  /// In: target in the unit ball, N > 0; landmarks' places in it too, of vertices below those of
  /// the positions below. Takes per_point samples of the template for every point.
  RegistrationLoss(RegistrationTarget target, std::vector<Landmark> landmarks,
                   const RegistrationWeights& weights, size_t per_point);

  /// In: triangles [F,3], positions [n] with an area above 0; seed: of the samples.
  /// Threads and determinism: parallel; same result for any number of threads.
  /// Cost: a k-d tree of all samples, one query for each point.
  RegistrationMatches match(std::span<const uint32_t> triangles, std::span<const Vec3d> positions,
                            uint64_t seed) const;

  /// The loss of such matches; adds its derivatives by the positions to gradient [n]. The area that
  /// normalGradient() has for its floor is a hundredth of the mean.
  double addGradient(std::span<const uint32_t> triangles, std::span<const Vec3d> positions,
                     const RegistrationMatches& matches, std::span<Vec3d> gradient) const;

 private:
  Vec3d point(size_t i) const;
  Vec3d normal(size_t i) const;
  double weight(size_t i) const;
  double addPoints(std::span<const uint32_t> triangles, std::span<const Vec3d> positions,
                   const RegistrationMatches& matches, std::span<Vec3d> gradient) const;
  double addWayBack(std::span<const uint32_t> triangles, std::span<const Vec3d> positions,
                    const RegistrationMatches& matches, std::span<Vec3d> gradient) const;
  double addLandmarks(std::span<const Vec3d> positions, std::span<Vec3d> gradient) const;

  RegistrationTarget target_;
  std::vector<Landmark> landmarks_;
  RegistrationWeights weights_;
  size_t per_point_;
  double weight_sum_ = 0;
  std::unique_ptr<const NearestPoints> nearest_target_;  ///< null without the way back
};

}  // namespace stipple
