#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "decode/anchors/scaffold.h"
#include "decode/decoder.h"

namespace stipple {

/// What a forward pass leaves for the backward pass. Memory is used again by the next.
struct ScaffoldTape {
  size_t anchors = 0;           ///< P, the first of the scaffold
  std::vector<uint32_t> slots;  ///< [N] anchor * K + k of each splat, ascending
  MlpTape opacity, covariance, colour;
  std::array<std::vector<float>, 3> raw_gradients;  ///< of the networks' outputs, in that order
  std::vector<float> input_gradient;
};

/// Derivatives by all of it.
struct ScaffoldGradients {
  AnchorArrays anchors;
  std::vector<LinearLayer> opacity, covariance, colour;
};

/// The first P anchors → up to K splats each: those whose opacity is above 0.
class ScaffoldDecoder final : public Decoder {
 public:
  explicit ScaffoldDecoder(std::shared_ptr<const ScaffoldParameters> scaffold)
      : scaffold_(std::move(scaffold)) {}

  /// Out: the splats that are there, in the order of anchors. Errors: kInvalidArgument for another
  /// count of Gaussians per anchor than the scaffold has.
  /// Threads and determinism: parallel; same result for any number of threads.
  SplatCloud decode(const DecodeRequest& request) const override;
  uint64_t memoryBound(uint64_t anchor_count, uint32_t gaussians_per_anchor) const override;

  const ScaffoldParameters& scaffold() const { return *scaffold_; }

  /// decode() of the first `count` anchors that can be followed by backward(). In: anchors: those
  /// of the scaffold, or what a deformation has made of the first of them.
  void forward(const AnchorArrays& anchors, size_t count, ScaffoldTape& tape,
               SplatCloud& cloud) const;
  /// Derivatives by the scaffold. In: what forward() left and gave; cloud_gradient: by the values
  /// of the cloud. Out: gradients, written over; those of anchors beyond P are 0.
  void backward(const AnchorArrays& anchors, ScaffoldTape& tape, const SplatCloud& cloud,
                const SplatCloud& cloud_gradient, ScaffoldGradients& gradients) const;

 private:
  std::shared_ptr<const ScaffoldParameters> scaffold_;
};

}  // namespace stipple
