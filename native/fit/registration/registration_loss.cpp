// Based on: Jung, Kim et al., Mesh Density Adaptation for Template-based Shape Reconstruction,
// SIGGRAPH 2023, the registration of its released code. Differs: the samples are stratified over
// the area; points may have weights and normals without a sign; there may be a term from the
// template to the target.
#include "fit/registration/registration_loss.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/parallel.h"
#include "mesh/adapt/point_rows.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1024;
/// Of the mean area of a triangle: smaller ones turn no faster. One sliver would else take the
/// step of all, since the optimiser divides by the largest derivative.
constexpr double kAreaFloor = 0.01;

/// Derivatives by the three corners of a triangle.
using ByCorners = std::array<Vec3d, 3>;

double meanArea(std::span<const uint32_t> triangles, std::span<const Vec3d> positions) {
  double sum = 0;
  const size_t count = triangles.size() / 3;
  for (size_t t = 0; t < count; ++t) {
    sum += areaVector(triangles, positions, static_cast<uint32_t>(t)).norm();
  }
  return sum / static_cast<double>(count);
}

/// Adds in the order of the samples, whatever thread made them.
double gathered(std::span<const uint32_t> triangles, std::span<const SurfaceSample> samples,
                std::span<const ByCorners> parts, std::span<const double> losses,
                std::span<Vec3d> gradient) {
  double loss = 0;
  for (size_t i = 0; i < samples.size(); ++i) {
    const uint32_t* corner = &triangles[size_t{samples[i].triangle} * 3];
    for (size_t c = 0; c < 3; ++c) gradient[corner[c]] += parts[i][c];
    loss += losses[i];
  }
  return loss;
}

}  // namespace

std::vector<Landmark> landmarksOf(std::span<const uint32_t> vertices,
                                  std::span<const float> places) {
  std::vector<Landmark> landmarks;
  for (size_t i = 0; i < vertices.size(); ++i) {
    landmarks.push_back({vertices[i], rowOf(places, i)});
  }
  return landmarks;
}

RegistrationLoss::RegistrationLoss(RegistrationTarget target, std::vector<Landmark> landmarks,
                                   const RegistrationWeights& weights, size_t per_point)
    : target_(std::move(target)),
      landmarks_(std::move(landmarks)),
      weights_(weights),
      per_point_(per_point) {
  for (size_t i = 0; i < target_.size(); ++i) {
    weight_sum_ += target_.weights.empty() ? 1.0 : static_cast<double>(target_.weights[i]);
  }
  if (weights.symmetric > 0) {
    nearest_target_ = std::make_unique<const NearestPoints>(target_.points);
  }
}

Vec3d RegistrationLoss::point(size_t i) const {
  return rowOf(target_.points, i);
}

Vec3d RegistrationLoss::normal(size_t i) const {
  if (target_.normals.empty()) return Vec3d::Zero();
  return rowOf(target_.normals, i);
}

double RegistrationLoss::weight(size_t i) const {
  return (target_.weights.empty() ? 1.0 : static_cast<double>(target_.weights[i])) / weight_sum_;
}

RegistrationMatches RegistrationLoss::match(std::span<const uint32_t> triangles,
                                            std::span<const Vec3d> positions, uint64_t seed) const {
  const std::vector<SurfaceSample> samples =
      spreadSamples(triangles, positions, target_.size() * per_point_, seed);
  std::vector<float> places(samples.size() * 3);
  parallelFor(samples.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      setRow(places, i, samples[i].at(triangles, positions));
    }
  });
  RegistrationMatches matches;
  if (samples.empty()) return matches;
  const NearestPoints nearest(places);
  matches.of_points.resize(target_.size());
  parallelFor(target_.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      matches.of_points[i] = samples[nearest.nearest(point(i))];
    }
  });
  if (!nearest_target_) return matches;
  for (size_t i = 0; i < samples.size(); i += per_point_) matches.samples.push_back(samples[i]);
  matches.nearest.resize(matches.samples.size());
  parallelFor(matches.samples.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      matches.nearest[i] = nearest_target_->nearest(matches.samples[i].at(triangles, positions));
    }
  });
  return matches;
}

double RegistrationLoss::addPoints(std::span<const uint32_t> triangles,
                                   std::span<const Vec3d> positions,
                                   const RegistrationMatches& matches,
                                   std::span<Vec3d> gradient) const {
  const double floor = kAreaFloor * meanArea(triangles, positions);
  const std::vector<SurfaceSample>& samples = matches.of_points;
  std::vector<ByCorners> parts(samples.size());
  std::vector<double> losses(samples.size());
  parallelFor(samples.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const SurfaceSample& sample = samples[i];
      const Vec3d apart = sample.at(triangles, positions) - point(i);
      const double by_distance = weights_.position * weight(i);
      for (size_t c = 0; c < 3; ++c) parts[i][c] = 2 * by_distance * sample.weights[c] * apart;
      losses[i] = by_distance * apart.squaredNorm();
      const Vec3d aim = normal(i);
      const Vec3d across = areaVector(triangles, positions, sample.triangle);
      const double by_normal = weights_.normal * weight(i);
      if (by_normal == 0 || aim.isZero(0) || !(across.norm() > 0)) continue;
      const double cosine = aim.dot(across.normalized());
      const double sign = !target_.is_oriented && cosine < 0 ? -1 : 1;
      losses[i] += by_normal * (aim.norm() - sign * cosine);
      const ByCorners turn =
          normalGradient(triangles, positions, sample.triangle, -by_normal * sign * aim, floor);
      for (size_t c = 0; c < 3; ++c) parts[i][c] += turn[c];
    }
  });
  return gathered(triangles, samples, parts, losses, gradient);
}

double RegistrationLoss::addWayBack(std::span<const uint32_t> triangles,
                                    std::span<const Vec3d> positions,
                                    const RegistrationMatches& matches,
                                    std::span<Vec3d> gradient) const {
  const std::vector<SurfaceSample>& samples = matches.samples;
  std::vector<ByCorners> parts(samples.size());
  std::vector<double> losses(samples.size());
  const double factor = weights_.symmetric / static_cast<double>(samples.size());
  parallelFor(samples.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const Vec3d apart = samples[i].at(triangles, positions) - point(matches.nearest[i]);
      for (size_t c = 0; c < 3; ++c) parts[i][c] = 2 * factor * samples[i].weights[c] * apart;
      losses[i] = factor * apart.squaredNorm();
    }
  });
  return gathered(triangles, samples, parts, losses, gradient);
}

double RegistrationLoss::addLandmarks(std::span<const Vec3d> positions,
                                      std::span<Vec3d> gradient) const {
  const double factor = weights_.landmark / static_cast<double>(landmarks_.size());
  double loss = 0;
  for (const Landmark& landmark : landmarks_) {
    const Vec3d apart = positions[landmark.vertex] - landmark.place;
    gradient[landmark.vertex] += 2 * factor * apart;
    loss += factor * apart.squaredNorm();
  }
  return loss;
}

double RegistrationLoss::addGradient(std::span<const uint32_t> triangles,
                                     std::span<const Vec3d> positions,
                                     const RegistrationMatches& matches,
                                     std::span<Vec3d> gradient) const {
  double loss = addPoints(triangles, positions, matches, gradient);
  if (!matches.samples.empty()) loss += addWayBack(triangles, positions, matches, gradient);
  if (!landmarks_.empty()) loss += addLandmarks(positions, gradient);
  return loss;
}

}  // namespace stipple
