#include "fit/fit_memory.h"

#include <algorithm>
#include <string>

#include "base/error.h"
#include "train/loop/explicit_model.h"

namespace stipple {

namespace {

constexpr uint64_t kFloatBytes = sizeof(float);
/// A kept image: colour, alpha and mask, in 4 bytes each at worst.
constexpr uint64_t kKeptFloats = 5;
/// At work: one image being loaded and one waiting, with depth and normals (9 floats), the target
/// (5), what is drawn (4), its derivative (4), what drawing keeps (16) and the loss (4).
constexpr uint64_t kWorkingFloats = 2 * 9 + 5 + 4 + 4 + 16 + 4;
/// Telling which pixels of a series move: another image, and the least and most of each colour.
constexpr uint64_t kMovingFloats = 5 + 6;
/// Numbers of a splat beside its harmonics.
constexpr uint64_t kRowFloats = 11;
/// Density control: parameters, two moments, derivatives twice and what is drawn, with a quarter of
/// spare room; the cloud that comes out.
constexpr uint64_t kDensifyRows = 10;
/// What drawing a splat keeps.
constexpr uint64_t kDrawingBytes = 150;

uint64_t bytesOfSplat(const FitOptions& options) {
  return bytesPerSplat(static_cast<int>(options.sh_degree), options.model == FitKind::kMotion);
}

}  // namespace

uint64_t pictureMemoryBound(const ViewSource& views, uint64_t picture_bytes) {
  uint64_t all_pixels = 0, largest = 0, working = kWorkingFloats;
  for (size_t v = 0; v < views.count(); ++v) {
    const Camera& camera = views.camera(v);
    const uint64_t pixels = uint64_t{camera.width} * camera.height;
    all_pixels += pixels;
    largest = std::max(largest, pixels);
    if (!views.cameraName(v).empty()) working = kWorkingFloats + kMovingFloats;
  }
  const uint64_t kept = std::min(picture_bytes, all_pixels * kKeptFloats * kFloatBytes);
  return kept + largest * working * kFloatBytes;
}

uint64_t fitMemoryBound(const FitOptions& options, const ViewSource& views) {
  const uint64_t count = isOfAnchors(options.model)
                             ? options.most_anchors * options.gaussians_per_anchor
                             : options.max_splats;
  // Two key frames are drawn at once.
  const uint64_t at_once = options.model == FitKind::kRelay ? 2 : 1;
  return pictureMemoryBound(views, options.picture_bytes) + at_once * count * bytesOfSplat(options);
}

void holdToMemory(FitOptions& options, const ViewSource& views) {
  const uint64_t limit = options.max_bytes;
  if (limit == 0) return;
  options.picture_bytes = std::min(options.picture_bytes, limit / 2);
  const auto refuse = [&](uint64_t needed, const std::string& what) {
    fail(ErrorCode::kMemoryLimit, "options->max_bytes is " + std::to_string(limit) + "; " + what +
                                      " and the images at work take about " +
                                      std::to_string(needed));
  };
  if (isOfAnchors(options.model)) {
    const uint64_t needed = fitMemoryBound(options, views);
    if (needed > limit) refuse(needed, std::to_string(options.most_anchors) + " anchors");
    return;
  }
  const uint64_t pictures = pictureMemoryBound(views, options.picture_bytes);
  const uint64_t room = limit > pictures ? limit - pictures : 0;
  const uint64_t each = bytesOfSplat(options);
  if (room < each) refuse(pictures + each, "one splat");
  options.max_splats = std::min(options.max_splats, room / each);
  options.start_splats = std::min(options.start_splats, options.max_splats);
}

uint64_t densifyMemoryBound(const SplatCloud& cloud, const ViewSource& views,
                            const DensifyOptions& options) {
  const uint64_t row = (kRowFloats + cloud.shStride()) * kFloatBytes;
  // Sweeps draw once more beside the pass.
  return 2 * pictureMemoryBound(views, options.picture_bytes) +
         densifyLimit(cloud.size(), options) * (row * kDensifyRows + 2 * kDrawingBytes);
}

}  // namespace stipple
