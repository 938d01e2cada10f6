#pragma once

#include "densify/strategy.h"

namespace stipple {

/// What is done to the scales and opacities of stored splats before they are drawn, after whatever
/// made them of raw numbers.
class SplatFilter {
 public:
  virtual ~SplatFilter() = default;
  virtual void apply(SplatCloud& cloud) const = 0;
  /// In: cloud, before it. Derivatives by the filtered scales and opacities become those by the
  /// ones before, in place.
  virtual void adjoint(const SplatCloud& cloud, const CloudGradient& gradient) const = 0;
};

/// A parameterisation followed by a filter. One call at a time.
class FilteredParameterisation final : public Parameterisation {
 public:
  /// In: how: null: as raw_splats.h says. Both outlive this.
  FilteredParameterisation(const Parameterisation* how, const SplatFilter& filter)
      : how_(how), filter_(filter) {}

  void activate(const RawSplats& raw, SplatCloud& cloud) const override;
  void adjoint(const RawSplats& raw, const SplatCloud& cloud, const CloudGradient& by_cloud,
               RawSplats& by_raw) const override;

 private:
  const Parameterisation* how_;
  const SplatFilter& filter_;
  mutable SplatCloud before_;  ///< the cloud without the filter, while derivatives go through
};

}  // namespace stipple
