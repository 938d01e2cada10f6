#include "effect_table.h"

#include <vector>

#include "effect_cases.h"
#include "shot/sampled_render.h"
#include "splat/render/accurate_render.h"
#include "wide_reference.h"

namespace stipple::testing {

namespace {

/// Rounding of the picture to float32, and of its rays to double.
constexpr double kWideError = 3e-7;
/// What every renderer promises of single precision.
constexpr double kSingleError = 1e-4;

constexpr const char* kLongDouble = "long double";
constexpr const char* kDouble = "double";

double worstDifference(const std::vector<float>& a, const std::vector<float>& b) {
  EXPECT_EQ(a.size(), b.size());
  double worst = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    worst = std::max(worst, std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i])));
  }
  return worst;
}

/// Splats of opacities and colours of randomCloud within `spread` metres of `place`.
SplatCloud clusterAt(const Vec3f& place, float spread, uint32_t seed) {
  CloudRecipe recipe;
  recipe.count = 60;
  recipe.size_min = 0.02;
  recipe.size_max = 0.5;
  SplatCloud cloud = randomCloud(recipe, seed);
  for (size_t i = 0; i < cloud.positions.size(); ++i) {
    cloud.positions[i] = place[static_cast<Eigen::Index>(i % 3)] + spread * cloud.positions[i];
  }
  return cloud;
}

using Models = std::vector<CameraModel>;

double wideError(const SplatCloud& cloud, const Models& models, uint32_t side, double moved = 0) {
  double worst = 0;
  for (const CameraModel model : models) {
    Camera camera = around(model, side);
    camera.near_plane = 1e-6;
    camera.world_to_camera(0, 3) = -moved;
    const SplatInstance instance = instanceOf(cloud);
    RenderOptions options = everything();
    options.low_pass = LowPass::kClassic;
    const RenderResult picture = renderRays({&instance, 1}, camera, options, unlimitedRays());
    expectWithinTheHull(picture, brightestOf(cloud));
    const std::vector<double> judge = wideReference(cloud, camera);
    for (size_t i = 0; i < judge.size(); ++i) {
      worst = std::max(worst, std::abs(static_cast<double>(picture.colour[i]) - judge[i]));
    }
  }
  return worst;
}

DrawMoment atPrecision(Precision precision) {
  return [precision](std::span<const SplatInstance> instances, const Camera& camera,
                     const RenderOptions& options, RenderResult& result, Progress* progress) {
    RenderAccuracy accuracy;
    accuracy.precision = precision;
    RenderWorkspace workspace;
    renderAccurate(instances, camera, options, accuracy, workspace, result, progress);
  };
}

RenderResult sampled(const SplatCloud& cloud, const Camera& camera, const Sampling& sampling,
                     Precision precision) {
  const SplatInstance instance = instanceOf(cloud);
  RenderResult result;
  renderSampled({&instance, 1}, camera, everything(), sampling, atPrecision(precision), result);
  expectWithinTheHull(result, brightestOf(cloud));
  return result;
}

/// Single against double, of the same moments and points of the lens.
double sampledError(const Sampling& sampling) {
  CloudRecipe recipe;
  recipe.count = 150;
  const SplatCloud cloud = randomCloud(recipe, 21);
  double worst = 0;
  for (const CameraModel model : {CameraModel::kPerspective, CameraModel::kOrthographic}) {
    Camera camera = frontCamera(40, 30, 30, 3);
    camera.model = model;
    worst = std::max(worst,
                     worstDifference(sampled(cloud, camera, sampling, Precision::kFloat).colour,
                                     sampled(cloud, camera, sampling, Precision::kDouble).colour));
  }
  return worst;
}

Sampling lens(double radius, double focus) {
  Sampling sampling;
  sampling.aperture.radius = radius;
  sampling.aperture.focus_distance = focus;
  sampling.samples = 16;
  return sampling;
}

Sampling motionTo(const Mat4d& last) {
  Sampling sampling;
  sampling.shutter.step_count = 2;
  sampling.shutter.instances = {Mat4d::Identity(), last};
  sampling.samples = 16;
  return sampling;
}

