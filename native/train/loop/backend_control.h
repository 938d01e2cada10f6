#pragma once

#include <optional>
#include <span>
#include <vector>

#include "densify/strategy.h"
#include "train/backend/render_backend.h"

// Between a strategy and the backend that holds its splats, with and without steps.

namespace stipple {

/// Gives the splats what the strategy trains beside them, and its way from numbers to splats.
/// Returns: rates of the extra parameters.
std::vector<double> beginControl(RenderBackend& backend, const Strategy& strategy);

/// Shows the strategy what the last backward pass has gathered. In: view: as ViewEvaluator counts;
/// lifespans: of DrawnSplats.
void observeView(RenderBackend& backend, Strategy& strategy, const FitMoment& moment, size_t view,
                 std::span<const float> lifespans = {});

/// Valid until the backend's next call.
SplatStore storeOf(const RenderBackend& backend);

/// Errors: kInternal for an edit that exceeds the hard cap.
void applyControl(RenderBackend& backend, const Strategy& strategy, const FitMoment& moment,
                  const std::optional<SplatEdit>& edit);

}  // namespace stipple
