#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "data/tensor_table.h"
#include "decode/anchors/anchor_deformation.h"
#include "decode/anchors/scaffold.h"
#include "decode/anchors/scaffold_decoder.h"

namespace stipple {

/// How the two key frames about a time share it.
enum class KeyFrameBlend : uint32_t {
  kLearned = 0,  ///< by numbers of each anchor
  kLinear = 1,   ///< by how far the time is
  kNone = 2,     ///< the nearer one is shown alone
  kPlateau = 3,  ///< by numbers of each anchor, which is whole until its offset
};
/// Whether anchors have numbers that are learned for it.
constexpr bool isLearned(KeyFrameBlend blend) {
  return blend == KeyFrameBlend::kLearned || blend == KeyFrameBlend::kPlateau;
}

/// The clip that key frames stand in, one every `spacing` frames.
struct KeyFrameClip {
  double begin = 0;              ///< seconds, of the first frame
  double frames_per_second = 1;  ///< > 0
  uint32_t frame_count = 1;
  uint32_t spacing = 1;  ///< frames, at least 1
  KeyFrameBlend blend = KeyFrameBlend::kLearned;
  uint32_t first_key = 0;  ///< the frame of the first one

  double end() const { return begin + (frame_count - 1) / frames_per_second; }
  /// At least one: as few as there may be for none to go on alone for more than half of the
  /// spacing, where they stand in the middle (firstKeyOf).
  uint32_t keyCount() const;
  double timeOf(uint32_t key) const {
    return begin + (first_key + double{1} * key * spacing) / frames_per_second;
  }
};

/// Where the first key frame stands for as many frames to be before it as behind the last.
uint32_t firstKeyOf(const KeyFrameClip& clip);

/// Errors: kInvalidArgument.
void validate(const KeyFrameClip& clip);

/// Anchors that are shown at once, at most: a budget is shared evenly by two key frames.
/// In: counts of the anchors of each key frame.
uint64_t mostAnchors(const KeyFrameClip& clip, std::span<const uint64_t> counts);

/// Which key frames show a time, held to the clip.
struct KeyFramesAt {
  uint32_t key = 0;       ///< n, the one before; before the first, that
  bool has_next = false;  ///< n + 1 shows it, too; else n is alone
  double tau = 0;         ///< 0..1 from n to n + 1; below 0 before the first
};
KeyFramesAt keyFramesAt(const KeyFrameClip& clip, double seconds);

/// Numbers that blend an anchor: offset and raw decay forward in time, the same backward.
constexpr size_t kBlendNumbers = 4;
/// softplus of it is 1.
constexpr float kStartingDecay = 0.5413248f;

/// Anchors of one moment, what becomes of them until the neighbouring key frames, and how they
/// fade.
struct KeyFrame {
  ScaffoldParameters scaffold;
  AnchorDeformation deformation;  ///< not there: anchors stand still
  std::vector<float> blend;       ///< [A,kBlendNumbers]

  uint64_t bytes() const;
};

/// exp(-lambda d |tau - o|) of each of the first `count` anchors, with o and d of the direction
/// that tau points in; of a plateau exp(-lambda d max(0, |tau| - |o|)). In: tau -1..1; blend that
/// isLearned(). Source: Kwak et al., MoRel, CVPR 2026 (arXiv 2512.09270), temporal opacity, whose
/// figure shows the plateau and whose formula is the other.
std::vector<float> fadingOf(const KeyFrame& frame, size_t count, double tau,
                            KeyFrameBlend blend = KeyFrameBlend::kLearned);

/// What one of two key frames counts at a time, of each anchor: w / (w + mean of the other's w).
std::vector<float> sharesOf(const std::vector<float>& own, const std::vector<float>& other);

/// Derivatives. In: by_shares of sharesOf(own, other). Out: by_own, by_other: added to.
void sharesBackward(const std::vector<float>& own, const std::vector<float>& other,
                    const std::vector<float>& by_shares, std::vector<float>& by_own,
                    std::vector<float>& by_other);
/// In: by_fading of fadingOf(frame, its size, tau, blend). Out: by_blend [A,kBlendNumbers], added
/// to.
void fadingBackward(const KeyFrame& frame, double tau, const std::vector<float>& by_fading,
                    std::vector<float>& by_blend, KeyFrameBlend blend = KeyFrameBlend::kLearned);

/// Splats of key frames at a time.
struct KeyFrameTape {
  DeformationTape deformation;
  AnchorArrays deformed;
  ScaffoldTape splats;
};

/// The first `count` anchors of a key frame at a time, without fading. In: tau -1..1.
void splatsOfKeyFrame(const KeyFrame& frame, size_t count, double tau, KeyFrameTape& tape,
                      SplatCloud& cloud);

/// Splats of key frames behind each other, their opacities times the shares of their anchors. In:
/// clouds and tapes of splatsOfKeyFrame(); shares [A] of each, or empty: 1; K.
void joinBlended(std::span<const SplatCloud> clouds, std::span<const KeyFrameTape> tapes,
                 std::span<const std::vector<float>> shares, uint32_t gaussians, SplatCloud& all);

/// Where key frames come from. Null where there is none of this number.
using KeyFrameSource = std::function<std::shared_ptr<const KeyFrame>(uint32_t key)>;

/// The splats at a time, of all anchors or of at most `budget` (0: all), both key frames together.
SplatCloud splatsOfClip(const KeyFrameClip& clip, const KeyFrameSource& frames, double seconds,
                        uint64_t budget);

/// As named tensors behind a prefix: "PREFIXscaffold.*", "PREFIXplanes.P", "PREFIXheads.layerI.*",
/// "PREFIXblend", PREFIXplanes, sizes of the planes, PREFIXbox, [8]: lowest 3, highest 3, unit, 1
/// where changes grow from the key frame; where smaller budgets were learned PREFIXcoarsening.
TensorTable tensorsOfKeyFrame(const KeyFrame& frame, const std::string& prefix);
/// The other way round. Errors: kFormat.
KeyFrame keyFrameOfTensors(const TensorTable& table, const std::string& prefix,
                           const ScaffoldShape& like);

}  // namespace stipple
