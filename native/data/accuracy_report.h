#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace stipple {

/// What was made at different settings.
enum class AccuracySubject {
  kPicture,  ///< judged by the reference
  kVolume,   ///< by voxel size: its sides, judged by those of the finest
  kFit,      ///< by iterations: pictures of views that it did not learn from, judged by them
};

/// What one setting of accuracy costs, and how far its picture is from the reference.
struct AccuracyRow {
  std::string name;  ///< "preview", "final + projection ray"
  /// Knobs with their values as text, in the order in which they are shown.
  std::vector<std::pair<std::string, std::string>> knobs;
  double value =
      0;  ///< that the setting is about: voxel size, metres, or iterations; 0 of pictures
  double seconds = 0;       ///< of a picture: median of the repetitions
  double seconds_low = 0;   ///< their lower quartile
  double seconds_high = 0;  ///< and upper
  uint32_t repetitions = 0;
  bool is_estimated = false;   ///< from the pixels that were drawn, not from whole pictures
  double psnr = 0;             ///< dB, peak 1, channels that show; infinite where nothing differs
  double largest_error = 0;    ///< of any channel of any compared pixel; NaN: not known, of fits
  double error_99_9 = 0;       ///< 99.9 % of the channels of compared pixels are no further off
  uint64_t splat_count = 0;    ///< that the setting has; of volumes, voxels that are not empty
  uint64_t visible_count = 0;  ///< of them in view
  bool is_on_front = false;    ///< no other row is as fast and as good
};

struct AccuracyReport {
  AccuracySubject subject = AccuracySubject::kPicture;
  uint32_t width = 0;  ///< pixels of the picture; 0 of volumes and fits
  uint32_t height = 0;
  uint64_t compared_pixels = 0;  ///< against the reference, in blocks spread over the picture
  uint64_t splat_count = 0;      ///< of all clouds, uncut
  uint32_t thread_count = 0;
  double cut_seconds = 0;  ///< to merge clouds for the shares, once and not part of any row
  std::vector<AccuracyRow> rows;
};

}  // namespace stipple
