#include "fit/image_likeness.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <optional>
#include <vector>

#include "data/clouds/cloud_extent.h"
#include "math/camera_rig.h"
#include "math/colour.h"

namespace stipple {

namespace {

constexpr uint32_t kSide = 64;  ///< pixels of what is compared
constexpr float kShows = 0.5f;  ///< alpha from which on a pixel belongs to the box
/// Images show objects from about as far: the published views have 40 degrees.
constexpr double kAngle = 40 * std::numbers::pi / 180;
constexpr double kHighest = 100;  ///< dB

constexpr uint32_t kBoxSide = 128;  ///< pixels of what the box is found in

/// Directions that are looked from at first, in even steps of both angles. About the best few of
/// them, none beside another, the steps are halved.
constexpr int kAzimuths = 36;
constexpr int kElevations = 12;
constexpr double kLowest = -60, kElevationStep = 12.5;  ///< degrees
constexpr double kSteepest = 88;
constexpr size_t kStarts = 5;
constexpr int kHalvings = 3;
/// Then the box is moved and made larger, in these steps, halved once.
constexpr double kShift = 1.5 / kSide;
constexpr double kGrowth = 0.03;

struct Direction {
  double azimuth = 0, elevation = 0;  ///< degrees

  Vec3d outward() const {
    constexpr double kRadians = std::numbers::pi / 180;
    const double level = std::cos(elevation * kRadians);
    return {level * std::cos(azimuth * kRadians), level * std::sin(azimuth * kRadians),
            std::sin(elevation * kRadians)};
  }
};

/// The image with kSide pixels a side, each the mean of what it covers. Returns: [kSide, kSide, 3]
/// 0..1.
std::vector<float> reduced(const PreparedImage& image) {
  std::vector<float> means(kSide * kSide * 3, 0.0f);
  const double step = static_cast<double>(image.size) / kSide;
  for (uint32_t y = 0; y < kSide; ++y) {
    for (uint32_t x = 0; x < kSide; ++x) {
      // Pixels by how much of them lies in the square.
      double weight = 0;
      std::array<double, 3> sum = {0, 0, 0};
      const double left = x * step, right = (x + 1) * step, top = y * step, low = (y + 1) * step;
      for (auto row = static_cast<uint32_t>(top); row < std::min<double>(low, image.size); ++row) {
        const double tall = std::min<double>(low, row + 1) - std::max<double>(top, row);
        for (auto column = static_cast<uint32_t>(left);
             column < std::min<double>(right, image.size); ++column) {
          const double share =
              tall * (std::min<double>(right, column + 1) - std::max<double>(left, column));
          const uint8_t* pixel = &image.rgb[(size_t{row} * image.size + column) * 3];
          for (size_t c = 0; c < 3; ++c) sum[c] += share * pixel[c];
          weight += share;
        }
      }
      for (size_t c = 0; c < 3; ++c) {
        means[(y * kSide + x) * 3 + c] = static_cast<float>(sum[c] / (255 * weight));
      }
    }
  }
  return means;
}

/// Compares a cloud with one image from any direction.
class Likeness {
 public:
  Likeness(const ImageRendererFactory& images, const SplatCloud& cloud, const PreparedImage& image)
      : images_(images.makeImageRenderer()),
        cloud_(cloud),
        extent_(cloudExtent(cloud)),
        wanted_(reduced(image)) {
    options_.with_depth = false;
  }

  /// A camera that cuts out what shows, with the margin. Nothing: nothing shows.
  std::optional<Camera> cutOut(const Direction& direction) {
    Camera camera = upright(direction);
    draw(camera);
    uint32_t x0 = kBoxSide, y0 = kBoxSide, x1 = 0, y1 = 0;
    for (uint32_t y = 0; y < kBoxSide; ++y) {
      for (uint32_t x = 0; x < kBoxSide; ++x) {
        if (result_.colour[(y * kBoxSide + x) * 4 + 3] < kShows) continue;
        x0 = std::min(x0, x);
        y0 = std::min(y0, y);
        x1 = std::max(x1, x + 1);
        y1 = std::max(y1, y + 1);
      }
    }
    if (x0 >= x1) return std::nullopt;
    camera.width = camera.height = kSide;
    const double zoom = kSide / (kObjectMargin * std::max(x1 - x0, y1 - y0));
    camera.fx *= zoom;
    camera.fy *= zoom;
    camera.cx = 0.5 * kSide + zoom * (camera.cx - 0.5 * (x0 + x1));
    camera.cy = 0.5 * kSide + zoom * (camera.cy - 0.5 * (y0 + y1));
    return camera;
  }

  /// dB.
  double with(const Camera& camera) {
    draw(camera);
    const bool is_linear = cloud_.colour_space != ColourSpace::kDisplay;
    double squares = 0;
    for (size_t i = 0; i < size_t{kSide} * kSide; ++i) {
      const float alpha = result_.colour[i * 4 + 3];
      for (size_t c = 0; c < 3; ++c) {
        float value = result_.colour[i * 4 + c];
        // Files have alpha in display space, where prepareImage() lays it on black.
        if (is_linear && alpha > 0) value = alpha * linearToSrgb(value / alpha);
        const double off = static_cast<double>(std::clamp(value, 0.0f, 1.0f) - wanted_[i * 3 + c]);
        squares += off * off;
      }
    }
    const double mean = squares / static_cast<double>(wanted_.size());
    return std::clamp(-10 * std::log10(std::max(mean, 1e-10)), 0.0, kHighest);
  }

