#include "train/loop/held_out.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>

#include "base/parallel.h"
#include "math/colour.h"
#include "math/vec.h"
#include "train/prior/shared_volume.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 14;
/// dB given to a picture without any error: more than 8-bit pictures can tell apart.
constexpr double kMostPsnr = 100.0;
/// Alpha from which a pixel belongs to the foreground: half of the least that 8 bits hold.
constexpr float kForegroundAlpha = 0.5f / 255.0f;

float shown(float value, ColourSpace space) {
  const float held = std::clamp(value, 0.0f, 1.0f);
  return space == ColourSpace::kLinear ? std::clamp(linearToSrgb(held), 0.0f, 1.0f) : held;
}

/// dB of the weighted mean of squares; 0 weights: nothing is wrong.
double psnrOf(const std::vector<float>& a, const std::vector<float>& b,
              const std::vector<float>& weights) {
  const size_t pixel_count = a.size() / 3;
  std::vector<double> sums(rangeCount(pixel_count, kGrain)), totals(sums.size());
  parallelFor(pixel_count, kGrain, [&](size_t begin, size_t end) {
    double sum = 0, total = 0;
    for (size_t i = begin; i < end; ++i) {
      const double weight = weights.empty() ? 1.0 : static_cast<double>(weights[i]);
      for (size_t c = 0; c < 3; ++c) {
        const double error = static_cast<double>(a[i * 3 + c]) - static_cast<double>(b[i * 3 + c]);
        sum += weight * error * error;
      }
      total += 3 * weight;
    }
    sums[begin / kGrain] = sum;
    totals[begin / kGrain] = total;
  });
  const double squares = std::accumulate(sums.begin(), sums.end(), 0.0);
  const double total = std::accumulate(totals.begin(), totals.end(), 0.0);
  if (squares <= 0 || total <= 0) return kMostPsnr;
  return std::min(kMostPsnr, -10.0 * std::log10(squares / total));
}

/// What is to be seen of colours of the compositing space.
void showAll(std::vector<float>& colours, ColourSpace space) {
  parallelFor(colours.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) colours[i] = shown(colours[i], space);
  });
}

/// Mean distance of the points from a place, metres; 0 without points.
double meanDistance(const PointSet& points, const Vec3d& place) {
  double sum = 0;
  for (size_t i = 0; i < points.size(); ++i) {
    const float* p = &points.positions[i * 3];
    sum += (Vec3f(p[0], p[1], p[2]).cast<double>() - place).norm();
  }
  return points.size() == 0 ? 0 : sum / static_cast<double>(points.size());
}

}  // namespace

FitViews splitViews(const ViewSource& views, uint64_t every) {
  std::vector<std::string> names(views.count());
  for (size_t i = 0; i < names.size(); ++i) names[i] = views.name(i);
  std::vector<size_t> order(names.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return names[a] < names[b]; });
  // Views without a camera's name are of a camera each.
  std::map<std::string, size_t> cameras;
  std::vector<size_t> camera_of(order.size());
  size_t camera_count = 0;
  for (size_t i = 0; i < order.size(); ++i) {
    const std::string camera = views.cameraName(order[i]);
    const bool is_new = camera.empty() || cameras.emplace(camera, camera_count).second;
    camera_of[i] = is_new ? camera_count++ : cameras.at(camera);
  }
  FitViews split;
  const bool holds_out = every > 1 && camera_count >= every;
  for (size_t i = 0; i < order.size(); ++i) {
    const bool is_held_out = holds_out && camera_of[i] % every == 0;
    (is_held_out ? split.held_out : split.training).push_back(order[i]);
  }
  return split;
}

Vec3d centreOfCameras(const ViewSource& views, std::span<const size_t> chosen) {
  Vec3d mean = Vec3d::Zero();
  for (const size_t view : chosen) mean += placeOf(views.camera(view));
  return mean / static_cast<double>(chosen.size());
}

double extentOfCameras(const ViewSource& views, std::span<const size_t> chosen) {
  const Vec3d mean = centreOfCameras(views, chosen);
  double largest = 0;
  for (const size_t view : chosen) {
    largest = std::max(largest, (placeOf(views.camera(view)) - mean).norm());
  }
  const double distance = meanDistance(views.points(), mean);
  // Rounding alone spreads cameras of one place by less than this.
  if (largest > 1e-9 * std::max(distance, mean.norm())) return 1.1 * largest;
  return distance > 0 ? distance : 1.0;
}

FitMeasure ViewMeasure::measure(const SplatCloud& cloud, PictureStore& pictures,
                                std::span<const size_t> chosen, const double background[3]) {
  SplatsOverTime splats(cloud);
  return measure(splats, pictures, chosen, background);
}

