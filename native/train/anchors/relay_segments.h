#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "decode/anchors/key_frame.h"
#include "densify/strategy.h"

namespace stipple {

/// What a fit of a long clip does one after the other.
enum class RelayStage : uint32_t {
  kGlobal = 1,    ///< one set of anchors for all of the clip
  kKeyFrame = 2,  ///< a copy for each key frame, of the views about it
  kWindow = 3,    ///< its deformation from the key frame before to the one behind
  kBlend = 4,     ///< how it and the next share the time between them
};

/// Frames on either side of a key frame whose views it is made of.
constexpr double kFramesAboutKey = 1.5;

/// A run of steps of one stage with one key frame (or a pair that begins with it).
struct RelaySegment {
  RelayStage stage = RelayStage::kGlobal;
  uint32_t key = 0;
  uint64_t begin = 0;  ///< steps that are done before it
  uint64_t end = 0;

  /// Where an iteration of the fit stands in the segment. In: moment, of begin < iteration <= end.
  FitMoment local(const FitMoment& moment) const;
};

/// Of the steps 0.4 are global, 0.05 of key frames, 0.5 of windows, 0.05 of blending; where nothing
/// blends, windows have that too. Each segment has at least one step. Each key frame's window
/// follows it, so that the next key frame can begin with what both have learned.
std::vector<RelaySegment> relaySegments(uint64_t iterations, const KeyFrameClip& clip);

/// The views that a segment learns from, as places in `times`: those in its span of time; where
/// there is none, the nearest. Windows have those near the key frame first, and more than once, as
/// it counts for less the nearer the next one is. In: times of the views, seconds, at least one.
std::vector<size_t> viewsOfSegment(const RelaySegment& segment, const KeyFrameClip& clip,
                                   std::span<const double> times);

/// How many of viewsOfSegment(), the first of them, a step draws from. A window reaches further
/// from its key frame with every step: an anchor follows what moves for as long as it overlaps it,
/// and where it is shown another place too early, it learns to fade instead. In: done 0..1, the
/// share of the segment's steps. Returns: at least 1.
size_t viewsInReach(const RelaySegment& segment, const KeyFrameClip& clip,
                    std::span<const double> times, std::span<const size_t> views, double done);

/// Level of each anchor, by its rank in how much the numbers of its feature vary: 0 below the first
/// quantile, 2 from the second one on, else 1; ties go by the order of anchors. In: features
/// [A,kScaffoldFeatures]; quantiles 0..1, ascending.
std::vector<uint8_t> levelsOfFeatures(std::span<const float> features,
                                      const std::array<double, 2>& quantiles);

}  // namespace stipple
