// Based on: Nam et al., Generative Densification, CVPR 2025: which splats become finer, and what
// images say of them. Differs: there is no backbone; a splat's attributes and the derivatives of
// the error by them stand in its place. Views are looked at in five places of a splat, not one.
#include "train/detail/coarse_evidence.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "densify/raw_splats.h"
#include "math/empty_depth.h"
#include "math/quaternion.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 64;
/// Places around the middle, in standard deviations along the two longer axes.
constexpr double kAround = 0.6;
constexpr double kPlaces[kSeenPlaces][2] = {
    {0, 0}, {kAround, kAround}, {kAround, -kAround}, {-kAround, kAround}, {-kAround, -kAround}};
/// Kinds of attributes whose derivatives have a size of their own.
constexpr size_t kMoved = 10;
constexpr size_t kKindOf[kMoved] = {0, 0, 0, 1, 1, 1, 2, 3, 3, 3};
/// Of a cell of the network. Offsets of up to half of it are encoded by sines of up to 2^14 times
/// them: the fastest one goes round about once, and none so often that it says nothing.
constexpr double kSide = 0x1.0p-11;
/// Of its middle on an axis, in cells: farther splats are counted there.
constexpr double kFarthest = 16000;

/// What a drawing of the splats shows.
struct Drawing {
  RenderResult splats;
  const DetailView* view = nullptr;
};

Vec3d positionOf(const SplatCloud& cloud, size_t splat) {
  const float* at = &cloud.positions[splat * 3];
  return {static_cast<double>(at[0]), static_cast<double>(at[1]), static_cast<double>(at[2])};
}

/// Sums over views: scores, and derivatives by attributes in each splat's own axes.
struct Derivatives {
  std::vector<double> scores;                      ///< [splats]
  std::vector<std::array<double, kMoved>> values;  ///< by place, log scales, logit, colour
};

/// [H,W,4] of the mean squared error by the image, whose value is sum / (3 H W).
std::vector<float> errorGradient(std::span<const float> drawn, const DetailView& view) {
  const size_t pixels = view.image.size() / 3;
  const float factor = 2.0f / static_cast<float>(view.image.size());
  std::vector<float> by(pixels * 4, 0.0f);
  for (size_t i = 0; i < pixels; ++i) {
    for (size_t c = 0; c < 3; ++c) {
      by[i * 4 + c] = factor * (drawn[i * 4 + c] - view.image[i * 3 + c]);
    }
  }
  return by;
}

void addView(const SplatCloud& cloud, std::span<const OrderedSplat> splats, const DetailView& view,
             ViewPass& pass, Derivatives& sums) {
  StatisticRequest request;
  request.absolute_screen_gradients = true;
  pass.backward(request);
  SplatCloud by;
  pass.swapGradients(by);
  const std::span<const float> screen = pass.statistic(Statistic::kAbsoluteScreenGradients);
  const double half_width = 0.5 * view.camera.width, half_height = 0.5 * view.camera.height;
  parallelFor(cloud.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t n = begin; n < end; ++n) {
      sums.scores[n] += std::hypot(half_width * static_cast<double>(screen[n * 2]),
                                   half_height * static_cast<double>(screen[n * 2 + 1]));
      std::array<double, kMoved>& to = sums.values[n];
      const Vec3d by_place = splats[n].axes.transpose() * positionOf(by, n);
      for (int axis = 0; axis < 3; ++axis) {
        const auto k = static_cast<size_t>(axis);
        to[k] += by_place[axis] * splats[n].scales[axis];
        const size_t from = n * 3 + splats[n].stored[k];
        to[3 + k] += static_cast<double>(by.scales[from]) * static_cast<double>(cloud.scales[from]);
        to[7 + k] += static_cast<double>(by.sh[n * cloud.shStride() + k]);
      }
      const auto opacity = static_cast<double>(cloud.opacities[n]);
      to[6] += static_cast<double>(by.opacities[n]) * opacity * (1 - opacity);
    }
  });
  pass.swapGradients(by);
}

