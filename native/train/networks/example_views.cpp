#include "train/networks/example_views.h"

#include <algorithm>
#include <span>
#include <utility>

#include "base/random.h"

namespace stipple {

namespace {

void addTo(std::span<const float> from, double factor, std::vector<float>& to) {
  const auto by = static_cast<float>(factor);
  for (size_t i = 0; i < from.size(); ++i) to[i] += by * from[i];
}

}  // namespace

std::vector<size_t> drawnViews(size_t count, size_t wanted, uint64_t seed) {
  std::vector<std::pair<uint64_t, size_t>> keys;
  for (size_t i = 0; i < count; ++i) {
    keys.emplace_back(keyedBits(seed, RandomUse::kViewOrder, i), i);
  }
  std::sort(keys.begin(), keys.end());
  std::vector<size_t> made;
  for (size_t i = 0; i < std::min(wanted, count); ++i) made.push_back(keys[i].second);
  return made;
}

SplatCloud zerosLike(const SplatCloud& cloud) {
  SplatCloud made;
  made.sh_degree = cloud.sh_degree;
  made.positions.assign(cloud.positions.size(), 0.0f);
  made.scales.assign(cloud.scales.size(), 0.0f);
  made.rotations.assign(cloud.rotations.size(), 0.0f);
  made.opacities.assign(cloud.opacities.size(), 0.0f);
  made.sh.assign(cloud.sh.size(), 0.0f);
  return made;
}

void addCloud(const SplatCloud& of_view, double factor, SplatCloud& sum) {
  addTo(of_view.positions, factor, sum.positions);
  addTo(of_view.scales, factor, sum.scales);
  addTo(of_view.rotations, factor, sum.rotations);
  addTo(of_view.opacities, factor, sum.opacities);
  addTo(of_view.sh, factor, sum.sh);
}

}  // namespace stipple
