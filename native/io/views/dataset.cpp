#include "io/views/dataset.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "base/error.h"
#include "base/number_text.h"
#include "base/parallel.h"
#include "data/views/view_check.h"
#include "data/views/view_colour.h"
#include "data/views/view_resample.h"
#include "io/image_file.h"
#include "io/views/colmap_points.h"
#include "io/views/ply_points.h"
#include "math/empty_depth.h"

namespace stipple {

namespace {

constexpr uint32_t kMaxDownscale = 64;
constexpr size_t kPixelsPerTask = 65536;
// Between two looks at whether the caller has had enough.
constexpr size_t kHeadersAtOnce = 64;
// Integer depths of nerfstudio are millimetres.
constexpr float kMetresPerDepthUnit = 1e-3f;

/// The size of a camera whose file says none is that of its picture.
void takeSizeOfPicture(DatasetView& view) {
  Camera& camera = view.view.camera;
  if (camera.width != 0) return;
  const ImageHeader header = readImageHeader(view.image_path);
  camera = resized(camera, header.width, header.height);
}

/// Frames of a folder are not listed one by one: a fit would find another size hours later.
void requireSizesOfFrames(const std::vector<DatasetView>& views, Progress* progress) {
  std::vector<ImageHeader> headers(views.size());
  for (size_t begin = 0; begin < views.size(); begin += kHeadersAtOnce) {
    const size_t end = std::min(begin + kHeadersAtOnce, views.size());
    advance(progress, static_cast<double>(begin) / static_cast<double>(views.size()),
            "Opening images");
    parallelFor(end - begin, 1, [&](size_t from, size_t to) {
      for (size_t i = begin + from; i < begin + to; ++i) {
        if (views[i].is_of_folder) headers[i] = readImageHeader(views[i].image_path);
      }
    });
    for (size_t i = begin; i < end; ++i) {
      const Camera& camera = views[i].view.camera;
      const bool is_same = headers[i].width == camera.width && headers[i].height == camera.height;
      if (!views[i].is_of_folder || is_same) continue;
      fail(ErrorCode::kFormat, views[i].image_path + " is " +
                                   sizeText(headers[i].width, headers[i].height) +
                                   " pixels; other images of its camera are " +
                                   sizeText(camera.width, camera.height) + " pixels");
    }
  }
}

uint32_t reduced(uint32_t side, uint32_t downscale) {
  return std::max<uint32_t>(1, (side + downscale / 2) / downscale);
}

bool sameOptics(const CameraView& a, const CameraView& b) {
  const Camera &c = a.camera, &d = b.camera;
  const Lens &l = a.lens, &m = b.lens;
  return c.width == d.width && c.height == d.height && c.fx == d.fx && c.fy == d.fy &&
         c.cx == d.cx && c.cy == d.cy && l.fisheye == m.fisheye && l.radial == m.radial &&
         l.divisor == m.divisor && l.field_of_view == m.field_of_view && l.division == m.division &&
         l.tangential == m.tangential && l.prism == m.prism &&
         l.tangential_after_radial == m.tangential_after_radial;
}

/// Cameras of the pictures that are given out. Most views share one lens: it is worked out once.
std::vector<Camera> givenCameras(const std::vector<DatasetView>& views, uint32_t downscale) {
  std::vector<Camera> cameras;
  for (size_t i = 0; i < views.size(); ++i) {
    const CameraView& view = views[i].view;
    Camera camera = view.camera;
    if (view.lens.isDistorted()) {
      if (i > 0 && sameOptics(view, views[i - 1].view)) {
        const Mat4d pose = camera.world_to_camera;
        camera = cameras.back();
        camera.world_to_camera = pose;
        cameras.push_back(camera);
        continue;
      }
      try {
        camera = undistortedCamera(view.camera, view.lens);
      } catch (const Error& error) {
        fail(error.code(), views[i].image_path + ": " + error.what());
      }
    }
    cameras.push_back(
        resized(camera, reduced(camera.width, downscale), reduced(camera.height, downscale)));
  }
  return cameras;
}

void requireFinitePixels(const Image& image, const std::string& path) {
  std::vector<size_t> bad(rangeCount(image.pixels.size(), kPixelsPerTask), image.pixels.size());
  parallelFor(image.pixels.size(), kPixelsPerTask, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      if (std::isfinite(image.pixels[i])) continue;
      bad[begin / kPixelsPerTask] = i;
      return;
    }
  });
  const size_t first = *std::min_element(bad.begin(), bad.end());
  if (first == image.pixels.size()) return;
  const size_t pixel = first / image.channels;
  fail(ErrorCode::kInvalidArgument, path + ": pixel (" + std::to_string(pixel % image.width) +
                                        ", " + std::to_string(pixel / image.width) + ") holds " +
                                        std::to_string(image.pixels[first]) +
                                        "; every value must be a finite number");
}

