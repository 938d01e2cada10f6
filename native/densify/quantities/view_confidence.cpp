// Based on: Zeng, Wang, Ju, Guan, Frequency-Aware Density Control via Reparameterization for
// High-Quality Rendering of 3D Gaussian Splatting, AAAI 2025, and its program. Differs: every splat
// is looked at with its own covariance in that view, and samples are centre + L z with the lower
// Cholesky factor L; the program mixes up splats and transposes the factor.

#include "densify/quantities/view_confidence.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "math/covariance.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 12;
constexpr double kWhite = 65534;

Vec3d positionOf(std::span<const float> positions, size_t row) {
  return {static_cast<double>(positions[row * 3]), static_cast<double>(positions[row * 3 + 1]),
          static_cast<double>(positions[row * 3 + 2])};
}

uint16_t greyAt(std::span<const float> picture, size_t pixel) {
  const double mean =
      (static_cast<double>(picture[pixel * 3]) + static_cast<double>(picture[pixel * 3 + 1]) +
       static_cast<double>(picture[pixel * 3 + 2])) /
      3;
  return static_cast<uint16_t>(std::lround(kWhite * std::clamp(mean, 0.0, 1.0)));
}

}  // namespace

const std::array<FootprintSample, kFootprintSamples>& footprintSamples() {
  static const std::array<FootprintSample, kFootprintSamples> samples = [] {
    std::array<FootprintSample, kFootprintSamples> made;
    made[0] = {0, 0, 1};
    size_t next = 1;
    for (int ring = 1; ring <= 6; ++ring) {
      const double r = 0.5 * ring;
      for (int direction = 0; direction < 8; ++direction) {
        const double angle = direction * 0.7853981633974483;
        made[next++] = {r * std::cos(angle), r * std::sin(angle), std::exp(-0.5 * r * r)};
      }
    }
    return made;
  }();
  return samples;
}

FootprintPatch patchAt(const Camera& camera, std::span<const float> picture,
                       const PlaceInPicture& place, const FootprintFactor& factor) {
  FootprintPatch patch;
  for (size_t k = 0; k < kFootprintSamples; ++k) {
    const FootprintSample& sample = footprintSamples()[k];
    const double x = place.x + factor.l00 * sample.x;
    const double y = place.y + factor.l10 * sample.x + factor.l11 * sample.y;
    const bool is_inside = x >= 0 && x < camera.width && y >= 0 && y < camera.height;
    patch[k] = is_inside
                   ? greyAt(picture, static_cast<size_t>(y) * camera.width + static_cast<size_t>(x))
                   : kOutside;
  }
  return patch;
}

double patchSimilarity(const FootprintPatch& a, const FootprintPatch& b) {
  double weights = 0, mean_a = 0, mean_b = 0;
  for (size_t k = 0; k < kFootprintSamples; ++k) {
    if (a[k] == kOutside || b[k] == kOutside) continue;
    const double weight = footprintSamples()[k].weight;
    weights += weight;
    mean_a += weight * a[k];
    mean_b += weight * b[k];
  }
  if (!(weights > 0)) return 0;
  mean_a /= weights;
  mean_b /= weights;
  double variance_a = 0, variance_b = 0, covariance = 0;
  for (size_t k = 0; k < kFootprintSamples; ++k) {
    if (a[k] == kOutside || b[k] == kOutside) continue;
    const double weight = footprintSamples()[k].weight;
    variance_a += weight * (a[k] - mean_a) * (a[k] - mean_a);
    variance_b += weight * (b[k] - mean_b) * (b[k] - mean_b);
    covariance += weight * (a[k] - mean_a) * (b[k] - mean_b);
  }
  variance_a /= weights;
  variance_b /= weights;
  covariance /= weights;
  const double c1 = 0.01 * 0.01 * kWhite * kWhite, c2 = 0.03 * 0.03 * kWhite * kWhite;
  const double similarity =
      (2 * mean_a * mean_b + c1) * (2 * covariance + c2) /
      ((mean_a * mean_a + mean_b * mean_b + c1) * (variance_a + variance_b + c2));
  return std::clamp(similarity, 0.0, 1.0);
}

BestViews::BestViews(size_t splat_count)
    : views_(splat_count), weights_(splat_count), view_counts_(splat_count, 0) {}

void BestViews::add(const ViewStatistics& view) {
  const std::span<const float> weights = view.of(Statistic::kBlendingWeights);
  parallelFor(size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      if (!view.visible[i] || !(weights[i] > 0)) continue;
      if (!placeInPicture(*view.camera, positionOf(view.splats.positions, i))) continue;
      const uint32_t number = static_cast<uint32_t>(view.view);
      if (view_counts_[i] == 0 || weights[i] > weights_[i][0]) {
        views_[i] = {number, views_[i][0]};
        weights_[i] = {weights[i], weights_[i][0]};
      } else if (view_counts_[i] == 1 || weights[i] > weights_[i][1]) {
        views_[i][1] = number;
        weights_[i][1] = weights[i];
      }
      view_counts_[i] = static_cast<uint8_t>(std::min(view_counts_[i] + 1, 2));
    }
  });
}

std::vector<float> BestViews::confidences(ViewEvaluator& views) const {
  std::vector<float> confidences(size());
  std::vector<uint32_t> tested;
  for (uint32_t i = 0; i < size(); ++i) {
    confidences[i] = view_counts_[i] == 1 ? 1.0f : 0.0f;
    if (view_counts_[i] == 2) tested.push_back(i);
  }
  const SplatCloud& splats = views.splats();
  std::vector<std::array<FootprintPatch, 2>> patches(tested.size());
  for (uint32_t view = 0; view < views.viewCount(); ++view) {
    const bool is_needed = std::any_of(tested.begin(), tested.end(), [&](uint32_t row) {
      return views_[row][0] == view || views_[row][1] == view;
    });
    if (!is_needed) continue;
    const std::vector<float> picture = views.target(view);
    const Camera& camera = views.camera(view);
    parallelFor(tested.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t k = begin; k < end; ++k) {
        const size_t row = tested[k];
        const size_t which = views_[row][0] == view ? 0 : 1;
        if (views_[row][which] != view) continue;
        const auto place = placeInPicture(camera, positionOf(splats.positions, row));
        const Mat3d axes = scaledAxes<double>(&splats.rotations[row * 4], &splats.scales[row * 3]);
        patches[k][which] = patchAt(camera, picture, *place, footprintFactor(camera, *place, axes));
      }
    });
  }
  parallelFor(tested.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t k = begin; k < end; ++k) {
      confidences[tested[k]] = static_cast<float>(patchSimilarity(patches[k][0], patches[k][1]));
    }
  });
  return confidences;
}

}  // namespace stipple
