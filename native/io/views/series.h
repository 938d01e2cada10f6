#pragma once

#include <cstdint>
#include <limits>
#include <string>

#include "data/meshes/point_set.h"
#include "io/views/dataset_files.h"

namespace stipple {

/// Which images of a scene that moves are used, and when they were taken.
struct SeriesOptions {
  /// Numbered frames beside listed images are views, too (findDatasetFiles).
  bool with_frames = false;
  /// Frames per second, 0.001..1e6: an image of the number n was taken at n / frame_rate seconds.
  /// 0, the default: 30 where frames lie beside listed images, and else numbers in names of images
  /// say nothing. The times that a file gives always win.
  double frame_rate = 0;
  /// Frames first_frame, first_frame + frame_step and so on up to last_frame, by their numbers; the
  /// first that is there takes the place of an earlier first_frame. Where files give times, frames
  /// are counted from 0 in the order of times.
  uint64_t first_frame = 0;
  uint64_t last_frame = std::numeric_limits<uint64_t>::max();
  uint64_t frame_step = 1;  ///< at least 1
  /// At most so many images, spread evenly over frames and cameras; 0: all.
  uint64_t max_images = 0;
  /// Names of cameras, with commas between, whose views are for testing, and all others for
  /// training; empty: as the data set says.
  std::string held_out_cameras;
};

constexpr double kDefaultFrameRate = 30;

/// How many images there were before any was left out, and what is left.
struct SeriesSize {
  uint64_t image_count = 0;
  uint64_t frame_count = 0;   ///< times that differ, of those that are used
  uint64_t camera_count = 0;  ///< of those that are used: cameras with a name
  double time_begin = 0;      ///< seconds, of those that are used
  double time_end = 0;
  /// Of frames that were chosen: seconds between two of them before any was left out; 0: all are
  /// used.
  double frame_seconds = 0;
};

/// Gives views their times, names their cameras, and leaves out what is not asked for.
///
/// A camera is a folder of numbered frames; or, of views with times, those of the same place,
/// direction and lens (it stands still); or the folder that all images of a moving camera lie in,
/// where there are several such folders and no split is given. Other views have no camera's name.
/// The name is that of the folder, without `images` around it.
///
/// In, out: files, of findDatasetFiles(). Frames that some cameras lack become a note.
/// Errors: kInvalidArgument for options out of range, for frames of which none is there, and for
/// names of no camera; kFormat where an image's name has no number and other views have frames.
SeriesSize arrangeSeries(const std::string& dataset, const SeriesOptions& options,
                         DatasetFiles& files);

/// Where frames were chosen, leaves out points that were seen at other times than theirs, half a
/// frame before and behind counted in; where that leaves none, those of the nearest time stay.
/// Points of unknown times always do.
void choosePoints(const SeriesSize& size, PointSet& points);

}  // namespace stipple
