#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "densify/quantities/splat_footprint.h"
#include "densify/strategy.h"

namespace stipple {

/// Points of the unit normal distribution at which a footprint is looked at: its middle and six
/// rings of eight.
constexpr size_t kFootprintSamples = 49;
struct FootprintSample {
  double x, y, weight;
};
const std::array<FootprintSample, kFootprintSamples>& footprintSamples();

/// What a view shows at the samples of a footprint, grey, in 65534ths of white; kOutside where a
/// sample is outside the picture.
using FootprintPatch = std::array<uint16_t, kFootprintSamples>;
constexpr uint16_t kOutside = 65535;

/// In: picture [H,W,3] of the camera.
FootprintPatch patchAt(const Camera& camera, std::span<const float> picture,
                       const PlaceInPicture& place, const FootprintFactor& factor);

/// SSIM of two patches over the samples that both have, weighted, held to 0..1; C1 = 0.01^2 and C2
/// = 0.03^2 of white. 0 where they share no sample.
double patchSimilarity(const FootprintPatch& a, const FootprintPatch& b);

/// The two views that see a splat most, by blending weight, among those that have its centre.
class BestViews {
 public:
  explicit BestViews(size_t splat_count = 0);

  /// In: a view with its blending weights and the positions of as many splats.
  void add(const ViewStatistics& view);
  size_t size() const { return view_counts_.size(); }

  /// [N] in 0..1: how alike the targets of its two best views are under its footprint. Splats with
  /// one view have 1, those with none 0. Loads each view that is the best or second of some splat
  /// once. Memory: 204 bytes per splat with two views.
  std::vector<float> confidences(ViewEvaluator& views) const;

 private:
  std::vector<std::array<uint32_t, 2>> views_;  ///< [N] best first
  std::vector<std::array<float, 2>> weights_;   ///< [N]
  std::vector<uint8_t> view_counts_;            ///< [N] 0, 1 or 2 and more
};

}  // namespace stipple
