#pragma once

#include <cstdint>
#include <vector>

#include "decode/anchors/hex_planes.h"
#include "decode/anchors/scaffold.h"

namespace stipple {

/// What becomes of anchors at another time than that of their key frame. At the start it is
/// nothing at any time, bit for bit.
struct AnchorDeformation {
  HexPlanes planes;
  Mlp heads;  ///< to [3 places | 6 scales | 32 features | 3 K offsets], the last layer of zeros
  double unit = 1;  ///< metres that 1 of a place's head is
  /// Changes grow with the time from the key frame: places and offsets by tau, so that one number
  /// is a velocity, lengths and features by |tau|. Else they are what the heads say at any time.
  bool grows_from_key = true;

  bool isThere() const { return !heads.layers().empty(); }
  uint64_t bytes() const;
};

/// In: shape of the planes; of the anchors, for K and where they are.
/// Errors: kInvalidArgument for planes out of range.
AnchorDeformation makeDeformation(const HexPlaneShape& shape, uint32_t gaussians);

/// What a forward pass leaves for the backward pass.
struct DeformationTape {
  HexPlaneTape planes;
  std::vector<float> features;  ///< [P, width of the planes]
  MlpTape heads;
  std::vector<float> head_gradient, feature_gradient;
};

struct DeformationGradients {
  std::vector<std::vector<float>> planes;
  std::vector<LinearLayer> heads;
};

/// The first `count` anchors at a time. In: tau -1..1, from one key frame before to one behind.
/// Threads and determinism: parallel; same result for any number of threads.
void deform(const AnchorDeformation& deformation, const AnchorArrays& anchors, size_t count,
            double tau, DeformationTape& tape, AnchorArrays& deformed);

/// Derivatives by the deformation, written over. In: what deform() got and left; by_deformed, which
/// are derivatives by the anchors themselves, too: places, scales, features and offsets are added
/// to.
void deformBackward(const AnchorDeformation& deformation, const AnchorArrays& anchors, size_t count,
                    const AnchorArrays& by_deformed, DeformationTape& tape,
                    DeformationGradients& gradients);

}  // namespace stipple
