#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "decode/tree/merge_node.h"
#include "motion/motion_cloud.h"

namespace stipple {

/// Times at which merges of moving splats are judged, at most, and the step of their number: whole
/// groups, so that every processor sums in the same order.
constexpr size_t kMostMergeTimes = 32;
constexpr size_t kMergeTimeGroup = 8;
/// Times where nothing else is said.
constexpr size_t kMergeTimes = 16;

/// Opacities at a time below this count as 0.
constexpr double kLeastShownOpacity = 1e-5;

/// Sums over the times below this tell nothing.
constexpr double kLeastDepth = 1e-100;
/// How much rates of opacity are held to those of the children, in parts of what a time tells that
/// is half a part of the clip from the moment. It decides for splats that live in one part alone.
constexpr double kRatePull = 1e-3;
/// Rates and peak cannot be told apart below this.
constexpr double kLeastSlope = 1e-9;

/// Numbers of a path: the place about which a splat moves, then cosine and sine of each harmonic;
/// three axes each.
constexpr size_t kPathRows = 1 + kMotionWaves;
using MotionPath = std::array<std::array<double, 3>, kPathRows>;

/// What all merges of a tree of moving splats share. Times are the middles of `times` equal parts
/// of the clip; the last is repeated up to `stride`, without weight.
struct MovingScale {
  MergeScale space;
  TimeWindow window;
  size_t times = 1;
  size_t stride = kMergeTimeGroup;
  std::array<double, kMostMergeTimes> parts = {};    ///< times as parts of the clip
  std::array<double, kMostMergeTimes> weights = {};  ///< 1 / times, 0 of repeated ones
  /// What squares of temporal scales grow by where an opacity stands for that of a whole part.
  double broadening = 0;
  /// Half a frame of stretched time: a splat of a shorter life is still seen in a frame.
  double shortest_life = 0;
};

/// In: times: 1..kMostMergeTimes; clips of fewer frames have one for each frame.
MovingScale movingScale(const MergeScale& space, const MotionClip& clip, size_t times);

/// Numbers of a node at the times, [field, stride] floats. Lengths are in the units of the tree.
struct MovingField {
  static constexpr size_t kMean = 0;
  static constexpr size_t kOpacity = 3;  ///< as drawn
  static constexpr size_t kArea = 4;
  static constexpr size_t kCovariance = 5;  ///< as drawn, but for the inflation
  static constexpr size_t kPlanes = 11;
  static constexpr size_t kDepth = 14;  ///< what all leaves below cover
  static constexpr size_t kCount = 15;
};

/// What a node has at all times alike, beside its numbers at the times. Fields are those of
/// MergeValues where they have the same names.
struct MovingNode {
  std::array<double, 3> colour = {};
  std::array<double, 3> around = {};
  double visibility = 1;
  double contrast = 1;
  double weight = 0;  ///< visible mass, the mean over the times
  double leaf_area = 0;
  double inflation = 1;
  double centre = 0;  ///< its moment, as of MovingSplat
  /// Opacity over time, broadened: peak exp(-rate offset^2), rates before and after the moment.
  double peak = 0;
  std::array<double, 2> rates = {1, 1};
  /// How it turns: quaternion 1 + offset * turn, w,x,y,z, made unit; none at its moment.
  std::array<double, 4> turn = {};
  /// Covariance at its moment, without inflation.
  std::array<double, 6> shape = {};
};

/// Broadened rates of opacity of temporal scales, and what is left of the peak.
struct BroadLife {
  std::array<double, 2> rates;
  double share;
};
BroadLife broadLife(const std::array<double, 2>& lifespans, const MovingScale& scale);
/// Temporal scales of rates, within the bounds of MovingSplat.
std::array<double, 2> lifespansOfRates(const std::array<double, 2>& rates,
                                       const MovingScale& scale);

/// Share of the peak at an offset, and the covariance there.
double lifeShare(const MovingNode& node, double offset);
std::array<double, 6> turnedShape(const MovingNode& node, double offset);

/// Row `index` of a cloud. In: path: pathOf() it. Out: samples [MovingField::kCount, stride].
MovingNode movingLeaf(const MotionCloud& moving, size_t index, double visibility,
                      const MotionPath& path, const MovingScale& scale, float* samples);

/// The turn of a node as seen from another moment: least squares over the times.
std::array<double, 4> turnAbout(const MovingNode& node, double centre, const MovingScale& scale);

/// Whose moment a merged node has: that of the heavier one, the earlier one of equals.
double mergedCentre(const MovingNode& a, const MovingNode& b);

/// What a merged node has before anything is known of its times: means by the weights, its moment
/// and its turn. Out: rates: the mean of both nodes'.
MovingNode mixedConstants(const MovingNode& a, const MovingNode& b, const MovingScale& scale,
                          std::array<double, 2>& rates);

/// The path of row `index` of a cloud about its own moment, with phases of 0, in units of the tree.
MotionPath pathOf(const MotionCloud& moving, size_t index, const MergeScale& space);
/// The same path by the stretched time of another moment: least squares over that time, which the
/// Fourier coefficients of its samples are.
MotionPath pathAbout(const MotionPath& path, double from, double to, const TimeWindow& window);
/// Places at the times of the scale. Out: places [3, stride].
void samplePath(const MotionPath& path, double centre, const MovingScale& scale, double* places);

/// Writes what a node looks like into row `index`, all but the harmonics of colour.
void writeMovingNode(const MovingNode& node, const MotionPath& path, const MovingScale& scale,
                     MotionCloud& moving, size_t index);

}  // namespace stipple
