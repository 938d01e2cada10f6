#pragma once

#include <memory>

#include "data/meshes/point_set.h"
#include "decode/decoder.h"
#include "density/octree_density.h"

namespace stipple {

/// Anchors of a surface density → flat splats on the surface.
/// Anchors move to the nearest sampled surface of their leaf, lie flat along the normal, and are
/// sized from the local anchor spacing so that the splats close the surface without growing over
/// its silhouette. Splats are display-space coloured (kDisplay), of the harmonic degree of
/// the samples.
class SurfaceDecoder final : public Decoder {
 public:
  /// In: surface samples in the world; the root cube and leaf level of the density made from them.
  SurfaceDecoder(std::shared_ptr<const PointSet> surface, const RootCube& root, int leaf_level);
  ~SurfaceDecoder() override;
  SplatCloud decode(const DecodeRequest& request) const override;
  uint64_t memoryBound(uint64_t anchor_count, uint32_t gaussians_per_anchor) const override;

 private:
  struct Index;
  std::shared_ptr<const PointSet> surface_;
  std::unique_ptr<const Index> index_;
};

}  // namespace stipple
