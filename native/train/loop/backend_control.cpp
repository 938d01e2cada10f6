#include "train/loop/backend_control.h"

#include <algorithm>
#include <string>

#include "base/error.h"

namespace stipple {

std::vector<double> beginControl(RenderBackend& backend, const Strategy& strategy) {
  std::vector<double> rates;
  const std::vector<ExtraParameter> extras = strategy.parameters();
  if (!extras.empty()) {
    TrainingState state = backend.state();
    const std::vector<std::vector<float>> values = strategy.initialExtras(state.splats);
    for (const ExtraParameter& extra : extras) {
      state.splats.extra_lengths.push_back(extra.row_length);
      rates.push_back(extra.learning_rate);
    }
    state.splats.extras = values;
    state.first_moments = state.second_moments = zerosLike(state.splats);
    backend.restore(state);
  }
  backend.parameterise(strategy.parameterisation());
  return rates;
}

void observeView(RenderBackend& backend, Strategy& strategy, const FitMoment& moment, size_t view,
                 std::span<const float> lifespans) {
  ViewStatistics statistics;
  statistics.view = view;
  backend.lendStatistics(statistics);
  statistics.splats.lifespans = lifespans;
  strategy.observe(moment, statistics);
}

SplatStore storeOf(const RenderBackend& backend) {
  return {backend.splatCount(), backend};
}

void applyControl(RenderBackend& backend, const Strategy& strategy, const FitMoment& moment,
                  const std::optional<SplatEdit>& edit) {
  if (!edit) return;
  const size_t before = backend.splatCount();
  const size_t after = edit->countAfter(before);
  if (moment.max_splats > 0 && after > std::max<size_t>(before, moment.max_splats)) {
    fail(ErrorCode::kInternal, std::string("strategy ") + strategy.name() + " makes " +
                                   std::to_string(after) + " splats; at most " +
                                   std::to_string(moment.max_splats) + " are allowed");
  }
  backend.edit(*edit);
}

}  // namespace stipple
