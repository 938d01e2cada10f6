#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "base/error.h"
#include "base/parallel.h"
#include "math/covariance.h"
#include "math/spherical_harmonics.h"
#include "splat/random_scene.h"
#include "shot/effects_plan.h"
#include "shot/effects_survey.h"

// What splats say about the effects that a picture needs: the affine bound against points on
// ellipsoids, the rest against closed forms of single splats; and the plan's decisions.

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::frontCamera;
using ::testing::HasSubstr;
using testing::oneSplat;
using testing::randomCloud;

/// The largest distance between exact and affine projection over points of the rim.
double worstOnEllipsoid(const Camera& camera, const Vec3d& centre, const Mat3d& axes, double rim,
                        std::mt19937& random) {
  std::normal_distribution<double> normal;
  double worst = 0;
  for (int i = 0; i < 20000; ++i) {
    Vec3d on{normal(random), normal(random), normal(random)};
    on *= rim / on.norm();
    const Vec3d d = axes * on;
    const Vec3d p = centre + d;
    const double z = centre[2];
    const double x = camera.fx * (centre[0] / z + d[0] / z - centre[0] * d[2] / (z * z));
    const double y = camera.fy * (centre[1] / z + d[1] / z - centre[1] * d[2] / (z * z));
    worst = std::max(worst, std::hypot(camera.fx * p[0] / p[2] - x, camera.fy * p[1] / p[2] - y));
  }
  return worst;
}

TEST(EffectsSurvey, NoPointOfAnEllipsoidIsMovedFartherThanTheBound) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(-1, 1);
  Camera camera = frontCamera(800, 600, 500, 0);
  camera.fy = 480;
  double tightest = 0, loosest = 1;
  for (int i = 0; i < 40; ++i) {
    const Vec3d centre{4 * unit(random), 4 * unit(random), 3 + unit(random)};
    const float rotation[4] = {static_cast<float>(unit(random)), static_cast<float>(unit(random)),
                               static_cast<float>(unit(random)), static_cast<float>(unit(random))};
    const float scales[3] = {0.1f * static_cast<float>(std::exp(unit(random))),
                             0.02f * static_cast<float>(std::exp(unit(random))),
                             0.2f * static_cast<float>(std::exp(unit(random)))};
    const Mat3d axes = scaledAxes<double>(rotation, scales);
    const double bound = affineErrorBound(camera, centre, axes, 2.5);
    if (std::isinf(bound)) continue;
    const double seen = worstOnEllipsoid(camera, centre, axes, 2.5, random);
    EXPECT_LE(seen, bound);
    tightest = std::max(tightest, seen / bound);
    loosest = std::min(loosest, seen / bound);
  }
  // The last factor, 1 / (1 - B), is the worst of all points and not that of the worst one.
  EXPECT_GT(tightest, 0.8);
  EXPECT_GT(loosest, 0.3);
}

TEST(EffectsSurvey, ARoundSplatFollowsTheClosedForm) {
  const Camera camera = frontCamera(800, 600, 1000, 0);
  const double sigma = 0.001, rim = 3, depth = 2;
  for (const double angle : {0.0, 0.4, 1.0}) {
    const Vec3d centre{depth * std::tan(angle), 0, depth};
    const Mat3d axes = Mat3d::Identity() * sigma;
    const double radius = 1000 * rim * sigma / depth;
    const double expected = radius * radius * (std::tan(angle) + 1 / std::cos(angle)) / 2000;
    // 1 - R/f is 0.9985 here.
    EXPECT_NEAR(affineErrorBound(camera, centre, axes, rim), expected, 2e-3 * expected);
    EXPECT_NEAR(affineFieldOfView(radius * radius / 2000, expected), 2 * angle, 1e-9);
  }
  EXPECT_TRUE(std::isinf(affineErrorBound(camera, {0, 0, 0.002}, Mat3d::Identity() * 0.001, rim)));
}

TEST(EffectsSurvey, MeasuresTheChangeOfColourThatEachDegreeMakes) {
  SplatCloud cloud = oneSplat(0.05f, 0.9f);
  cloud.sh_degree = 3;
  cloud.sh.assign(48, 0.0f);
  std::mt19937 random(5);
  for (float& value : cloud.sh) value = static_cast<float>(random() % 1000) / 2000.0f - 0.25f;
  const EffectsSurvey survey =
      surveyEffects(std::vector<SplatInstance>{{&cloud}}, frontCamera(64, 64, 60, 3));
  // Over many directions, evenly on a spiral.
  constexpr int kDirections = 20000;
  std::array<double, 4> squares = {};
  for (int i = 0; i < kDirections; ++i) {
    const double z = 1 - (2 * i + 1.0) / kDirections, phi = i * 2.399963229728653;
    const double r = std::sqrt(1 - z * z);
    double basis[16];
    harmonicBasis(3, r * std::cos(phi), r * std::sin(phi), z, basis);
    for (size_t degree = 1; degree <= 3; ++degree) {
      for (size_t c = 0; c < 3; ++c) {
        double sum = 0;
        for (size_t k = degree * degree; k < (degree + 1) * (degree + 1); ++k) {
          sum += basis[k] * static_cast<double>(cloud.sh[k * 3 + c]);
        }
        squares[degree] += sum * sum / 3 / kDirections;
      }
    }
  }
  EXPECT_EQ(survey.sh_degree, 3);
  for (size_t degree = 1; degree <= 3; ++degree) {
    // The spiral's own error at this many directions.
    EXPECT_NEAR(survey.view_change[degree], std::sqrt(squares[degree]), 1e-4);
  }
  EXPECT_EQ(survey.view_change[4], 0.0);
}