/// Reads a picture of the size that its camera has.
Image readOfSize(const std::string& path, const Camera& camera, ImageHeader* header) {
  const ImageHeader seen = readImageHeader(path);
  if (seen.width != camera.width || seen.height != camera.height) {
    fail(ErrorCode::kFormat, path + " is " + sizeText(seen.width, seen.height) +
                                 " pixels; its camera is said to be " +
                                 sizeText(camera.width, camera.height) + " pixels");
  }
  return readImageFile(path, header);
}

/// One channel as [H,W], which is the first of them.
Image firstChannel(const Image& image) {
  if (image.channels == 1) return image;
  Image made;
  made.width = image.width;
  made.height = image.height;
  made.channels = 1;
  made.pixels.resize(image.pixelCount());
  for (size_t i = 0; i < made.pixels.size(); ++i) {
    made.pixels[i] = image.pixels[i * image.channels];
  }
  return made;
}

/// What pixels count: the mask and where the lens saw something; one of both may be empty.
std::vector<float> combined(std::vector<float> mask, const std::vector<float>& covered) {
  if (mask.empty()) return covered;
  for (size_t i = 0; i < covered.size(); ++i) mask[i] *= covered[i];
  return mask;
}

/// Means over the area of each pixel, in which every pixel counts by its weight.
Image weightedAverage(Image image, std::vector<float>& weights, uint32_t width, uint32_t height) {
  Image shares;
  shares.width = image.width;
  shares.height = image.height;
  shares.channels = 1;
  shares.pixels = std::move(weights);
  for (size_t i = 0; i < shares.pixels.size(); ++i) {
    for (size_t c = 0; c < image.channels; ++c) {
      image.pixels[i * image.channels + c] *= shares.pixels[i];
    }
  }
  image = areaAverage(image, width, height);
  weights = areaAverage(shares, width, height).pixels;
  for (size_t i = 0; i < weights.size(); ++i) {
    if (!(weights[i] > 0)) continue;
    for (size_t c = 0; c < image.channels; ++c) image.pixels[i * image.channels + c] /= weights[i];
  }
  return image;
}

std::vector<float> readDepth(const DatasetView& view, const Camera& full, const Camera& given) {
  const Camera& seen_by = view.view.camera;
  ImageHeader header;
  Image depth = firstChannel(readImageFile(view.depth_path, &header));
  const bool is_integer = header.transfer == Transfer::kSrgb;
  const float unit = is_integer ? (header.bits == 8 ? 255.0f : 65535.0f) * kMetresPerDepthUnit : 1;
  for (float& value : depth.pixels) {
    value *= unit;
    if (!(value > 0) || value >= kEmptyDepth) value = 0;
  }
  // Depths of phones have fewer pixels than their pictures.
  if (depth.width != seen_by.width || depth.height != seen_by.height) {
    depth = nearestPixels(depth, seen_by.width, seen_by.height);
  }
  if (view.view.lens.isDistorted()) {
    depth = undistort(depth, seen_by, view.view.lens, full, PixelLookup::kNearest, nullptr);
  }
  return nearestPixels(depth, given.width, given.height).pixels;
}

/// RGB apart from alpha, which is left out where it is 1 everywhere.
ViewPicture separated(Image image, std::vector<float> weights) {
  ViewPicture picture;
  picture.width = image.width;
  picture.height = image.height;
  const size_t pixels = image.pixelCount(), channels = image.channels;
  if (channels == 3) {
    picture.colour = std::move(image.pixels);
  } else {
    picture.colour.resize(pixels * 3);
    if (channels == 4) picture.alpha.resize(pixels);
    parallelFor(pixels, kPixelsPerTask, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const float* from = &image.pixels[i * channels];
        for (size_t c = 0; c < 3; ++c) picture.colour[i * 3 + c] = from[channels == 1 ? 0 : c];
        if (channels == 4) picture.alpha[i] = std::clamp(from[3], 0.0f, 1.0f);
      }
    });
  }
  const auto all_one = [](const std::vector<float>& values) {
    return std::all_of(values.begin(), values.end(), [](float value) { return value == 1.0f; });
  };
  if (all_one(picture.alpha)) picture.alpha.clear();
  if (!all_one(weights)) picture.weights = std::move(weights);
  return picture;
}