  /// dB; 0 where nothing shows.
  double from(const Direction& direction) {
    const std::optional<Camera> camera = cutOut(direction);
    return camera ? with(*camera) : 0;
  }

 private:
  /// All of the cloud, with z upwards in the image.
  Camera upright(const Direction& direction) const {
    const Vec3d outward = direction.outward();
    const Vec3d centre(extent_.centre[0], extent_.centre[1], extent_.centre[2]);
    const double distance = extent_.radius / std::sin(0.5 * kAngle);
    Camera camera =
        cameraAlong(centre + distance * outward, -outward, Vec3d::UnitZ(), kAngle, kBoxSide);
    camera.near_plane = 1e-3 * extent_.radius;
    camera.far_plane = std::max(camera.far_plane, 1e3 * extent_.radius);
    return camera;
  }

  void draw(const Camera& camera) {
    const SplatInstance instance{&cloud_};
    images_->render({&instance, 1}, camera, options_, {}, result_);
  }

  std::unique_ptr<ImageRenderer> images_;
  const SplatCloud& cloud_;
  CloudExtent extent_;
  std::vector<float> wanted_;  ///< [kSide, kSide, 3]
  RenderOptions options_;
  RenderResult result_;
};

/// A direction with what was found from there.
struct Found {
  double likeness = -1;
  Direction direction;
};

bool areBeside(const Direction& a, const Direction& b) {
  return a.outward().dot(b.outward()) > std::cos(1.6 * kElevationStep * std::numbers::pi / 180);
}

/// The best few directions of all, none beside another, from the best one down.
std::vector<Found> startsOf(std::vector<Found> all) {
  std::stable_sort(all.begin(), all.end(),
                   [](const Found& a, const Found& b) { return a.likeness > b.likeness; });
  std::vector<Found> starts;
  for (const Found& one : all) {
    const bool is_known = std::any_of(starts.begin(), starts.end(), [&](const Found& other) {
      return areBeside(one.direction, other.direction);
    });
    if (!is_known) starts.push_back(one);
    if (starts.size() == kStarts) break;
  }
  return starts;
}

/// Steps of both angles about a direction, halved again and again.
Found climbed(Likeness& likeness, Found best) {
  double azimuth_step = 360.0 / kAzimuths, elevation_step = kElevationStep;
  for (int halving = 0; halving < kHalvings; ++halving) {
    azimuth_step /= 2;
    elevation_step /= 2;
    const Direction middle = best.direction;
    for (int up = -1; up <= 1; ++up) {
      for (int around = -1; around <= 1; ++around) {
        if (up == 0 && around == 0) continue;
        const Direction next = {
            middle.azimuth + around * azimuth_step,
            std::clamp(middle.elevation + up * elevation_step, -kSteepest, kSteepest)};
        const double found = likeness.from(next);
        if (found > best.likeness) best = {found, next};
      }
    }
  }
  return best;
}

/// The box of what shows is known to a pixel alone: it is moved and made larger and smaller.
ImageLikeness aligned(Likeness& likeness, const Found& found) {
  ImageLikeness best = {found.likeness, likeness.cutOut(found.direction)};
  if (!best.camera) return {};
  for (const double size : {1.0, 0.5}) {
    const Camera middle = *best.camera;
    for (int grow = -1; grow <= 1; ++grow) {
      for (int right = -1; right <= 1; ++right) {
        for (int down = -1; down <= 1; ++down) {
          Camera moved = middle;
          const double zoom = 1 + size * kGrowth * grow;
          moved.fx *= zoom;
          moved.fy *= zoom;
          moved.cx = 0.5 * kSide + zoom * (middle.cx - 0.5 * kSide) + size * kShift * kSide * right;
          moved.cy = 0.5 * kSide + zoom * (middle.cy - 0.5 * kSide) + size * kShift * kSide * down;
          const double now = likeness.with(moved);
          if (now > best.psnr) best = {now, moved};
        }
      }
    }
  }
  return best;
}

}  // namespace

ImageLikeness imageLikeness(const ImageRendererFactory& images, const SplatCloud& cloud,
                            const PreparedImage& image, Progress* progress) {
  if (cloud.size() == 0) return {};
  Likeness likeness(images, cloud, image);
  std::vector<Found> all;
  for (int up = 0; up < kElevations; ++up) {
    if (progress) progress->throwIfCancelled();
    for (int i = 0; i < kAzimuths; ++i) {
      const Direction direction = {i * 360.0 / kAzimuths, kLowest + up * kElevationStep};
      all.push_back({likeness.from(direction), direction});
    }
  }
  ImageLikeness best;
  for (const Found& start : startsOf(std::move(all))) {
    if (progress) progress->throwIfCancelled();
    if (start.likeness <= 0) continue;
    const ImageLikeness found = aligned(likeness, climbed(likeness, start));
    if (found.psnr > best.psnr) best = found;
  }
  return best;
}

}  // namespace stipple