/// Divides derivatives by their root mean square, kind by kind, and shortens those that stand out.
void level(Derivatives& sums) {
  std::array<double, 4> squares = {}, counts = {};
  for (const std::array<double, kMoved>& values : sums.values) {
    for (size_t i = 0; i < kMoved; ++i) {
      squares[kKindOf[i]] += values[i] * values[i];
      counts[kKindOf[i]] += 1;
    }
  }
  for (std::array<double, kMoved>& values : sums.values) {
    for (size_t i = 0; i < kMoved; ++i) {
      const double size = std::sqrt(squares[kKindOf[i]] / counts[kKindOf[i]]);
      values[i] = size > 0 ? std::asinh(values[i] / size) : 0.0;
    }
  }
}

std::vector<uint32_t> largest(std::span<const double> scores, size_t wanted) {
  std::vector<uint32_t> order(scores.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(),
                   [&](uint32_t a, uint32_t b) { return scores[a] > scores[b]; });
  order.resize(std::min(wanted, order.size()));
  std::sort(order.begin(), order.end());
  return order;
}

template <class T>
T middleOf(std::vector<T> values, double share = 0.5) {
  const auto at =
      values.begin() + static_cast<ptrdiff_t>(share * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// Where a place shows in an image, pixels, and its planar depth; false: behind the camera.
bool project(const Camera& camera, const Vec3d& place, double& x, double& y, double& depth) {
  const Mat4d& to = camera.world_to_camera;
  const Vec3d seen = to.block<3, 3>(0, 0) * place + to.block<3, 1>(0, 3);
  depth = seen[2];
  if (!(depth > camera.near_plane)) return false;
  const double divisor = camera.model == CameraModel::kOrthographic ? 1.0 : depth;
  x = camera.fx * seen[0] / divisor + camera.cx;
  y = camera.fy * seen[1] / divisor + camera.cy;
  return true;
}

/// Bilinear, held at the borders. In: values [H,W,channels].
double sampled(const Camera& camera, const float* values, size_t channels, size_t channel, double x,
               double y) {
  const auto hold = [](double at, uint32_t size) {
    return std::clamp(at - 0.5, 0.0, static_cast<double>(size - 1));
  };
  const double column = hold(x, camera.width), row = hold(y, camera.height);
  const auto left = static_cast<size_t>(column), top = static_cast<size_t>(row);
  const size_t right = std::min<size_t>(left + 1, camera.width - 1);
  const size_t bottom = std::min<size_t>(top + 1, camera.height - 1);
  const double u = column - static_cast<double>(left), v = row - static_cast<double>(top);
  const auto at = [&](size_t r, size_t c) {
    return static_cast<double>(values[(r * camera.width + c) * channels + channel]);
  };
  return (1 - v) * ((1 - u) * at(top, left) + u * at(top, right)) +
         v * ((1 - u) * at(bottom, left) + u * at(bottom, right));
}

/// Out: to [kSeenWidth]; false where the middle is not in the image.
bool look(const Drawing& drawing, const OrderedSplat& splat, const Vec3d& place, float* to) {
  const DetailView& view = *drawing.view;
  const Camera& camera = view.camera;
  double x = 0, y = 0, middle_depth = 0;
  if (!project(camera, place, x, y, middle_depth)) return false;
  if (!(x >= 0 && x < camera.width && y >= 0 && y < camera.height)) return false;
  for (const auto& around : kPlaces) {
    const Vec3d at =
        place + splat.axes * Vec3d(around[0] * splat.scales[0], around[1] * splat.scales[1], 0.0);
    double depth = 0;
    if (!project(camera, at, x, y, depth)) depth = middle_depth;
    const float* const drawn = drawing.splats.colour.data();
    for (size_t c = 0; c < 3; ++c) {
      to[c] = static_cast<float>(sampled(camera, view.image.data(), 3, c, x, y));
      to[3 + c] = static_cast<float>(sampled(camera, drawn, 4, c, x, y)) - to[c];
    }
    to[6] = static_cast<float>(sampled(camera, drawn, 4, 3, x, y));
    // Planar depth of one pixel: a mean over a border would be of nothing that there is.
    const auto column = static_cast<size_t>(std::clamp(x, 0.0, camera.width - 1.0));
    const auto row = static_cast<size_t>(std::clamp(y, 0.0, camera.height - 1.0));
    const auto front = static_cast<double>(drawing.splats.depth[row * camera.width + column]);
    const bool is_covered = front < static_cast<double>(kEmptyDepth);
    to[7] = is_covered ? static_cast<float>(std::asinh(4 * (depth - front) / splat.scales[0]) / 4)
                       : 0.0f;
    to[8] = view.alpha.empty() ? 1.0f
                               : static_cast<float>(sampled(camera, view.alpha.data(), 1, 0, x, y));
    to += 9;
  }
  const bool is_flat = camera.model == CameraModel::kOrthographic;
  const Vec3d forward = camera.world_to_camera.block<1, 3>(2, 0).transpose();
  const Vec3d away = is_flat ? Vec3d(-forward) : Vec3d(cameraCentre(camera) - place).normalized();
  const Vec3d turned = splat.axes.transpose() * away;
  for (int axis = 0; axis < 3; ++axis) to[axis] = static_cast<float>(turned[axis]);
  const double pixels = camera.fx * splat.scales[0] / (is_flat ? 1.0 : middle_depth);
  to[3] = static_cast<float>(0.5 * std::log(std::max(pixels, 1e-3)));
  return true;
}

/// Out: to [kOwnWidth].
void describe(const SplatCloud& cloud, size_t n, const OrderedSplat& splat, double median_scale,
              const std::array<double, kMoved>& moved, double score, float* to) {
  for (size_t c = 0; c < 3; ++c) *to++ = kShC0 * cloud.sh[n * cloud.shStride() + c];
  *to++ = 0.25f * rawOpacity(cloud.opacities[n]);
  for (int axis = 0; axis < 3; ++axis) {
    *to++ = static_cast<float>(0.5 * std::log(splat.scales[axis] / median_scale));
  }
  for (const int axis : {0, 2}) {
    for (int i = 0; i < 3; ++i) *to++ = static_cast<float>(splat.axes(i, axis));
  }
  for (const double value : moved) *to++ = static_cast<float>(value);
  *to++ = static_cast<float>(score);
}

/// Where points are for the network: a cell is twice as long as the usual splat.
void place(const SplatCloud& cloud, double median_scale, CoarseEvidence& made) {
  made.side = kSide;
  Vec3d middle;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<float> values(cloud.size());
    for (size_t n = 0; n < cloud.size(); ++n) {
      values[n] = cloud.positions[n * 3 + static_cast<size_t>(axis)];
    }
    middle[axis] = static_cast<double>(middleOf(std::move(values)));
  }
  for (const uint32_t point : made.points) {
    const Vec3d at = (positionOf(cloud, point) - middle) / (2 * median_scale);
    for (int axis = 0; axis < 3; ++axis) {
      made.places.push_back(
          static_cast<float>(kSide * std::clamp(at[axis], -kFarthest, kFarthest)));
    }
  }
}

void requireViews(const SplatCloud& cloud, std::span<const DetailView> views, size_t wanted) {
  if (cloud.size() == 0 || views.empty() || wanted == 0) {
    fail(ErrorCode::kInvalidArgument, "there are " + std::to_string(cloud.size()) + " splats, " +
                                          std::to_string(views.size()) + " views and " +
                                          std::to_string(wanted) +
                                          " splats to make finer; one or more of each are needed");
  }
  for (const DetailView& view : views) {
    requireImagePlane(view.camera, "looking for detail");
    const size_t pixels = size_t{view.camera.width} * view.camera.height;
    if (view.image.size() == pixels * 3 && (view.alpha.empty() || view.alpha.size() == pixels)) {
      continue;
    }
    fail(ErrorCode::kInvalidArgument,
         "an image has " + std::to_string(view.image.size()) + " numbers and its alpha " +
             std::to_string(view.alpha.size()) + ", which are not those of " +
             std::to_string(view.camera.width) + " x " + std::to_string(view.camera.height) +
             " pixels");
  }
}

}  // namespace

