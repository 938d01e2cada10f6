#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "decode/decoder.h"
#include "decode/field/field_parameters.h"

namespace stipple {

/// What a forward pass leaves for the backward pass. Memory is used again by the next.
struct FieldTape {
  std::vector<float> spacing;        ///< [P] unit cube
  std::vector<uint32_t> neighbours;  ///< [P, kSpacingNeighbours] of the anchors
  std::vector<float> units;          ///< [P] of the layout
  std::vector<float> inputs;         ///< [P, input width]
  MlpTape network;
  std::vector<float> places;      ///< [N,3] where details are read, unit cube
  std::vector<float> footprints;  ///< [N] of the Gaussians, unit cube
  std::vector<float> details;     ///< [N, detail channels]
  std::vector<float> centres;     ///< [N,3] of the Gaussians, unit cube
  std::vector<float> stretch;     ///< [N] how much larger they are in the world; empty: 1
  std::vector<float> detail_gradient;
  std::vector<float> raw_gradient;
  std::vector<float> input_gradient;
};

/// Anchors → K Gaussians each, by features on octree levels and a small network. Sizes follow the
/// anchors' own spacing, so one field decodes at any budget. See docs/methods/attribute_field.md.
class FieldDecoder final : public Decoder {
 public:
  explicit FieldDecoder(std::shared_ptr<const FieldParameters> field) : field_(std::move(field)) {}

  /// Errors: kInvalidArgument for another count of Gaussians per anchor than the field has.
  /// Threads and determinism: parallel; same result for any number of threads.
  /// Cost: O(P log P) for the spacing, O(N) else; about 1 µs per Gaussian on one thread.
  SplatCloud decode(const DecodeRequest& request) const override;
  uint64_t memoryBound(uint64_t anchor_count, uint32_t gaussians_per_anchor) const override;

  const FieldParameters& field() const { return *field_; }

  /// decode() that can be followed by backward().
  void forward(const AnchorSet& anchors, FieldTape& tape, SplatCloud& cloud) const;
  /// Derivatives by the field. In: what forward() got, left and gave; cloud_gradient: by the values
  /// of the cloud; its values are used up. Out: those of grids are added, those of the network
  /// written over. Anchors and their spacing are taken as fixed.
  void backward(const AnchorSet& anchors, FieldTape& tape, const SplatCloud& cloud,
                SplatCloud& cloud_gradient, FieldGradients& gradients) const;

 private:
  std::shared_ptr<const FieldParameters> field_;
};

}  // namespace stipple
