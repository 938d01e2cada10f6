// Loading splats into lanes, for the projector and its backward. Included once per target, hence
// the guard that switches.

#if defined(STIPPLE_SPLAT_CPU_LOAD_GEOMETRY_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef STIPPLE_SPLAT_CPU_LOAD_GEOMETRY_INL_H_
#undef STIPPLE_SPLAT_CPU_LOAD_GEOMETRY_INL_H_
#else
#define STIPPLE_SPLAT_CPU_LOAD_GEOMETRY_INL_H_
#endif

#include <hwy/highway.h>

#include "data/clouds/splat_cloud.h"
#include "splat/cpu/lanes-inl.h"
#include "splat/render/projection.h"

HWY_BEFORE_NAMESPACE();
namespace stipple {
namespace HWY_NAMESPACE {

/// As many splats as there are lanes, from `row` on, columns apart.
template <class D>
HWY_INLINE void loadGeometry(const SplatCloud& cloud, size_t row, SplatGeometry<Lanes<D>>& splat) {
  const hn::Rebind<float, D> d;
  const auto wide = [](auto v) HWY_ATTR { return Lanes<D>(hn::PromoteTo(D(), v)); };
  hn::Vec<hn::Rebind<float, D>> a, b, c, e;
  hn::LoadInterleaved3(d, &cloud.positions[row * 3], a, b, c);
  splat.position[0] = wide(a);
  splat.position[1] = wide(b);
  splat.position[2] = wide(c);
  hn::LoadInterleaved4(d, &cloud.rotations[row * 4], a, b, c, e);
  splat.rotation[0] = wide(a);
  splat.rotation[1] = wide(b);
  splat.rotation[2] = wide(c);
  splat.rotation[3] = wide(e);
  hn::LoadInterleaved3(d, &cloud.scales[row * 3], a, b, c);
  splat.scales[0] = wide(a);
  splat.scales[1] = wide(b);
  splat.scales[2] = wide(c);
  splat.opacity = wide(hn::LoadU(d, &cloud.opacities[row]));
}

}  // namespace HWY_NAMESPACE
}  // namespace stipple
HWY_AFTER_NAMESPACE();

#endif
