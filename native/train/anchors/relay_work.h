#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "data/tensor_table.h"
#include "decode/anchors/key_frame.h"
#include "densify/strategy.h"
#include "train/anchors/scaffold_state.h"

namespace stipple {

/// What a fit of a long clip has at hand: a key frame under way, or the numbers that blend two.
struct RelayWork {
  ScaffoldState state;                       ///< while two are blended: no anchors
  AnchorDeformation deformation;             ///< not there outside of windows
  std::vector<Moments> deformation_moments;  ///< of planes, then of weights and biases of heads
  uint64_t deformation_steps = 0;
  std::vector<std::vector<float>> blends;  ///< of two key frames, [A,kBlendNumbers] each; or none
  std::vector<Moments> blend_moments;
  uint64_t blend_steps = 0;

  uint64_t bytes() const;
};

/// Begins on a key frame, or on the blending of two. In: deformation: not there outside of windows;
/// like, for what networks have.
RelayWork workOn(ScaffoldState state, AnchorDeformation deformation);
RelayWork blendWorkOf(const KeyFrame& before, const KeyFrame& behind, const RelayWork& like);

/// The key frame under way.
KeyFrame keyFrameOf(const RelayWork& work);

/// One step of Adam.
void learnDeformation(const FitMoment& moment, const DeformationGradients& gradients,
                      RelayWork& work);
void learnBlend(const FitMoment& moment, const std::array<std::vector<float>, 2>& by_blend,
                RelayWork& work);

/// As named tensors: those of its state, "deformation.*", "blend.*" and "adam.*".
TensorTable tensorsOf(const RelayWork& work);
/// The other way round. In: like: of the same networks. Errors: kFormat.
RelayWork workOf(const TensorTable& table, const RelayWork& like);

}  // namespace stipple