TEST(EffectsSurvey, MeasuresWhatTheLowPassAdds) {
  // One pixel of standard deviation: (1 + 0.3) / 1 of its area.
  SplatCloud cloud = oneSplat(0.05f, 0.9f);
  const Camera camera = frontCamera(64, 64, 60, 3);
  const auto widening = [&] {
    return surveyEffects(std::vector<SplatInstance>{{&cloud}}, camera).widening;
  };
  EXPECT_NEAR(widening(), 1.3, 1e-6);
  cloud.scales = {0.005f, 0.005f, 0.005f};
  EXPECT_NEAR(widening(), 31.0, 1e-4);
  cloud.antialias = Antialias::kMip;
  EXPECT_EQ(widening(), 1.0);
}

TEST(EffectsSurvey, CountsObjectsThatShareARangeOfDepth) {
  const SplatCloud cloud = randomCloud({.count = 200}, 7);  // one metre to either side
  const Camera camera = frontCamera(64, 64, 60, 20);
  const auto mixed = [&](std::initializer_list<double> places) {
    std::vector<SplatInstance> instances;
    for (const double y : places) {
      instances.push_back({&cloud});
      instances.back().object_to_world(1, 3) = y;
    }
    const EffectsSurvey survey = surveyEffects(instances, camera);
    EXPECT_EQ(survey.object_count, places.size());
    return survey.mixed_count;
  };
  EXPECT_EQ(mixed({}), 0u);
  EXPECT_EQ(mixed({0}), 0u);
  EXPECT_EQ(mixed({0, 3}), 0u);
  EXPECT_EQ(mixed({0, 1, 5}), 2u);
  EXPECT_EQ(mixed({5, 0, 1, 6, 10}), 4u);
}

TEST(EffectsSurvey, OfManyIsThatOfAllAndOfAnyNumberOfThreads) {
  const SplatCloud cloud = randomCloud({.count = 300000, .degree = 1}, 9);
  const SplatCloud part = randomCloud({.count = 100000, .degree = 1}, 9);
  const Camera camera = frontCamera(640, 480, 300, 2.5);
  EffectsSurvey one, four;
  withThreads(1, [&] { one = surveyEffects(std::vector<SplatInstance>{{&cloud}}, camera); });
  withThreads(4, [&] { four = surveyEffects(std::vector<SplatInstance>{{&cloud}}, camera); });
  EXPECT_EQ(one.affine_error_px, four.affine_error_px);
  EXPECT_EQ(one.view_change, four.view_change);
  EXPECT_EQ(one.widening, four.widening);
  const EffectsSurvey whole = surveyEffects(std::vector<SplatInstance>{{&part}}, camera);
  EXPECT_EQ(whole.looked_count, 100000u);
  EXPECT_LT(one.looked_count, 300000u);
  // Sampling of 131,072, and other splats of the same kind: a percent or so.
  EXPECT_NEAR(one.affine_error_px, whole.affine_error_px, 0.1 * whole.affine_error_px);
  EXPECT_NEAR(one.view_change[1], whole.view_change[1], 0.02 * whole.view_change[1]);
}

TEST(EffectsSurvey, OfNothingIsNothing) {
  const Camera camera = frontCamera(64, 64, 60, 3);
  const SplatCloud none;
  const EffectsSurvey survey = surveyEffects(std::vector<SplatInstance>{{&none}}, camera);
  EXPECT_EQ(survey.seen_count, 0u);
  EXPECT_EQ(survey.affine_error_px, 0.0);
  EXPECT_EQ(survey.widening, 1.0);
  // A splat around the camera: the error is held to the picture's diagonal.
  SplatCloud huge = oneSplat(100.0f, 0.9f);
  const EffectsSurvey near = surveyEffects(std::vector<SplatInstance>{{&huge}}, camera);
  EXPECT_DOUBLE_EQ(near.affine_error_px, std::hypot(64.0, 64.0));
  SplatCloud broken = oneSplat(0.1f, 0.9f);
  broken.positions[0] = std::nanf("");
  EXPECT_THROW(surveyEffects(std::vector<SplatInstance>{{&broken}}, camera), Error);
}

TEST(EffectsPlan, ASceneThatAsksForNothingNeedsNothing) {
  EffectsSurvey survey;
  survey.seen_count = survey.object_count = 1;
  EffectFacts facts;
  facts.survey = &survey;
  const EffectsPlan plan = planEffects(facts);
  ASSERT_EQ(plan.rows.size(), kEffectCount);
  for (size_t i = 0; i < kEffectCount; ++i) {
    EXPECT_EQ(static_cast<size_t>(plan.rows[i].effect), i);
    EXPECT_FALSE(plan.rows[i].is_on) << plan.rows[i].reason;
    EXPECT_FALSE(plan.rows[i].reason.empty());
    EXPECT_TRUE(std::isnan(plan.rows[i].seconds));
  }
  EXPECT_EQ(plan.sh_degree, 0);
}