Sampling halfTurn() {
  Mat4d last = Mat4d::Identity();
  last(0, 0) = last(1, 1) = -1;
  return motionTo(last);
}

Sampling shrinking() {
  Mat4d last = Mat4d::Identity();
  last.topLeftCorner<3, 3>() *= 1e-5;
  return motionTo(last);
}

/// The camera goes along: nothing moves in the picture.
double farJumpError() {
  const SplatCloud cloud = randomCloud({}, 28);
  const Camera camera = frontCamera(40, 30, 30, 3);
  Mat4d last = Mat4d::Identity();
  last(0, 3) = 1e6;
  Sampling moving = motionTo(last), still = motionTo(Mat4d::Identity());
  moving.shutter.camera = {camera.world_to_camera, camera.world_to_camera};
  moving.shutter.camera[1](0, 3) -= 1e6;
  return worstDifference(sampled(cloud, camera, moving, Precision::kFloat).colour,
                         sampled(cloud, camera, still, Precision::kFloat).colour);
}

/// A curve of almost nothing against the same one at 1.
double faintCurveError() {
  Sampling faint = halfTurn(), whole = halfTurn();
  faint.shutter.curve = {1e-300, 1e-300, 3e-300};
  whole.shutter.curve = {1, 1, 3};
  const SplatCloud cloud = randomCloud({}, 22);
  const Camera camera = frontCamera(40, 30, 30, 3);
  return worstDifference(sampled(cloud, camera, faint, Precision::kFloat).colour,
                         sampled(cloud, camera, whole, Precision::kFloat).colour);
}

/// An opening of nothing against one that no pixel notices.
double nothingOpenError() {
  const SplatCloud cloud = randomCloud({}, 23);
  const Camera camera = frontCamera(40, 30, 30, 3);
  return worstDifference(sampled(cloud, camera, lens(1e-300, 2), Precision::kFloat).colour,
                         sampled(cloud, camera, lens(1e-12, 2), Precision::kFloat).colour);
}

struct Passes {
  RenderResult single, exact;
};

Passes passesOf(std::span<const SplatInstance> instances) {
  Passes passes;
  const Camera camera = frontCamera(40, 30, 30, 3);
  RenderOptions options = everything();
  options.low_pass = LowPass::kClassic;
  atPrecision(Precision::kFloat)(instances, camera, options, passes.single, nullptr);
  atPrecision(Precision::kDouble)(instances, camera, options, passes.exact, nullptr);
  for (const RenderResult* picture : {&passes.single, &passes.exact}) {
    expectWithinTheHull(*picture, brightestOf(*instances[0].cloud));
  }
  return passes;
}

double normalError(const SplatCloud& cloud) {
  const SplatInstance instance = instanceOf(cloud);
  const Passes passes = passesOf({&instance, 1});
  return worstDifference(passes.single.normal, passes.exact.normal);
}

/// Splats of needles, discs and points.
SplatCloud manyShapes() {
  SplatCloud cloud = randomCloud({}, 24);
  const float shapes[][3] = {{1, 1e-6f, 1e-6f}, {0.2f, 0.2f, 0}, {0, 0, 0}, {0.1f, 0.1f, 0.1f}};
  for (size_t i = 0; i < cloud.size(); ++i) std::copy_n(shapes[i % 4], 3, &cloud.scales[i * 3]);
  return cloud;
}

/// Where next to nothing covers a pixel, and where all does.
double depthError() {
  SplatCloud cloud = randomCloud({}, 25);
  for (size_t i = 0; i < cloud.size(); ++i) cloud.opacities[i] = i % 2 == 0 ? 1.0f : 0.004f;
  const SplatInstance instance = instanceOf(cloud);
  const Passes passes = passesOf({&instance, 1});
  double worst = 0;
  for (size_t i = 0; i < passes.exact.depth.size(); ++i) {
    const auto a = static_cast<double>(passes.single.depth[i]);
    const auto b = static_cast<double>(passes.exact.depth[i]);
    worst = std::max(worst, std::abs(a - b) / b);
  }
  return worst;
}