OrderedSplat orderedSplat(const SplatCloud& cloud, size_t splat) {
  const Mat3d turn = rotationFromQuaternion<double>(&cloud.rotations[splat * 4]);
  OrderedSplat made;
  const float* scales = &cloud.scales[splat * 3];
  std::stable_sort(made.stored.begin(), made.stored.end(),
                   [&](size_t a, size_t b) { return scales[a] > scales[b]; });
  for (int axis = 0; axis < 3; ++axis) {
    const size_t from = made.stored[static_cast<size_t>(axis)];
    made.scales[axis] = static_cast<double>(std::max(scales[from], kLeastRawScale));
    const Vec3d along = turn.col(static_cast<int>(from));
    int longest = 0;
    along.cwiseAbs().maxCoeff(&longest);
    // An axis has no sign of its own: its largest number is positive.
    made.axes.col(axis) = along[longest] < 0 ? Vec3d(-along) : along;
  }
  made.axes.col(2) = made.axes.col(0).cross(made.axes.col(1));
  return made;
}

CoarseEvidence gatherEvidence(const BackendFactory& backends, const SplatCloud& cloud,
                              std::span<const DetailView> views, size_t wanted,
                              Progress* progress) {
  requireViews(cloud, views, wanted);
  std::vector<OrderedSplat> splats(cloud.size());
  parallelFor(cloud.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t n = begin; n < end; ++n) splats[n] = orderedSplat(cloud, n);
  });
  Derivatives sums;
  sums.scores.assign(cloud.size(), 0.0);
  sums.values.assign(cloud.size(), {});
  std::vector<Drawing> drawings;
  const std::unique_ptr<ViewPass> pass = backends.makeViewPass();
  const std::unique_ptr<ImageRenderer> images = backends.makeImageRenderer();
  RenderOptions options;
  const SplatInstance instance = {&cloud};
  for (const DetailView& view : views) {
    if (progress != nullptr) progress->throwIfCancelled();
    options.with_depth = true;
    Drawing& drawing = drawings.emplace_back();
    drawing.view = &view;
    images->render({&instance, 1}, view.camera, options, {}, drawing.splats);
    options.with_depth = false;
    pass->forward(cloud, view.camera, options);
    const std::vector<float> by_image = errorGradient(pass->image(), view);
    pass->setLossGradient(by_image);
    addView(cloud, splats, view, *pass, sums);
  }
  level(sums);
  CoarseEvidence made;
  made.points = largest(sums.scores, wanted);
  made.views = views.size();
  std::vector<double> scales;
  for (const uint32_t point : made.points) scales.push_back(splats[point].scales[0]);
  const double median_scale = middleOf(std::move(scales));
  double mean_score = 0;
  for (const double score : sums.scores) {
    mean_score += score / static_cast<double>(cloud.size());
  }
  place(cloud, median_scale, made);
  const size_t count = made.points.size();
  made.own.resize(count * kOwnWidth);
  made.seen.assign(count * made.views * kSeenWidth, 0.0f);
  made.shows.assign(count * made.views, 0);
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const size_t n = made.points[i];
      const double score = mean_score > 0 ? std::log1p(sums.scores[n] / mean_score) : 0.0;
      describe(cloud, n, splats[n], median_scale, sums.values[n], score, &made.own[i * kOwnWidth]);
      for (size_t v = 0; v < made.views; ++v) {
        const size_t row = i * made.views + v;
        made.shows[row] =
            look(drawings[v], splats[n], positionOf(cloud, n), &made.seen[row * kSeenWidth]) ? 1
                                                                                             : 0;
      }
    }
  });
  made.scores = std::move(sums.scores);
  return made;
}

}  // namespace stipple
