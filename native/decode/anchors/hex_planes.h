#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace stipple {

/// How fine planes are, and where they lie.
struct HexPlaneShape {
  std::array<double, 3> lowest = {0, 0, 0};   ///< metres; places outside count as at the border
  std::array<double, 3> highest = {1, 1, 1};  ///< metres, above `lowest`
  uint32_t texels = 32;                       ///< along each axis of space, at least 2
  uint32_t moments = 16;                      ///< along time, at least 2
  uint32_t channels = 8;
  std::vector<uint32_t> multipliers = {1, 2};  ///< of `texels`, one for each scale
  uint64_t seed = 0;
};

/// Numbers of each plane, six for each scale. Errors: kInvalidArgument for a shape out of range.
std::vector<uint64_t> planeSizes(const HexPlaneShape& shape);

/// One of the six pairs of x, y, z and time: the first is along rows.
struct HexPlane {
  uint32_t first = 0, second = 1;  ///< axes; 3 is time
  uint32_t width = 2, height = 2;
  std::vector<float> values;  ///< [height,width,channels]
};

/// What a forward pass leaves for the backward pass. Memory is used again by the next.
struct HexPlaneTape {
  double tau = 0;
  std::vector<float> samples;  ///< [planes,N,channels]
};

/// Features of places at a time: six planes of numbers, of each pair of axes one, are read where a
/// place projects to, and multiplied; scales stand behind each other.
/// Source: Wu et al., 4D Gaussian Splatting for Real-Time Dynamic Scene Rendering, CVPR 2024,
/// section 4.2, by its released program. Differs: time fills its whole axis; where planes begin.
class HexPlanes {
 public:
  HexPlanes() = default;
  /// Planes of space are uniform in 0.6..1.4, those with time 1.
  explicit HexPlanes(const HexPlaneShape& shape);

  const HexPlaneShape& shape() const { return shape_; }
  size_t featureWidth() const { return shape_.multipliers.size() * shape_.channels; }
  /// Six for each scale: xy, xz, xt, yz, yt, zt.
  std::vector<HexPlane>& planes() { return planes_; }
  const std::vector<HexPlane>& planes() const { return planes_; }
  /// As many numbers, all 0: for derivatives.
  std::vector<std::vector<float>> zeros() const;

  /// In: places [N,3] metres; tau -1..1. Out: [N,featureWidth()], and the tape.
  /// Threads and determinism: parallel; same result for any number of threads.
  void forward(std::span<const float> places, double tau, std::span<float> features,
               HexPlaneTape& tape) const;
  /// In: what forward() got and left; gradient [N,featureWidth()]. Out: by_planes, added to.
  void backward(std::span<const float> places, const HexPlaneTape& tape,
                std::span<const float> gradient, std::vector<std::vector<float>>& by_planes) const;

  /// What keeps planes smooth and those with time near 1: weights of the released program (dynerf).
  /// Returns the value; by_planes is added to.
  double regularise(std::vector<std::vector<float>>& by_planes) const;

 private:
  HexPlaneShape shape_;
  std::vector<HexPlane> planes_;
};

}  // namespace stipple
