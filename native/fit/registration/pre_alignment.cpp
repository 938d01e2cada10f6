// Based on: Horn, Hilden, Negahdaripour, Closed-form solution of absolute orientation using
// orthonormal matrices, JOSA A 1988; Besl, McKay, A Method for Registration of 3-D Shapes, PAMI
// 1992.
#include "fit/registration/pre_alignment.h"

#include <cmath>
#include <vector>

#include "math/cross_product.h"
#include "math/principal_axes.h"
#include "mesh/adapt/point_rows.h"

namespace stipple {

namespace {

constexpr int kMostRounds = 150;
constexpr double kStandsStill = 1e-6;  ///< of the unit ball: a round that moves no more is the last
constexpr size_t kPointsAtMost = 5000;
constexpr size_t kSamplesPerPoint = 4;
/// Of the covariance's trace: what no pair says anything of stays as it is.
constexpr double kOpenTurn = 1e-9;

struct Spread {
  Vec3d middle = Vec3d::Zero();
  double radius = 0;  ///< root of the mean squared distance from the middle
};

Spread spreadOf(std::span<const Vec3d> points, std::span<const double> weights) {
  Spread spread;
  double sum = 0;
  for (size_t i = 0; i < points.size(); ++i) {
    spread.middle += weights[i] * points[i];
    sum += weights[i];
  }
  spread.middle /= sum;
  double squared = 0;
  for (size_t i = 0; i < points.size(); ++i) {
    squared += weights[i] * (points[i] - spread.middle).squaredNorm();
  }
  spread.radius = std::sqrt(squared / sum);
  return spread;
}

double ratio(double above, double below) {
  return above > 0 && below > 0 ? above / below : 1.0;
}

/// Middle to middle, and with_scale size to size.
Similarity middleToMiddle(const Spread& from, const Spread& to, bool with_scale) {
  Similarity made;
  if (with_scale) made.scale = ratio(to.radius, from.radius);
  made.offset = to.middle - made.scale * from.middle;
  return made;
}

Similarity after(const Similarity& first, const Similarity& second) {
  return {second.scale * first.scale, second.turn * first.turn, second(first.offset)};
}

/// Some of the target's points, as many as a turn needs.
RegistrationTarget thinned(const RegistrationTarget& target) {
  RegistrationTarget made;
  const size_t step = (target.size() + kPointsAtMost - 1) / kPointsAtMost;
  for (size_t i = 0; i < target.size(); i += step) {
    for (size_t axis = 0; axis < 3; ++axis) made.points.push_back(target.points[i * 3 + axis]);
    made.weights.push_back(target.weights.empty() ? 1.0f : target.weights[i]);
  }
  return made;
}

std::vector<Vec3d> rowsOf(const std::vector<float>& points) {
  std::vector<Vec3d> rows;
  for (size_t i = 0; i < points.size() / 3; ++i) rows.push_back(rowOf(points, i));
  return rows;
}

}  // namespace

Similarity similarityOf(std::span<const Vec3d> from, std::span<const Vec3d> to,
                        std::span<const double> weights, bool with_scale) {
  const Spread source = spreadOf(from, weights);
  const Spread goal = spreadOf(to, weights);
  Mat3d covariance = Mat3d::Zero();
  for (size_t i = 0; i < from.size(); ++i) {
    covariance += weights[i] * (to[i] - goal.middle) * (from[i] - source.middle).transpose();
  }
  covariance += kOpenTurn * covariance.norm() * Mat3d::Identity();
  Similarity made;
  const PrincipalAxes axes = principalAxes(covariance);
  if (axes.lengths.maxCoeff() > 0) {
    made.turn = axes.axes * axes.turn.transpose();
    if (made.turn.col(0).dot(crossProduct(made.turn.col(1), made.turn.col(2))) < 0) {
      // The best of the rotations gives way along the axis that says least.
      Eigen::Index least = 0;
      axes.lengths.minCoeff(&least);
      Mat3d flipped = axes.axes;
      flipped.col(least) *= -1;
      made.turn = flipped * axes.turn.transpose();
    }
  }
  if (with_scale) made.scale = ratio(goal.radius, source.radius);
  made.offset = goal.middle - made.scale * (made.turn * source.middle);
  return made;
}

Similarity preAligned(std::span<const uint32_t> triangles, std::span<const Vec3d> positions,
                      const RegistrationTarget& target, std::span<const Landmark> landmarks,
                      PreAlignment alignment) {
  if (alignment == PreAlignment::kNone) return {};
  const bool with_scale = alignment != PreAlignment::kRigid;
  if (landmarks.size() >= 3 && alignment != PreAlignment::kSize) {
    std::vector<Vec3d> from, to;
    for (const Landmark& landmark : landmarks) {
      from.push_back(positions[landmark.vertex]);
      to.push_back(landmark.place);
    }
    return similarityOf(from, to, std::vector<double>(from.size(), 1.0), with_scale);
  }
  const RegistrationTarget few = thinned(target);
  const std::vector<Vec3d> goals = rowsOf(few.points);
  const std::vector<double> weights(few.weights.begin(), few.weights.end());
  std::vector<Vec3d> places;
  for (const SurfaceSample& sample :
       spreadSamples(triangles, positions, kPointsAtMost * kSamplesPerPoint, 0)) {
    places.push_back(sample.at(triangles, positions));
  }
  const std::vector<double> even(places.size(), 1.0);
  Similarity whole = middleToMiddle(spreadOf(places, even), spreadOf(goals, weights), with_scale);
  if (alignment == PreAlignment::kSize) return whole;
  std::vector<Vec3d> moved(positions.size());
  const RegistrationLoss loss(few, {}, {}, kSamplesPerPoint);
  for (int round = 0; round < kMostRounds; ++round) {
    for (size_t v = 0; v < moved.size(); ++v) moved[v] = whole(positions[v]);
    const RegistrationMatches matches = loss.match(triangles, moved, 0);
    std::vector<Vec3d> from;
    for (const SurfaceSample& sample : matches.of_points) {
      from.push_back(sample.at(triangles, moved));
    }
    const Similarity further = similarityOf(from, goals, weights, with_scale);
    whole = after(whole, further);
    const double change =
        (further.scale * further.turn - Mat3d::Identity()).norm() + further.offset.norm();
    if (change < kStandsStill) break;
  }
  return whole;
}

}  // namespace stipple