/// Share of the pixels whose object differs where two weigh the same.
double objectError() {
  const SplatCloud cloud = oneSplat(0.5f, 0.5f);
  SplatCloud veil = cloud;
  veil.opacities[0] = 1.0f;  // behind: through 0.5 of alpha it weighs as much
  veil.positions[1] = 0.5f;
  const SplatInstance instances[] = {instanceOf(cloud), instanceOf(cloud), instanceOf(veil)};
  const Passes passes = passesOf(instances);
  double different = 0;
  for (size_t i = 0; i < passes.exact.objects.size(); ++i) {
    different += passes.single.objects[i] != passes.exact.objects[i];
  }
  return different / static_cast<double>(passes.exact.objects.size());
}

/// Twice at one place, nothing, a million metres away, and as large.
double apartError() {
  const SplatCloud cloud = randomCloud({}, 29), empty;
  std::vector<SplatInstance> instances(5, instanceOf(cloud));
  instances[2].cloud = &empty;
  instances[3].object_to_world(1, 3) = 1e6;
  instances[4].object_to_world.topLeftCorner<3, 3>() *= 1e6;
  RenderOptions options = everything();
  options.low_pass = LowPass::kClassic;
  options.object_order = ObjectOrder::kApart;
  RenderResult pictures[2];
  for (const Precision precision : {Precision::kFloat, Precision::kDouble}) {
    RenderResult& picture = pictures[static_cast<size_t>(precision)];
    atPrecision(precision)(instances, frontCamera(40, 30, 30, 3), options, picture, nullptr);
    expectWithinTheHull(picture, brightestOf(cloud));
  }
  return worstDifference(pictures[0].colour, pictures[1].colour);
}

SplatCloud layers() {
  SplatCloud cloud = oneSplat(1.0f, 0.9f);
  cloud.resize(10000);
  for (size_t i = 0; i < 10000; ++i) {
    cloud.positions[i * 3 + 1] = 2;
    cloud.rotations[i * 4] = 1;
    std::fill_n(&cloud.scales[i * 3], 3, 0.5f);
    cloud.opacities[i] = i % 2 == 0 ? 0.9f : 0.01f;
    std::fill_n(&cloud.sh[i * 3], 3, 1.0f);
  }
  return cloud;
}

SplatCloud onTheCamera() {
  SplatCloud cloud = clusterAt({0, 0, 0}, 1e-3f, 26);
  for (size_t i = 0; i < cloud.size(); ++i) {
    cloud.opacities[i] *= 0.2f;  // light comes through those that are all around
    for (size_t k = 0; k < 3; ++k) cloud.scales[i * 3 + k] *= i % 3 == 0 ? 10.0f : 1.0f;
  }
  return cloud;
}

SplatCloud farAway() {
  SplatCloud cloud = randomCloud({}, 27);
  for (size_t i = 0; i < cloud.size(); ++i) cloud.positions[i * 3] += 1e6f;
  return cloud;
}

}  // namespace

Sampling changing(std::vector<SplatCloud> steps) {
  Sampling sampling;
  sampling.shutter.step_count = static_cast<uint32_t>(steps.size());
  for (SplatCloud& step : steps) {
    sampling.shutter.clouds.push_back(std::make_shared<const SplatCloud>(std::move(step)));
  }
  sampling.samples = 16;
  return sampling;
}

/// What is drawn while the splats change against what is drawn while they do not.
double changingError(const SplatCloud& cloud, const Sampling& sampling) {
  const Camera camera = frontCamera(40, 30, 30, 3);
  Sampling still = changing({cloud, cloud});
  return worstDifference(sampled(cloud, camera, sampling, Precision::kFloat).colour,
                         sampled(cloud, camera, still, Precision::kFloat).colour);
}