FitMeasure ViewMeasure::measure(SplatsOverTime& splats, PictureStore& pictures,
                                std::span<const size_t> chosen, const double background[3]) {
  FitMeasure mean = sumOver(splats, pictures, chosen, background, true);
  const double count = static_cast<double>(chosen.size());
  mean.psnr /= count;
  mean.foreground_psnr /= count;
  mean.ssim /= count;
  return mean;
}

double ViewMeasure::meanPsnr(SplatsOverTime& splats, PictureStore& pictures,
                             std::span<const size_t> chosen, const double background[3]) {
  return sumOver(splats, pictures, chosen, background, false).psnr /
         static_cast<double>(chosen.size());
}

const std::vector<bool>& ViewMeasure::movingOf(PictureStore& pictures, size_t view,
                                               const double background[3]) {
  const auto known = moving_.find(view);
  if (known != moving_.end()) return known->second;
  std::vector<bool> told = pictures.views().moving(view);
  if (!told.empty()) return moving_[view] = std::move(told);
  const std::vector<size_t> frames = still_cameras_->around(view);
  if (frames.empty()) return moving_[view];
  MovingPixels moving(target_.width, target_.height);
  TargetPicture frame;
  for (const size_t other : frames) {
    pictures.load(other, background, frame);
    showAll(frame.colour, pictures.views().colourSpace());
    moving.add(frame.colour);
  }
  return moving_[view] = moving.found();
}

/// Of the view that seen_ and target_ are of.
double ViewMeasure::psnrOfMoving(const std::vector<bool>& moves) {
  std::vector<float> weights(moves.size());
  for (size_t i = 0; i < moves.size(); ++i) {
    const float weight = target_.weights.empty() ? 1.0f : target_.weights[i];
    weights[i] = moves[i] ? weight : 0.0f;
  }
  return psnrOf(seen_, target_.colour, weights);
}

FitMeasure ViewMeasure::sumOver(SplatsOverTime& splats, PictureStore& pictures,
                                std::span<const size_t> chosen, const double background[3],
                                bool with_ssim) {
  FitMeasure sum;
  double moving_sum = 0;
  size_t moving_count = 0;
  RenderOptions options;
  options.with_depth = false;
  options.with_background = true;
  std::copy_n(background, 3, options.background);
  const ColourSpace space = pictures.views().colourSpace();
  for (size_t k = 0; k < chosen.size(); ++k) {
    pictures.load(chosen[k], background, target_);
    if (k + 1 < chosen.size()) pictures.prefetch(chosen[k + 1]);
    const SplatCloud& cloud = splats.at(pictures.views().time(chosen[k]));
    const SplatInstance instance{&cloud};
    sum.splat_count = cloud.size();
    images_->render({&instance, 1}, pictures.views().camera(chosen[k]), options, {}, drawn_);
    seen_.resize(target_.colour.size());
    foreground_ = target_.alpha;
    parallelFor(seen_.size() / 3, kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        for (size_t c = 0; c < 3; ++c) {
          seen_[i * 3 + c] = shown(drawn_.colour[i * 4 + c], space);
          target_.colour[i * 3 + c] = shown(target_.colour[i * 3 + c], space);
        }
        if (foreground_.empty()) continue;
        const float weight = target_.weights.empty() ? 1.0f : target_.weights[i];
        foreground_[i] = foreground_[i] > kForegroundAlpha ? weight : 0.0f;
      }
    });
    const double psnr = psnrOf(seen_, target_.colour, target_.weights);
    sum.psnr += psnr;
    if (!with_ssim) continue;
    sum.foreground_psnr += foreground_.empty() ? psnr : psnrOf(seen_, target_.colour, foreground_);
    sum.ssim += loss_
                    .evaluate(target_.width, target_.height, {seen_.data(), PixelLayout::kRgb},
                              {target_.colour.data(), PixelLayout::kRgb},
                              target_.weights.empty() ? nullptr : target_.weights.data(), {})
                    .ssim;
    if (!still_cameras_) continue;
    const std::vector<bool>& moves = movingOf(pictures, chosen[k], background);
    if (std::find(moves.begin(), moves.end(), true) == moves.end()) continue;
    moving_sum += psnrOfMoving(moves);
    ++moving_count;
  }
  sum.moving_psnr = moving_count > 0 ? moving_sum / static_cast<double>(moving_count)
                                     : std::numeric_limits<double>::quiet_NaN();
  return sum;
}

}  // namespace stipple
