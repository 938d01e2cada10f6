#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "math/camera.h"
#include "math/vec.h"
#include "train/backend/backend_factory.h"

namespace stipple {

/// A view whose image tells what detail there is.
struct DetailView {
  Camera camera;             ///< with an image plane
  std::vector<float> image;  ///< [H,W,3] over black, in the cloud's colour space
  std::vector<float> alpha;  ///< [H,W]; empty: 1 everywhere
};

/// A splat in its own axes, from the longest to the shortest, right-handed.
struct OrderedSplat {
  Mat3d axes = Mat3d::Identity();            ///< columns
  Vec3d scales = Vec3d::Ones();              ///< descending, held above kLeastRawScale
  std::array<size_t, 3> stored = {0, 1, 2};  ///< which axis of the cloud each is
};
OrderedSplat orderedSplat(const SplatCloud& cloud, size_t splat);

/// Numbers that a splat tells of itself, and that a view tells of it.
constexpr size_t kOwnWidth = 24;
/// Places of a splat that views are looked at: its middle, and four around it in its plane.
constexpr size_t kSeenPlaces = 5;
constexpr size_t kSeenWidth = 9 * kSeenPlaces + 4;

/// What views tell of coarse splats, before any network.
struct CoarseEvidence {
  std::vector<double> scores;    ///< [splats] how much their places matter to the error of images
  std::vector<uint32_t> points;  ///< splats that become finer, ascending
  size_t views = 0;
  std::vector<float> own;      ///< [points, kOwnWidth]
  std::vector<float> seen;     ///< [points, views, kSeenWidth]; 0 where not in the image
  std::vector<uint8_t> shows;  ///< [points, views] whether its middle is in the image
  std::vector<float> places;   ///< [points,3] for the network, about the middle of the cloud
  double side = 0;             ///< of a cell there
};

/// Draws coarse splats into views, and finds what the images say of those that matter most: the
/// `wanted` splats with the largest sums over pixels and views of the absolute derivative of the
/// mean squared error by the projected centre, of equal ones the first. Each brings attributes
/// relative to the median scale, the derivatives of that error by them, and of each view at its
/// middle and around it: colours of the image, colours and coverage of the splats, how far the
/// splat is behind what shows, coverage of the image; then how large it is there and where it is
/// seen from. All of it stays the same where cloud and cameras are moved and scaled together.
/// In: cloud: one splat or more; views: one or more; wanted >= 1. Errors: kInvalidArgument for an
/// empty cloud, a camera without an image plane, images of another size; kCancelled. Threads and
/// determinism: same bits for any number of threads. Cost: two drawings and a backward pass of
/// each view.
CoarseEvidence gatherEvidence(const BackendFactory& backends, const SplatCloud& cloud,
                              std::span<const DetailView> views, size_t wanted,
                              Progress* progress = nullptr);

}  // namespace stipple