TEST(EffectsPlan, SwitchesOfTheSceneAreFollowed) {
  EffectFacts facts;
  facts.motion_blur = facts.depth_of_field = facts.transparent_film = true;
  facts.depth_pass = facts.normal_pass = facts.object_index_pass = true;
  facts.hiding_meshes = 1;
  EffectsPlan plan = planEffects(facts);
  EXPECT_FALSE(plan.isOn(Effect::kMotionBlur));
  EXPECT_THAT(plan.rows[2].reason, HasSubstr("nothing moves"));
  EXPECT_FALSE(plan.isOn(Effect::kDepthOfField));
  facts.camera_moves = true;
  facts.moving_objects = 2;
  facts.aperture_radius = 0.01;
  facts.focus_distance = 3;
  facts.seconds[3] = 0.5;
  plan = planEffects(facts);
  EXPECT_THAT(plan.rows[1].reason, HasSubstr("The camera and 2 splat objects move"));
  EXPECT_THAT(plan.rows[3].reason, HasSubstr("10 mm"));
  EXPECT_EQ(plan.rows[3].seconds, 0.5);
  for (const Effect effect : {Effect::kMotion, Effect::kMotionBlur, Effect::kDepthOfField,
                              Effect::kTransparentFilm, Effect::kDepthPass, Effect::kNormalPass,
                              Effect::kObjectIndexPass, Effect::kMeshOcclusion}) {
    EXPECT_TRUE(plan.isOn(effect)) << static_cast<int>(effect);
  }
}

TEST(EffectsPlan, HarmonicsAreKeptUpToTheDegreeThatCarriesTheirShare) {
  EffectsSurvey survey;
  survey.sh_degree = 3;
  survey.view_change = {0, 0.1, 0.01, 0.001, 0};
  EffectFacts facts;
  facts.survey = &survey;
  // Energies 1 : 0.01 : 0.0001.
  facts.view_share = 0.98;
  EXPECT_EQ(planEffects(facts).sh_degree, 1);
  facts.view_share = 0.999;
  EXPECT_EQ(planEffects(facts).sh_degree, 2);
  facts.view_share = 1;
  EXPECT_EQ(planEffects(facts).sh_degree, 3);
  EXPECT_TRUE(planEffects(facts).isOn(Effect::kViewColour));
  survey.view_change = {0, 0.001, 0.001, 0, 0};
  EXPECT_EQ(planEffects(facts).sh_degree, 0);
  EXPECT_FALSE(planEffects(facts).isOn(Effect::kViewColour));
  facts.view_colour = EffectChoice::kOn;
  EXPECT_EQ(planEffects(facts).sh_degree, kMaxShDegree);
  facts.view_colour = EffectChoice::kOff;
  EXPECT_EQ(planEffects(facts).sh_degree, 0);
}

TEST(EffectsPlan, ProjectionZoomAndOrderFollowTheSurveyUnlessChosen) {
  EffectsSurvey survey;
  survey.seen_count = 1;
  survey.affine_error_px = 2;
  survey.widening = 3;
  survey.object_count = 3;
  survey.mixed_count = 2;
  EffectFacts facts;
  facts.survey = &survey;
  const auto on = [&] {
    const EffectsPlan plan = planEffects(facts);
    return std::array{plan.isOn(Effect::kExactProjection), plan.isOn(Effect::kZoomAntialiasing),
                      plan.isOn(Effect::kGlobalOrder)};
  };
  EXPECT_EQ(on(), (std::array{true, true, true}));
  facts.camera_model = CameraModel::kOrthographic;
  EXPECT_EQ(on(), (std::array{false, true, true}));
  facts.camera_model = CameraModel::kPerspective;
  survey.affine_error_px = 0.5;
  survey.widening = 1.2;
  survey.mixed_count = 0;
  EXPECT_EQ(on(), (std::array{false, false, false}));
  facts.exact_projection = facts.zoom_antialiasing = facts.global_order = EffectChoice::kOn;
  EXPECT_EQ(on(), (std::array{true, true, true}));
  facts.exact_projection = facts.zoom_antialiasing = facts.global_order = EffectChoice::kOff;
  survey.affine_error_px = survey.widening = 9;
  survey.mixed_count = 2;
  EXPECT_EQ(on(), (std::array{false, false, false}));
}

TEST(EffectsPlan, RefusesNumbersOutsideTheirRange) {
  EffectFacts facts;
  facts.view_share = 1.5;
  EXPECT_THROW(planEffects(facts), Error);
  facts.view_share = 0.5;
  facts.largest_error_px = std::nan("");
  EXPECT_THROW(planEffects(facts), Error);
  facts.largest_error_px = 1;
  facts.aperture_radius = -1;
  EXPECT_THROW(planEffects(facts), Error);
}

}  // namespace
}  // namespace stipple
