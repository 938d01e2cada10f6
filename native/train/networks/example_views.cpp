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

ImageLossValue addViewLoss(ViewPass& pass, const ObjectView& view, bool is_white,
                           const SplatCloud& cloud, const StatisticRequest& request, double ssim,
                           double factor, SplatCloud& by_view, SplatCloud& sum,
                           Progress* progress) {
  std::vector<float> target = view.image;
  RenderOptions options;
  options.with_depth = false;
  options.with_background = true;
  std::fill_n(options.background, 3, is_white ? 1.0f : 0.0f);
  for (size_t i = 0; i < target.size() && is_white; ++i) target[i] += 1 - view.alpha[i / 3];
  pass.forward(cloud, view.camera, options, progress);
  // As a multiple of the loss that shares one between L1 and 1 - SSIM.
  const double whole = 1 + ssim;
  const ImageLossValue loss = pass.loss(target, {}, lossFor(request, ssim / whole));
  pass.backward(request, 0.0, progress);
  pass.swapGradients(by_view);
  addCloud(by_view, factor * whole, sum);
  pass.swapGradients(by_view);
  return loss;
}

}  // namespace stipple
