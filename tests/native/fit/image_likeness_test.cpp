#include "fit/image_likeness.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "math/camera_rig.h"
#include "math/colour.h"
#include "train/backend/backend_factory.h"

namespace stipple {
namespace {

constexpr size_t kEach = 40;

/// Three arms of different lengths and colours: no two directions show the same.
SplatCloud arms(const std::array<std::array<float, 3>, 3>& colours) {
  constexpr std::array<float, 3> kLengths = {1.0f, 0.7f, 0.5f};
  SplatCloud cloud;
  cloud.resize(3 * kEach);
  for (size_t i = 0; i < cloud.size(); ++i) {
    const size_t arm = i / kEach;
    const float share = static_cast<float>(i % kEach) / kEach;
    for (size_t axis = 0; axis < 3; ++axis) {
      cloud.positions[i * 3 + axis] = axis == arm ? kLengths[arm] * share : 0.0f;
      cloud.scales[i * 3 + axis] = 0.05f;
      cloud.sh[i * 3 + axis] = (colours[arm][axis] - 0.5f) / static_cast<float>(kShC0);
    }
    cloud.rotations[i * 4] = 1.0f;
    cloud.opacities[i] = 0.95f;
  }
  return cloud;
}

constexpr std::array<std::array<float, 3>, 3> kColours = {
    {{0.9f, 0.2f, 0.1f}, {0.1f, 0.8f, 0.3f}, {0.2f, 0.3f, 0.9f}}};

/// The cloud as an image shows it, from a direction that no search looks along exactly.
PreparedImage imageOf(const SplatCloud& cloud) {
  constexpr uint32_t kSize = 256;
  const Vec3d outward = Vec3d(0.7, 0.55, 0.42).normalized();
  RenderResult result;
  RenderOptions options;
  const SplatInstance instance{&cloud};
  const Camera camera =
      cameraAlong(Vec3d(0.3, 0.3, 0.2) + 3 * outward, -outward, Vec3d::UnitZ(), 0.7, kSize);
  cpuBackends()->makeImageRenderer()->render({&instance, 1}, camera, options, {}, result);
  ByteImage image = {kSize, kSize, 4, std::vector<uint8_t>(size_t{kSize} * kSize * 4)};
  for (size_t i = 0; i < size_t{kSize} * kSize; ++i) {
    const float alpha = result.colour[i * 4 + 3];
    for (size_t c = 0; c < 4; ++c) {
      const float value = c == 3 ? alpha : result.colour[i * 4 + c] / std::max(alpha, 1e-3f);
      image.pixels[i * 4 + c] =
          static_cast<uint8_t>(std::lround(255 * std::clamp(value, 0.0f, 1.0f)));
    }
  }
  PreparationOptions preparation;
  preparation.canvas_size = 128;
  return prepareImage(image, nullptr, preparation);
}

double likeness(const SplatCloud& cloud, const PreparedImage& image) {
  return imageLikeness(*cpuBackends(), cloud, image).psnr;
}

// Its own image is reached to within the angle of the last halving (3 degrees) and a pixel of the
// box; what is mirrored or has other colours stays far behind.
TEST(ImageLikeness, IsHighestForWhatTheImageShows) {
  const SplatCloud cloud = arms(kColours);
  const PreparedImage image = imageOf(cloud);
  const double own = likeness(cloud, image);
  EXPECT_GT(own, 22);
  EXPECT_LT(likeness(arms({kColours[0], kColours[2], kColours[1]}), image), own - 4);
  EXPECT_LT(likeness(arms({kColours[1], kColours[0], kColours[2]}), image), own - 4);
  SplatCloud mirrored = cloud;
  for (size_t i = 0; i < cloud.size(); ++i) mirrored.positions[i * 3] *= -1;
  EXPECT_LT(likeness(mirrored, image), own - 3);
}

// Neither where it stands, nor how large it is, nor which way it is turned about the vertical.
TEST(ImageLikeness, DoesNotDependOnThePlace) {
  const SplatCloud cloud = arms(kColours);
  const PreparedImage image = imageOf(cloud);
  SplatCloud placed = cloud;
  constexpr float kScale = 30;
  const float c = std::cos(1.3f), s = std::sin(1.3f);
  for (size_t i = 0; i < cloud.size(); ++i) {
    const float* p = &cloud.positions[i * 3];
    placed.positions[i * 3] = kScale * (c * p[0] - s * p[1]) + 400;
    placed.positions[i * 3 + 1] = kScale * (s * p[0] + c * p[1]) - 50;
    placed.positions[i * 3 + 2] = kScale * p[2] + 7;
    for (size_t axis = 0; axis < 3; ++axis) placed.scales[i * 3 + axis] *= kScale;
  }
  EXPECT_NEAR(likeness(placed, image), likeness(cloud, image), 1.5);
}

TEST(ImageLikeness, LinearColoursAreComparedAsTheyLook) {
  const SplatCloud cloud = arms(kColours);
  SplatCloud linear = cloud;
  linear.colour_space = ColourSpace::kLinear;
  for (float& value : linear.sh) {
    const float shown = 0.5f + static_cast<float>(kShC0) * value;
    value = (srgbToLinear(shown) - 0.5f) / static_cast<float>(kShC0);
  }
  const PreparedImage image = imageOf(cloud);
  EXPECT_NEAR(likeness(linear, image), likeness(cloud, image), 1.5);
}

TEST(ImageLikeness, IsNothingWhereNothingShows) {
  const PreparedImage image = imageOf(arms(kColours));
  EXPECT_EQ(likeness(SplatCloud(), image), 0);
  SplatCloud faint = arms(kColours);
  std::fill(faint.opacities.begin(), faint.opacities.end(), 0.001f);
  EXPECT_EQ(likeness(faint, image), 0);
}

TEST(ImageLikeness, EndsWhenItIsCancelled) {
  const SplatCloud cloud = arms(kColours);
  Progress progress;
  progress.cancel();
  EXPECT_ANY_THROW(imageLikeness(*cpuBackends(), cloud, imageOf(cloud), &progress));
}

}  // namespace
}  // namespace stipple