PointSet readPoints(const std::string& path) {
  const CameraFiles files = findCameraFiles(path);
  if (!files.colmap.empty()) return readColmapPoints(files.colmap);
  if (files.transforms.empty()) return {};
  const std::string& transforms = files.transforms.front();
  const std::string name = readPointsPath(transforms);
  if (name.empty()) return {};
  return readPlyPoints((std::filesystem::path(transforms).parent_path() / name).string());
}

}  // namespace

Dataset::Dataset(const std::string& path, const DatasetOptions& options, Progress* progress)
    : cache_(options.cache_bytes) {
  if (options.downscale < 1 || options.downscale > kMaxDownscale) {
    fail(ErrorCode::kInvalidArgument, "downscale is " + std::to_string(options.downscale) +
                                          "; 1 to " + std::to_string(kMaxDownscale) +
                                          " is allowed");
  }
  DatasetFiles files = findDatasetFiles(path, options.series.with_frames);
  series_ = arrangeSeries(path, options.series, files);
  views_ = std::move(files.views);
  notes_ = std::move(files.notes);
  for (size_t i = 0; i < views_.size(); ++i) {
    advance(progress, static_cast<double>(i) / static_cast<double>(views_.size()),
            "Opening images");
    takeSizeOfPicture(views_[i]);
  }
  requireSizesOfFrames(views_, progress);
  cameras_ = givenCameras(views_, options.downscale);
  const ImageHeader first = readImageHeader(views_.front().image_path);
  colour_space_ = first.transfer == Transfer::kSrgb ? ColourSpace::kDisplay : ColourSpace::kLinear;
  points_ = readPoints(path);
  choosePoints(series_, points_);
}

ViewPicture Dataset::load(size_t view) const {
  if (view >= views_.size()) {
    fail(ErrorCode::kInvalidArgument, "view " + std::to_string(view) +
                                          " was asked for; there are " +
                                          std::to_string(views_.size()) + " views, counted from 0");
  }
  if (const auto kept = cache_.find(view)) return kept->unpacked();
  // Through the same rounding as a picture that is kept: a result does not depend on the cache.
  const auto packed = std::make_shared<const PackedPicture>(read(view));
  cache_.offer(view, packed);
  return packed->unpacked();
}

std::shared_ptr<const PackedPicture> Dataset::packed(size_t view) const {
  if (view >= views_.size() || cache_.find(view)) return ViewSource::packed(view);
  ViewPicture picture = read(view);
  validateView(cameras_[view], picture, name(view));
  // Whoever loads it wants the depths, too.
  const bool has_depth = !picture.depth.empty();
  if (has_depth) cache_.offer(view, std::make_shared<const PackedPicture>(picture));
  picture.depth.clear();
  auto made = std::make_shared<const PackedPicture>(picture);
  if (!has_depth) cache_.offer(view, made);
  return made;
}

ViewPicture Dataset::read(size_t view) const {
  const DatasetView& files = views_[view];
  const Camera& seen_by = files.view.camera;
  const Camera& given = cameras_[view];
  const bool distorted = files.view.lens.isDistorted();
  ImageHeader header;
  Image image = readOfSize(files.image_path, seen_by, &header);
  if (header.transfer == Transfer::kLinear) requireFinitePixels(image, files.image_path);
  convertColours(image, colour_space_);

  std::vector<float> weights;
  Image mask;
  if (!files.mask_path.empty()) {
    mask = firstChannel(readOfSize(files.mask_path, seen_by, nullptr));
    requireFinitePixels(mask, files.mask_path);
    for (float& value : mask.pixels) value = std::clamp(value, 0.0f, 1.0f);
  }
  const Camera full = distorted ? undistortedCamera(seen_by, files.view.lens) : seen_by;
  if (distorted) {
    std::vector<float> covered;
    image = undistort(image, seen_by, files.view.lens, full, PixelLookup::kBilinear, &covered);
    if (!mask.pixels.empty()) {
      mask = undistort(mask, seen_by, files.view.lens, full, PixelLookup::kBilinear, nullptr);
    }
    weights = combined(std::move(mask.pixels), covered);
  } else {
    weights = std::move(mask.pixels);
  }
  if (given.width != full.width || given.height != full.height) {
    image = weights.empty() ? areaAverage(image, given.width, given.height)
                            : weightedAverage(std::move(image), weights, given.width, given.height);
  }
  ViewPicture picture = separated(std::move(image), std::move(weights));
  if (!files.depth_path.empty()) picture.depth = readDepth(files, full, given);
  return picture;
}

std::unique_ptr<Dataset> openDataset(const std::string& path, const DatasetOptions& options,
                                     Progress* progress) {
  return std::make_unique<Dataset>(path, options, progress);
}

}  // namespace stipple
