#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "data/clouds/splat_quantities.h"
#include "data/views/view_source.h"
#include "train/backend/backend_factory.h"

namespace stipple {

constexpr uint64_t kMaxDensifyEvents = 1000;

struct DensifyOptions {
  std::string strategy = "adaptive";  ///< as makeStrategy reads it
  uint64_t max_splats = 0;            ///< hard cap; 0: twice as many as there are
  uint64_t event_count = 1;           ///< 1..kMaxDensifyEvents
  uint64_t seed = 0;
  double ssim_share = 0.2;                     ///< of the loss whose derivatives are looked at
  uint64_t picture_bytes = uint64_t{1} << 30;  ///< of pictures kept in memory
};

/// Density control of a cloud that is there: its splats multiply and go as a strategy says, with
/// what views tell of them, and no number takes a step. For each event all views are looked at
/// once, where the strategy asks for statistics, then the event takes place. Opacities are never
/// reset, nor splats removed that a reset would have shown to be needless or whose size alone
/// counts against them: without steps nothing comes back.
///
/// In: cloud: at least one splat; views of its colour space, with their pictures; shown: the ones
/// that are looked at, at least one. Transparent views stand before black.
/// Returns: splats that stay, in their order, then new ones. Those that an event leaves alone keep
/// their bits, unless the strategy trains other numbers than stored ones.
/// Errors: kInvalidArgument for an empty cloud, views of another colour space, no views, options
/// out of range, a strategy that is not there; those of ViewSource::load; kCancelled.
/// Same result for any number of threads. Cost: for each event one drawing and one backward pass
/// per view.
/// Out: seen, where it is not null: what the strategy saw of the splats that come out, and what
/// they contribute to kContributionViews of the views.
SplatCloud densifyCloud(const BackendFactory& backends, const SplatCloud& cloud,
                        std::shared_ptr<const ViewSource> views, std::span<const size_t> shown,
                        const DensifyOptions& options, Progress* progress = nullptr,
                        SplatQuantities* seen = nullptr);

/// The errors that are known before any view is looked at.
void requireDensifiable(const SplatCloud& cloud, const ViewSource& views,
                        const DensifyOptions& options);

/// Splats that there may be at most.
uint64_t densifyLimit(uint64_t count, const DensifyOptions& options);

}  // namespace stipple
