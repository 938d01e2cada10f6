#include "decode/tree/moving_node.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "math/principal_axes.h"
#include "math/quaternion.h"

namespace stipple {

namespace {

/// Samples of a path where it changes its moment: four for each wave of the highest harmonic, and
/// as many again for the bends at the ends of both windows.
constexpr size_t kPathSamples = 32;
/// Below this square of its length a quaternion has no direction.
constexpr double kNoTurn = kNoRotation * kNoRotation;
/// Largest number of a path and largest sum of variances, in units of the tree: squares and sums
/// stay in the range of float32.
constexpr double kFarthestPath = 1e17;
constexpr double kLargestShape = 1e34;
constexpr double kWidestFootprint = 1e30;

using Quaternion = std::array<double, 4>;

Quaternion product(const Quaternion& a, const Quaternion& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
          a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
          a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

/// Cosines and sines of the harmonics at an offset, beside the constant 1.
std::array<double, kPathRows> pathBasis(double offset) {
  std::array<double, kPathRows> basis;
  const auto [cosine, sine] = harmonicWave(1, offset, 0.0);
  basis[0] = 1;
  basis[1] = cosine;
  basis[2] = sine;
  for (size_t k = 2; k <= kMotionHarmonics; ++k) {
    basis[2 * k - 1] = cosine * basis[2 * k - 3] - sine * basis[2 * k - 2];
    basis[2 * k] = sine * basis[2 * k - 3] + cosine * basis[2 * k - 2];
  }
  return basis;
}

std::array<double, 3> placeOf(const MotionPath& path, const std::array<double, kPathRows>& basis) {
  std::array<double, 3> place = {};
  for (size_t row = 0; row < kPathRows; ++row) {
    for (size_t axis = 0; axis < 3; ++axis) place[axis] += basis[row] * path[row][axis];
  }
  return place;
}

/// The time of an offset: the inverse of stretchedOffset().
double timeOfOffset(const TimeWindow& window, double offset, double centre) {
  if (window.half <= 0) return centre + offset;
  const double whole = 2 * window.half;
  const double begin = std::clamp(centre - window.half, 0.0, 1 - whole);
  const double passed = offset - stretchedOffset(window, 0.0, centre);
  const double before = begin * window.far;
  const double inside = whole * window.near;
  if (passed <= before) return passed / window.far;
  if (passed <= before + inside) return begin + (passed - before) / window.near;
  return begin + whole + (passed - before - inside) / window.far;
}

}  // namespace

MovingScale movingScale(const MergeScale& space, const MotionClip& clip, size_t times) {
  MovingScale scale;
  scale.space = space;
  // Through a low-pass so wide everything looks alike; areas stay in the range of float32.
  scale.space.footprint = std::min(space.footprint, kWidestFootprint);
  scale.window = clip.window();
  const double frames = clip.frame_count;
  scale.times = std::min<size_t>({times, clip.frame_count, kMostMergeTimes});
  scale.stride = (scale.times + kMergeTimeGroup - 1) / kMergeTimeGroup * kMergeTimeGroup;
  const auto count = static_cast<double>(scale.times);
  for (size_t i = 0; i < scale.stride; ++i) {
    const auto part = static_cast<double>(std::min(i, scale.times - 1));
    // A frame is the middle of its own part of the clip, which begins half a frame before the
    // first.
    scale.parts[i] = std::max((part + 0.5) / count - 0.5 / frames, 0.0);
    scale.weights[i] = i < scale.times ? 1 / count : 0;
  }
  // The mean of a Gaussian over a part of the clip is about one of the variance of both, h^2 / 3 of
  // the part's half h; of frames the one in the middle is seen.
  const double half = 0.5 * scale.window.near / count, frame = 0.5 * scale.window.near / frames;
  scale.broadening = std::max(half * half - frame * frame, 0.0) * 2 / 3;
  scale.shortest_life = frame;
  return scale;
}

BroadLife broadLife(const std::array<double, 2>& lifespans, const MovingScale& scale) {
  BroadLife life;
  double own = 0, broad = 0;
  for (size_t side = 0; side < 2; ++side) {
    const double length = std::max(lifespans[side], scale.shortest_life);
    const double squared = length * length + scale.broadening;
    life.rates[side] = 1 / squared;
    own += length;
    broad += std::sqrt(squared);
  }
  life.share = own / broad;
  return life;
}

std::array<double, 2> lifespansOfRates(const std::array<double, 2>& rates,
                                       const MovingScale& scale) {
  std::array<double, 2> lifespans;
  for (size_t side = 0; side < 2; ++side) {
    const double squared = std::max(1 / rates[side] - scale.broadening, 0.0);
    const double least = std::clamp(scale.shortest_life, kSmallestLifespan, kLargestLifespan);
    lifespans[side] = std::clamp(std::sqrt(squared), least, kLargestLifespan);
  }
  return lifespans;
}

std::array<double, 4> turnAbout(const MovingNode& node, double centre, const MovingScale& scale) {
  if (node.centre == centre || node.turn == Quaternion{}) return node.turn;
  const double apart = stretchedOffset(scale.window, centre, node.centre);
  Quaternion back;  // of the turn at the other moment, conjugated
  double squared = 0;
  for (size_t i = 0; i < 4; ++i) {
    const double value = (i == 0 ? 1.0 : 0.0) + apart * node.turn[i];
    squared += value * value;
    back[i] = i == 0 ? value : -value;
  }
  if (!(squared > kNoTurn)) return {};
  double mixed = 0, own = 0;
  for (size_t i = 0; i < scale.stride; ++i) {
    const double offset = stretchedOffset(scale.window, scale.parts[i], centre);
    const double other = stretchedOffset(scale.window, scale.parts[i], node.centre) - apart;
    mixed += scale.weights[i] * offset * other;
    own += scale.weights[i] * offset * offset;
  }
  Quaternion turn = product(node.turn, back);
  for (double& value : turn) value *= own > 0 ? mixed / own / squared : 0;
  return turn;
}

MovingNode movingLeaf(const MotionCloud& moving, size_t index, double visibility,
                      const MotionPath& path, const MovingScale& scale, float* samples) {
  MergeNode still = leafNode(moving.splats, index, visibility, scale.space);
  MovingNode node;
  node.colour = still.colour;
  node.visibility = still.visibility;
  node.contrast = still.contrast;
  node.centre = static_cast<double>(moving.centres[index]);
  // What is so large leaves every image.
  const double size = still.covariance[0] + still.covariance[3] + still.covariance[5];
  const double fit = size > kLargestShape ? kLargestShape / size : 1;
  for (size_t k = 0; k < 6; ++k) node.shape[k] = fit * still.covariance[k];
  const float* rotation = &moving.splats.rotations[4 * index];
  const float* spin = &moving.spins[4 * index];
  Quaternion back, speed;
  double squared = 0;
  for (size_t i = 0; i < 4; ++i) {
    const auto value = static_cast<double>(rotation[i]);
    squared += value * value;
    back[i] = i == 0 ? value : -value;
    speed[i] = static_cast<double>(spin[i]);
  }
  if (squared > kNoTurn) {
    node.turn = product(speed, back);
    for (double& value : node.turn) value /= squared;
  }
  const BroadLife life = broadLife({static_cast<double>(moving.lifespans[2 * index]),
                                    static_cast<double>(moving.lifespans[2 * index + 1])},
                                   scale);
  node.rates = life.rates;
  node.peak = still.opacity * life.share;
  std::array<double, 3 * kMostMergeTimes> places;
  samplePath(path, node.centre, scale, places.data());
  const auto put = [&](size_t field, size_t i, double value) {
    samples[field * scale.stride + i] = static_cast<float>(value);
  };
  for (size_t i = 0; i < scale.stride; ++i) {
    const double offset = stretchedOffset(scale.window, scale.parts[i], node.centre);
    still.covariance = turnedShape(node, offset);
    measureNode(still, scale.space);
    const double shown = node.peak * lifeShare(node, offset);
    const double opacity = shown > kLeastShownOpacity ? shown : 0;
    for (size_t k = 0; k < 3; ++k) {
      put(MovingField::kMean + k, i, places[k * scale.stride + i]);
      put(MovingField::kPlanes + k, i, still.plane_size[k]);
    }
    for (size_t k = 0; k < 6; ++k) put(MovingField::kCovariance + k, i, still.covariance[k]);
    put(MovingField::kOpacity, i, opacity);
    put(MovingField::kArea, i, still.area);
    put(MovingField::kDepth, i, opticalDepth(opacity) * still.area);
    node.weight += scale.weights[i] * visibility * opacity * still.area;
    node.leaf_area += scale.weights[i] * still.area;
  }
  return node;
}

double mergedCentre(const MovingNode& a, const MovingNode& b) {
  if (a.weight != b.weight) return a.weight > b.weight ? a.centre : b.centre;
  return std::min(a.centre, b.centre);
}

MovingNode mixedConstants(const MovingNode& a, const MovingNode& b, const MovingScale& scale,
                          std::array<double, 2>& rates) {
  MovingNode node;
  node.weight = a.weight + b.weight;
  const double share_a = node.weight > 0 ? a.weight / node.weight : 0.5;
  const double share_b = node.weight > 0 ? b.weight / node.weight : 0.5;
  for (size_t c = 0; c < 3; ++c) node.colour[c] = share_a * a.colour[c] + share_b * b.colour[c];
  node.visibility = share_a * a.visibility + share_b * b.visibility;
  node.contrast = share_a * a.contrast + share_b * b.contrast;
  node.leaf_area = share_a * a.leaf_area + share_b * b.leaf_area;
  node.centre = mergedCentre(a, b);
  const Quaternion turn_a = turnAbout(a, node.centre, scale);
  const Quaternion turn_b = turnAbout(b, node.centre, scale);
  for (size_t k = 0; k < 4; ++k) node.turn[k] = share_a * turn_a[k] + share_b * turn_b[k];
  for (size_t k = 0; k < 2; ++k) rates[k] = share_a * a.rates[k] + share_b * b.rates[k];
  return node;
}

double lifeShare(const MovingNode& node, double offset) {
  return std::exp(-node.rates[offset < 0 ? 0 : 1] * offset * offset);
}

std::array<double, 6> turnedShape(const MovingNode& node, double offset) {
  double quaternion[4];
  double squared = 0;
  for (size_t i = 0; i < 4; ++i) {
    quaternion[i] = (i == 0 ? 1.0 : 0.0) + offset * node.turn[i];
    squared += quaternion[i] * quaternion[i];
  }
  const auto& c = node.shape;
  if (node.turn == Quaternion{} || !(squared > kNoTurn)) return c;
  Mat3d shape;
  shape << c[0], c[1], c[2], c[1], c[3], c[4], c[2], c[4], c[5];
  const Mat3d rotation = rotationFromQuaternion<double>(quaternion);
  const Mat3d turned = rotation * shape * rotation.transpose();
  return {turned(0, 0), turned(0, 1), turned(0, 2), turned(1, 1), turned(1, 2), turned(2, 2)};
}

MotionPath pathOf(const MotionCloud& moving, size_t index, const MergeScale& space) {
  MotionPath path;
  for (size_t axis = 0; axis < 3; ++axis) {
    path[0][axis] =
        (static_cast<double>(moving.splats.positions[3 * index + axis]) - space.centre[axis]) /
        space.unit;
  }
  for (size_t k = 1; k <= kMotionHarmonics; ++k) {
    const auto [cosine, sine] =
        harmonicWave(k, 0.0, static_cast<double>(moving.phases[4 * index + k - 1]));
    for (size_t axis = 0; axis < 3; ++axis) {
      // a cos(x + p) + b sin(x + p)
      const double a = static_cast<double>(moving.waves[2 * k - 2][3 * index + axis]) / space.unit;
      const double b = static_cast<double>(moving.waves[2 * k - 1][3 * index + axis]) / space.unit;
      path[2 * k - 1][axis] = a * cosine + b * sine;
      path[2 * k][axis] = b * cosine - a * sine;
    }
  }
  for (auto& row : path) {
    for (double& value : row) value = std::clamp(value, -kFarthestPath, kFarthestPath);
  }
  return path;
}

MotionPath pathAbout(const MotionPath& path, double from, double to, const TimeWindow& window) {
  if (from == to) return path;
  // Over a whole range of stretched time the harmonics are orthogonal, at equal steps, too.
  MotionPath about = {};
  const double first = stretchedOffset(window, 0.0, to);
  for (size_t i = 0; i < kPathSamples; ++i) {
    const double offset = first + (static_cast<double>(i) + 0.5) / kPathSamples;
    const double time = timeOfOffset(window, offset, to);
    const std::array<double, 3> place =
        placeOf(path, pathBasis(stretchedOffset(window, time, from)));
    const std::array<double, kPathRows> basis = pathBasis(offset);
    for (size_t row = 0; row < kPathRows; ++row) {
      const double share = (row == 0 ? 1.0 : 2.0) / kPathSamples * basis[row];
      for (size_t axis = 0; axis < 3; ++axis) about[row][axis] += share * place[axis];
    }
  }
  return about;
}

void samplePath(const MotionPath& path, double centre, const MovingScale& scale, double* places) {
  for (size_t i = 0; i < scale.stride; ++i) {
    const std::array<double, 3> place =
        placeOf(path, pathBasis(stretchedOffset(scale.window, scale.parts[i], centre)));
    for (size_t axis = 0; axis < 3; ++axis) places[axis * scale.stride + i] = place[axis];
  }
}

void writeMovingNode(const MovingNode& node, const MotionPath& path, const MovingScale& scale,
                     MotionCloud& moving, size_t index) {
  MergeNode still;
  still.mean = path[0];
  still.covariance = node.shape;
  still.inflation = node.inflation;
  writeNode(still, scale.space, moving.splats, index);
  const std::array<double, 2> lifespans = lifespansOfRates(node.rates, scale);
  const double share = broadLife(lifespans, scale).share;
  moving.splats.opacities[index] =
      static_cast<float>(std::min(node.peak / share, kMergeMaxOpacity));
  for (size_t wave = 0; wave < kMotionWaves; ++wave) {
    for (size_t axis = 0; axis < 3; ++axis) {
      moving.waves[wave][3 * index + axis] =
          static_cast<float>(path[1 + wave][axis] * scale.space.unit);
    }
  }
  Quaternion rotation;
  for (size_t i = 0; i < 4; ++i) {
    rotation[i] = static_cast<double>(moving.splats.rotations[4 * index + i]);
    moving.phases[4 * index + i] = 0;
  }
  const Quaternion spin = product(node.turn, rotation);
  for (size_t i = 0; i < 4; ++i) {
    moving.spins[4 * index + i] = static_cast<float>(std::clamp(spin[i], -3e38, 3e38));
  }
  for (size_t side = 0; side < 2; ++side) {
    // Rounding must not leave the bounds.
    moving.lifespans[2 * index + side] =
        std::clamp(static_cast<float>(lifespans[side]), static_cast<float>(kSmallestLifespan),
                   static_cast<float>(kLargestLifespan));
  }
  moving.centres[index] = static_cast<float>(node.centre);
}

}  // namespace stipple