/// Quaternions of the other sign are the same rotation.
double flippedSignsError() {
  const SplatCloud cloud = randomCloud({}, 24);
  SplatCloud flipped = cloud;
  for (float& value : flipped.rotations) value = -value;
  return changingError(cloud, changing({cloud, flipped, cloud}));
}

/// Half a turn about an axis of its own leaves a splat as it is, and on the way there a round
/// one too.
double halfTurnOfSplatsError() {
  const SplatCloud cloud = withScales(150, 0.2f, 0.05f, 0.05f, 25);
  SplatCloud turned = cloud;
  for (size_t i = 0; i < cloud.size(); ++i) {
    const float* q = &cloud.rotations[4 * i];
    const float about_x[4] = {-q[1], q[0], q[3], -q[2]};  // q times (0, 1, 0, 0)
    std::copy_n(about_x, 4, &turned.rotations[4 * i]);
  }
  return changingError(cloud, changing({cloud, turned}));
}

/// Splats of no size at first, single against double.
double growingError() {
  const SplatCloud cloud = randomCloud({}, 26);
  SplatCloud nothing = cloud;
  std::fill(nothing.scales.begin(), nothing.scales.end(), 0.0f);
  const Sampling sampling = changing({nothing, cloud});
  const Camera camera = frontCamera(40, 30, 30, 3);
  return worstDifference(sampled(cloud, camera, sampling, Precision::kFloat).colour,
                         sampled(cloud, camera, sampling, Precision::kDouble).colour);
}

/// One splat that appears, before nothing else, against the mean of its opacities: alpha is linear
/// in them.
double appearingError() {
  SplatCloud shown = oneSplat(0.3f, 1.0f), hidden = oneSplat(0.3f, 0.0f);
  Sampling sampling = changing({hidden, shown});
  sampling.samples = 4096;
  const Camera camera = frontCamera(9, 9, 9, 3);
  const RenderResult picture = sampled(hidden, camera, sampling, Precision::kDouble);
  Sampling still;
  still.samples = 4096;
  const RenderResult whole = sampled(shown, camera, still, Precision::kDouble);
  return std::abs(static_cast<double>(picture.colour[(4 * 9 + 4) * 4 + 3]) -
                  0.5 * static_cast<double>(whole.colour[(4 * 9 + 4) * 4 + 3]));
}

