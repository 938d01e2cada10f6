#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "data/clouds/splat_cloud.h"
#include "data/fit_history.h"
#include "data/views/moving_pixels.h"
#include "data/views/view_source.h"
#include "train/backend/backend_factory.h"
#include "train/loop/picture_store.h"
#include "train/loop/splats_over_time.h"
#include "train/optimiser/image_loss.h"

namespace stipple {

/// Which views a fit learns from, and which it is measured on.
struct FitViews {
  std::vector<size_t> training;  ///< ascending names
  std::vector<size_t> held_out;  ///< the same
};

/// Every `every`-th view by name is held out, the first one too, as published results do it. Where
/// cameras took several views (ViewSource::cameraName), every `every`-th camera is, with all its
/// views: who learns from a camera at other times has seen most of what it is judged by.
/// In: every: 0: none. Where there are fewer than `every` views or cameras, none is held out.
FitViews splitViews(const ViewSource& views, uint64_t every);

/// Mean place of the cameras, metres. In: chosen: at least one.
Vec3d centreOfCameras(const ViewSource& views, std::span<const size_t> chosen);

/// 1.1 times the largest distance of a camera from the mean of all, metres: the unit of published
/// learning rates of positions. Cameras of one place: their mean distance to the known points, and
/// 1 where there are none. In: chosen: at least one.
double extentOfCameras(const ViewSource& views, std::span<const size_t> chosen);

/// Compares drawings of splats with views.
class ViewMeasure {
 public:
  explicit ViewMeasure(const BackendFactory& backends) : images_(backends.makeImageRenderer()) {}

  /// From now on measures also tell the pixels apart in which something moves, of views of these:
  /// by what the views say (ViewSource::moving), else other frames of a measured view's camera are
  /// looked at for that, once. Every store that is measured with must be of them.
  void tellMoving(const ViewSource& views) { still_cameras_.emplace(views); }

  /// Mean PSNR and SSIM over views. Colours are held to 0..1 and compared in display space; SSIM as
  /// image_loss.h has it. Views with alpha stand over `background`. Pixels that a mask leaves out
  /// count for nothing.
  /// In: splats, each view's at its time; chosen: views of the store, at least one. Out: PSNR, SSIM
  /// and the count; the rest is left alone.
  FitMeasure measure(SplatsOverTime& splats, PictureStore& pictures, std::span<const size_t> chosen,
                     const double background[3]);
  FitMeasure measure(const SplatCloud& cloud, PictureStore& pictures,
                     std::span<const size_t> chosen, const double background[3]);
  /// PSNR of the same alone.
  double meanPsnr(SplatsOverTime& splats, PictureStore& pictures, std::span<const size_t> chosen,
                  const double background[3]);

 private:
  FitMeasure sumOver(SplatsOverTime& splats, PictureStore& pictures, std::span<const size_t> chosen,
                     const double background[3], bool with_ssim);

  /// [H,W]; empty where nothing is known.
  const std::vector<bool>& movingOf(PictureStore& pictures, size_t view,
                                    const double background[3]);
  double psnrOfMoving(const std::vector<bool>& moves);

  std::unique_ptr<ImageRenderer> images_;
  std::optional<StillCameras> still_cameras_;
  std::map<size_t, std::vector<bool>> moving_;  ///< [H,W] by view
  RenderResult drawn_;
  ImageLoss loss_;
  TargetPicture target_;
  std::vector<float> seen_;        ///< [H,W,3]
  std::vector<float> foreground_;  ///< [H,W]
};

}  // namespace stipple
