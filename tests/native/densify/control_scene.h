#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "densify/strategy.h"

namespace stipple::testing {

/// A fit of the published length whose cameras are spread over one metre.
inline FitMoment at(uint64_t iteration, uint64_t max_splats = 0) {
  FitMoment moment;
  moment.iteration = iteration;
  moment.iterations = 30000;
  moment.extent = 1;
  moment.seed = 7;
  moment.max_splats = max_splats;
  return moment;
}

struct Kind {
  float scale;
  float opacity;
};

/// Round splats in a row along x, a metre apart; each number of their harmonics another one.
inline RawSplats splatsOf(const std::vector<Kind>& kinds) {
  SplatCloud cloud;
  cloud.sh_degree = 1;
  cloud.resize(kinds.size());
  for (size_t i = 0; i < kinds.size(); ++i) {
    cloud.positions[i * 3] = static_cast<float>(i);
    cloud.rotations[i * 4] = 1;
    std::fill_n(&cloud.scales[i * 3], 3, kinds[i].scale);
    cloud.opacities[i] = kinds[i].opacity;
    for (size_t k = 0; k < 12; ++k) cloud.sh[i * 12 + k] = static_cast<float>(100 * i + k);
  }
  return rawSplats(cloud);
}

/// What one view of 200 x 100 pixels says: gradients per pixel along x and y.
struct Seen {
  std::vector<float> gradients;
  std::vector<float> absolute;
  std::vector<float> lengths;
  std::vector<uint8_t> visible;

  /// In: gradients, of each splat, per half picture; along x. Absolute: the sizes of what its
  /// pixels ask for, where that is more.
  explicit Seen(const std::vector<float>& along_x,
                const std::vector<float>& absolute_along_x = {}) {
    for (size_t i = 0; i < along_x.size(); ++i) {
      const float sizes = absolute_along_x.empty() ? std::abs(along_x[i]) : absolute_along_x[i];
      gradients.insert(gradients.end(), {along_x[i] / 100, 0.0f});
      absolute.insert(absolute.end(), {sizes / 100, 0.0f});
      lengths.push_back(sizes / 100);
      visible.push_back(1);
    }
  }

  ViewStatistics statistics() const {
    ViewStatistics view;
    view.width = 200;
    view.height = 100;
    view.visible = visible;
    view.arrays[static_cast<size_t>(Statistic::kScreenGradients)] = gradients;
    view.arrays[static_cast<size_t>(Statistic::kAbsoluteScreenGradients)] = absolute;
    view.arrays[static_cast<size_t>(Statistic::kScreenGradientNorms)] = lengths;
    return view;
  }
};

inline std::optional<SplatEdit> editAt(Strategy& strategy, const FitMoment& moment,
                                       const RawSplats& splats) {
  const RawSplats moments = zerosLike(splats);
  return strategy.edit(moment, {splats, moments, moments});
}

inline RawSplats after(const SplatEdit& edit, RawSplats splats) {
  validate(edit, splats);
  const EditTarget target{&splats, false};
  applyEdit(edit, {&target, 1});
  return splats;
}

/// What an error says.
template <typename Call>
std::string messageOf(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing thrown";
}

}  // namespace stipple::testing
