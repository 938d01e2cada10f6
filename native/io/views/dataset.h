#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/progress.h"
#include "data/views/packed_picture.h"
#include "data/views/view_source.h"
#include "io/views/dataset_files.h"
#include "io/views/series.h"

namespace stipple {

struct DatasetOptions {
  uint32_t downscale = 1;  ///< 1..64, pixels of the file along each side of a pixel, by area
  /// Pictures that stay in memory, about 3 bytes per pixel of 8-bit files, 6 of others, and
  /// a third more with alpha; the others are read
  /// again when they are wanted.
  uint64_t cache_bytes = uint64_t{1} << 30;
  SeriesOptions series = {};  ///< of scenes that move
};

/// Photographs with their cameras: COLMAP, nerfstudio's transforms.json, NeRF-synthetic or LLFF's
/// poses_bounds.npy; also several frames of each camera (series.h).
///
/// Pictures come as pinhole cameras see them: distortion is taken out at full size, then they are
/// made smaller by the mean over the area of each pixel. Both interpolate the values in which the
/// splats are composited, display values for photographs, as trainers of splats do: what is drawn
/// is compared with means of just those values.
///
/// The colour space is that of the first picture's file: display for 8 and 16 bits, scene linear
/// for float. Pictures of the other kind are converted. Where a mask is black, or the lens saw
/// nothing, the weight is 0; means count each pixel by its weight.
class Dataset final : public ViewSource {
 public:
  /// Errors: those of findDatasetFiles() and arrangeSeries(); kInvalidArgument for options out of
  /// range; kFormat for sizes that cannot be, and for numbered frames of a camera that are not all
  /// of one size; kUnsupported for lenses whose distortion cannot be taken out.
  Dataset(const std::string& path, const DatasetOptions& options, Progress* progress = nullptr);

  size_t count() const override { return views_.size(); }
  const Camera& camera(size_t view) const override { return cameras_[view]; }
  std::string name(size_t view) const override { return views_[view].view.image_path; }
  ColourSpace colourSpace() const override { return colour_space_; }
  ViewRole role(size_t view) const override { return views_[view].view.role; }
  double time(size_t view) const override { return views_[view].view.time; }
  std::string cameraName(size_t view) const override { return views_[view].camera_name; }
  /// Errors: kFormat for files that are truncated or of another size than their camera says, with
  /// their path; kInvalidArgument for a pixel that is not finite. Two threads that want one picture
  /// may both read it.
  ViewPicture load(size_t view) const override;
  /// The same as of any source, packed once.
  std::shared_ptr<const PackedPicture> packed(size_t view) const override;
  /// Of COLMAP's points3D, or of the file that `ply_file_path` of transforms.json names.
  const PointSet& points() const override { return points_; }
  /// Images that the cameras' file names and that are not there.
  std::vector<std::string> notes() const override { return notes_; }

  /// The view as its files say it: with the lens, and the size of the picture's file.
  const DatasetView& source(size_t view) const { return views_[view]; }
  const SeriesSize& series() const { return series_; }
  uint64_t cachedBytes() const { return cache_.bytes(); }

 private:
  ViewPicture read(size_t view) const;

  std::vector<DatasetView> views_;
  std::vector<std::string> notes_;
  SeriesSize series_;
  std::vector<Camera> cameras_;
  ColourSpace colour_space_ = ColourSpace::kDisplay;
  PointSet points_;
  mutable PictureCache cache_;
};

/// A data set, ready to give its pictures. In: path, as readCameraFile().
std::unique_ptr<Dataset> openDataset(const std::string& path, const DatasetOptions& options = {},
                                     Progress* progress = nullptr);

}  // namespace stipple