std::vector<EffectCase> effectCases() {
  const Models all = {CameraModel::kEquirectangular, CameraModel::kFisheyeEquidistant,
                      CameraModel::kFisheyeEquisolid};
  const Models panorama = {CameraModel::kEquirectangular};
  const Models fisheyes = {CameraModel::kFisheyeEquidistant, CameraModel::kFisheyeEquisolid};
  std::vector<EffectCase> cases;
  const auto add = [&](const char* name, const char* effect, const char* naive, const char* ours,
                       const char* judge, double most, std::function<double()> measure) {
    cases.push_back({name, effect, naive, ours, judge, most, std::move(measure)});
  };
  add("at the seam", "panorama", "longitudes differ by 360 degrees: half of a splat is missing",
      "a ray has a direction, longitudes are never compared", kLongDouble, kWideError, [=] {
        return wideError(clusterAt({0, -2, 0}, 0.2f, 31), panorama, 33);
      });
  add("at both poles", "panorama", "the affine map divides by the cosine of the latitude, 0",
      "nothing is mapped; tiles take the cone of their rays", kLongDouble, kWideError, [=] {
        return std::max(wideError(clusterAt({0, 0, 2}, 1e-6f, 32), panorama, 33),
                        wideError(clusterAt({0, 0, -2}, 0.2f, 33), panorama, 33));
      });
  add("straight behind", "fisheyes", "one point is the whole rim, the derivative infinite",
      "the same rays, met in space", kLongDouble, kWideError, [=] {
        return wideError(clusterAt({0, -2, 0}, 1e-3f, 34), fisheyes, 33);
      });
  add("around and on the camera", "panorama, fisheyes", "a direction to the centre of 0/0",
      "the nearest point of each ray; what lies before the near sphere is left out", kLongDouble,
      kWideError, [=] { return wideError(onTheCamera(), all, 33); });
  add("needles, 1,000,000 : 1, all around", "panorama, fisheyes",
      "a difference of squares loses the distance", "the cross product with the centre",
      kLongDouble, kWideError,
      [=] { return wideError(withScales(100, 1.0f, 1e-6f, 1e-6f, 35), all, 33); });
  add("1,000,000 from the origin, all around", "panorama, fisheyes",
      "float32 differences have steps of 6 cm", "object to camera is one matrix in double",
      kLongDouble, kWideError, [=] { return wideError(farAway(), all, 33, 1e6); });
  add("10,000 layers at one depth", "panorama, fisheyes", "sums drift, the order is that of a sort",
      "sums in double, ties by place in the scene", kLongDouble, kWideError,
      [=] { return wideError(layers(), all, 7); });
  add("an opening of 1e-300 m", "depth of field", "polar coordinates of a point of it are 0/0",
      "points of the opening are never divided by their distance", "an opening of 1e-12 m", 1e-6,
      nothingOpenError);
  add("focus at 1e15 m", "depth of field", "1/z - 1/F of single precision loses 1/F",
      "the camera moves, the image is shifted by f l/F in double", kDouble, kSingleError,
      [] { return sampledError(lens(0.3, 1e15)); });
  add("an opening of 1 km", "depth of field", "shifts of a million pixels overflow integers",
      "boxes are cut to the image before they are whole numbers", kDouble, kSingleError,
      [] { return sampledError(lens(1e3, 2)); });
  add("1,000 km together with the camera", "motion blur", "float32 matrices have steps of 6 cm",
      "steps and what lies between are double", "standing still", 1e-5, farJumpError);
  add("half a turn", "motion blur", "the matrix halfway is flat; slerp divides by sin(180 degrees)",
      "quaternions of one half space, rotated the short way", kDouble, kSingleError,
      [] { return sampledError(halfTurn()); });
  add("shrinking to 1e-5", "motion blur", "rotations of a small matrix drown in its rounding",
      "rotation and stretch by polar decomposition in double", kDouble, kSingleError,
      [] { return sampledError(shrinking()); });
  add("a shutter curve of 1e-300", "motion blur", "squares under the root underflow",
      "the curve is scaled by a power of two first", "the same curve at 1", 1e-6, faintCurveError);
  add("quaternions of the other sign", "splats that change",
      "halfway between the two is a rotation of no length",
      "where their dot product is below 0, one changes its sign", "standing still", 1e-6,
      flippedSignsError);
  add("half a turn about an axis of their own", "splats that change",
      "of two ways that are as short rounding chooses, and halfway lies near 0",
      "unit quaternions of one half space are at most a right angle apart", "standing still", 2e-4,
      halfTurnOfSplatsError);
  add("growing from scales of 0", "splats that change", "the logarithm of a scale of 0 is infinite",
      "scales are interpolated linearly", kDouble, kSingleError, growingError);
  add("opacity from 0 to 1", "splats that change", "the logit of both is infinite",
      "opacities are interpolated linearly", "half of its alpha", 4e-3, appearingError);
  add("two at one place, one empty, one far, one huge", "objects apart",
      "a mean depth of 0/0, and of equal ones rounding chooses",
      "an object without splats is not in the order; ties by place in the scene", kDouble,
      kSingleError, apartError);
  add("needles, discs, points and balls", "normal pass",
      "the mean of nothing, or of opposites, 0/0",
      "axes in double, turned to the camera; no length, no normal", "double, by component", 1e-4,
      [] { return normalError(manyShapes()); });
  add("alpha from 0.004 to 1", "depth pass", "a sum of w z over an alpha of 0",
      "where nothing is, the depth of nothing", "double, relative", 1e-4, depthError);
  add("equal weights", "object index", "rounding chooses, and differs from frame to frame",
      "the same sums in the same order; at a tie the lower index", "double, share of pixels", 0,
      objectError);
  return cases;
}

}  // namespace stipple::testing
