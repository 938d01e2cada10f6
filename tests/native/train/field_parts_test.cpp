// What a fit of a field is put together from: sparse steps, regularisers, the prior.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "decode/anchor_spacing.h"
#include "decode/field/contraction.h"
#include "math/morton.h"
#include "train/optimiser/field_regularisers.h"
#include "train/optimiser/sparse_adam.h"
#include "train/prior/scene_prior.h"
#include "train/prior/visual_hull.h"
#include "train/sphere_views.h"
#include "train/toy_views.h"

namespace stipple {
namespace {

float number(uint64_t index) {
  return unitFloat(keyedBits(3, RandomUse::kFieldStart, index)) - 0.5f;
}

TEST(SparseAdam, StepsTheListedRowsAsAdamDoesAndNoOthers) {
  for (const size_t length : {3u, 8u, 5u}) {
    constexpr size_t kRows = 40;
    std::vector<float> values(kRows * length), gradients(kRows * length);
    for (size_t i = 0; i < values.size(); ++i) {
      values[i] = number(i);
      gradients[i] = number(1000 + i);
    }
    std::vector<float> first(values.size(), 0.1f), second(values.size(), 0.2f);
    const std::vector<uint32_t> rows = {7, 3, 39, 0};
    std::vector<float> expected = values, expected_first = first, expected_second = second;
    for (const uint32_t row : rows) {
      const AdamGroup group = {&expected[row * length],
                               &gradients[row * length],
                               &expected_first[row * length],
                               &expected_second[row * length],
                               1,
                               length,
                               0.01};
      adamStep({&group, 1}, 4);
    }
    SparseAdamScratch scratch;
    const SparseRows table = {rows,          length,           values.data(), first.data(),
                              second.data(), gradients.data(), 0.01};
    sparseAdamStep({&table, 1}, 4, {}, scratch);
    EXPECT_EQ(values, expected);
    EXPECT_EQ(first, expected_first);
    EXPECT_EQ(second, expected_second);
  }
}

struct DecodedField {
  FieldParameters field;
  AnchorSet anchors;
  FieldTape tape;
  SplatCloud cloud;
};

/// Anchors so near to each other that every regulariser counts, in the order of their leaves.
DecodedField decodedField(size_t count = 12) {
  FieldShape shape;
  shape.root = {{1, 2, 3}, 2.0};
  shape.leaf_level = 4;
  shape.layout = {4, 0};
  DecodedField decoded;
  decoded.field = makeFieldParameters(shape);
  for (float& bias : decoded.field.network.layers().back().biases) bias += 3.0f * number(7);
  for (float& weight : decoded.field.network.layers().back().weights) weight *= 30.0f;
  decoded.anchors.leaf_level = 4;
  std::vector<std::pair<uint64_t, std::array<float, 3>>> places;
  for (uint64_t i = 0; i < count; ++i) {
    std::array<float, 3> place;
    std::array<uint32_t, 3> cell;
    for (uint64_t a = 0; a < 3; ++a) {
      place[a] = 0.5f + 0.2f * number(3 * i + a);
      cell[a] = static_cast<uint32_t>(place[a] * 16.0f);
    }
    places.emplace_back(mortonEncode(cell[0], cell[1], cell[2]), place);
  }
  std::sort(places.begin(), places.end());
  for (const auto& [leaf, place] : places) {
    for (const float p : place) decoded.anchors.positions.push_back(p);
    decoded.anchors.log_q.push_back(0);
    decoded.anchors.leaves.push_back(leaf);
  }
  const auto view =
      std::shared_ptr<const FieldParameters>(&decoded.field, [](const FieldParameters*) {});
  FieldDecoder(view).forward(decoded.anchors, decoded.tape, decoded.cloud);
  return decoded;
}

TEST(FieldRegularisers, GradientsAreThoseOfDifferences) {
  for (const FieldRegularisers weights :
       {FieldRegularisers{1e3, 0, 0}, FieldRegularisers{0, 1, 0}, FieldRegularisers{0, 0, 100}}) {
    DecodedField d = decodedField();
    SplatCloud gradient = d.cloud;
    for (auto* values : {&gradient.positions, &gradient.scales, &gradient.opacities}) {
      std::fill(values->begin(), values->end(), 0.0f);
    }
    EXPECT_GT(regularise(weights, d.field, d.anchors, d.tape, d.cloud, gradient), 0);
    double largest = 0;
    const auto compare = [&](std::vector<float>& values, double step, float by, size_t at,
                             double to_value) {
      const float kept = values[at];
      SplatCloud unused = gradient;
      values[at] = kept + static_cast<float>(step);
      const double above = static_cast<double>(values[at]);
      const double high = regularise(weights, d.field, d.anchors, d.tape, d.cloud, unused);
      values[at] = kept - static_cast<float>(step);
      const double below = static_cast<double>(values[at]);
      const double low = regularise(weights, d.field, d.anchors, d.tape, d.cloud, unused);
      values[at] = kept;
      const double difference = (high - low) / ((above - below) * to_value);
      // Sums in double of float32 values; truncation of steps of 1e-3 of the values' size.
      EXPECT_NEAR(static_cast<double>(by), difference, 1e-3 * std::abs(difference) + 1e-5);
      largest = std::max(largest, std::abs(difference));
    };
    for (size_t i = 0; i < d.cloud.scales.size(); i += 5) {
      // Centres are kept in the unit cube; the derivative is by the world, twice as large.
      compare(d.tape.centres, 1e-4, gradient.positions[i], i, 2.0);
      compare(d.cloud.scales, 1e-3 * static_cast<double>(d.cloud.scales[i]), gradient.scales[i], i,
              1.0);
    }
    for (size_t i = 0; i < d.cloud.size(); i += 3) {
      compare(d.cloud.opacities, 1e-3, gradient.opacities[i], i, 1.0);
    }
    EXPECT_GT(largest, 1e-4);
  }
}

/// The term of spread by its definition, over all pairs, in double. Out: pairs that count.
double spreadOfAllPairs(const DecodedField& d, size_t& pairs) {
  const size_t count = d.anchors.size(), gaussians = d.field.layout.gaussians;
  const auto at = [](const auto& values, size_t i, size_t a) {
    return static_cast<double>(values[i * 3 + a]);
  };
  double sum = 0;
  pairs = 0;
  for (size_t i = 0; i < count; ++i) {
    const auto unit = static_cast<double>(d.tape.units[i]);
    std::array<double, 3> mean = {};
    double squares = 0;
    for (size_t k = 0; k < gaussians; ++k) {
      for (size_t a = 0; a < 3; ++a) {
        const double offset =
            (at(d.tape.centres, i * gaussians + k, a) - at(d.anchors.positions, i, a)) / unit;
        mean[a] += offset / static_cast<double>(gaussians);
        squares += offset * offset / static_cast<double>(gaussians);
      }
    }
    const double deviation = std::sqrt(squares);
    sum += std::max(0.0, std::hypot(mean[0], mean[1], mean[2]) - 0.5 * deviation);
    for (size_t j = 0; j < count; ++j) {
      if (j == i) continue;
      const double distance =
          std::hypot(at(d.anchors.positions, i, 0) - at(d.anchors.positions, j, 0),
                     at(d.anchors.positions, i, 1) - at(d.anchors.positions, j, 1),
                     at(d.anchors.positions, i, 2) - at(d.anchors.positions, j, 2)) /
          unit;
      sum += std::max(0.0, deviation - distance);
      pairs += distance < deviation;
    }
  }
  return sum / static_cast<double>(count * count);
}

TEST(FieldRegularisers, SpreadCountsAllPairs) {
  size_t past_neighbours = 0;
  // Spread from none of the others to most of them.
  for (const float wider : {-2.0f, 0.0f, 0.3f, 1.0f, 3.0f}) {
    DecodedField d = decodedField(300);
    for (size_t n = 0; n < d.cloud.size(); ++n) {
      for (size_t a = 0; a < 3; ++a) {
        const float anchor = d.anchors.positions[n / d.field.layout.gaussians * 3 + a];
        d.tape.centres[n * 3 + a] = anchor + std::exp(wider) * (d.tape.centres[n * 3 + a] - anchor);
      }
    }
    SplatCloud gradient = d.cloud;
    const double seen = regularise({0, 0, 1}, d.field, d.anchors, d.tape, d.cloud, gradient);
    size_t pairs = 0;
    const double wanted = spreadOfAllPairs(d, pairs);
    // Sums of the same terms in double, in another order.
    EXPECT_NEAR(seen, wanted, 1e-12 * wanted) << wider;
    past_neighbours += pairs > 6 * d.anchors.size();
  }
  EXPECT_GE(past_neighbours, 2u);
}

std::vector<size_t> all(const ViewSource& views) {
  std::vector<size_t> list;
  for (size_t v = 0; v < views.count(); ++v) list.push_back(v);
  return list;
}

TEST(ScenePrior, HoldsThePointsAndATenthMore) {
  const auto views = toyViews(toyBall(1000), 8, 16);
  const ScenePrior prior = scenePrior(*views, all(*views), {});
  EXPECT_EQ(prior.weights.size(), 1000u);
  // The extents are those of the ball's outermost splats, 1.998 and less.
  EXPECT_NEAR(prior.root.side, 2.2, 0.01);
  for (const double origin : prior.root.origin) EXPECT_NEAR(origin, -1.1, 0.01);
}

TEST(ScenePrior, LeavesOutFarPointsAndUnseenOnes) {
  SplatCloud cloud = toyBall(1000);
  const auto views = toyViews(cloud, 8, 16, false);
  cloud.positions[0] = 500.0f;  // behind and beside every camera but some
  cloud.positions[4] = 40000.0f;
  for (size_t i = 10; i < 15; ++i) cloud.positions[i * 3] = 1.6f;  // seen, yet far out
  views->setPoints(toyPoints(cloud));
  const ScenePrior prior = scenePrior(*views, all(*views), {});
  EXPECT_LE(prior.weights.size(), 1000u);
  EXPECT_LT(prior.root.side, 3.0);
  EXPECT_GT(prior.root.side, 2.1);
}

TEST(ScenePrior, TakesPointsFromDepth) {
  auto with_depth = std::make_shared<MemoryViewSource>(ColourSpace::kDisplay);
  for (size_t v = 0; v < 6; ++v) {
    const Camera camera = toyCamera(v, 6, 32);
    ViewPicture picture;
    picture.width = picture.height = 32;
    picture.colour.assign(32 * 32 * 3, 0.5f);
    // A wall across the origin; in the left half nothing is known.
    picture.depth.assign(32 * 32, 3.5f);
    for (size_t i = 0; i < 32 * 32; ++i) {
      if (i % 32 < 16) picture.depth[i] = 0.0f;
    }
    with_depth->add(camera, std::move(picture));
  }
  ScenePriorOptions options;
  options.depth_points = 600;
  options.shell = ShellChoice::kOff;
  const ScenePrior prior = scenePrior(*with_depth, all(*with_depth), options);
  EXPECT_GT(prior.weights.size(), 300u);
  EXPECT_LT(prior.weights.size(), 700u);
  for (size_t i = 0; i < prior.weights.size(); ++i) {
    const float* p = &prior.positions[i * 3];
    // Half a picture is 3.5 * 16 / (1.4 * 32) = 1.25 wide.
    EXPECT_LT(std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]), 1.25f * 1.42f);
  }
}

/// A wall across the origin, at a distance at every pixel, before cameras at 3.5 m.
std::shared_ptr<MemoryViewSource> wallViews(float unknown_share, bool with_alpha) {
  auto views = std::make_shared<MemoryViewSource>(ColourSpace::kDisplay);
  for (size_t v = 0; v < 6; ++v) {
    ViewPicture picture;
    picture.width = picture.height = 32;
    picture.colour.assign(32 * 32 * 3, 0.5f);
    picture.depth.assign(32 * 32, 3.5f);
    for (size_t i = 0; i < static_cast<size_t>(unknown_share * 32 * 32); ++i) {
      picture.depth[i] = 0.0f;
    }
    if (with_alpha) picture.alpha.assign(32 * 32, 1.0f);
    views->add(toyCamera(v, 6, 32), std::move(picture));
  }
  return views;
}

/// Largest distance from the middle along an axis, in halves of the inner cube's side in the world.
double reachOf(const ScenePrior& prior) {
  const Contraction contraction(prior.root);
  double reach = 0;
  for (size_t i = 0; i < prior.weights.size(); ++i) {
    const float* p = &prior.positions[i * 3];
    const Vec3d world = contraction.toWorld(Vec3d(p[0], p[1], p[2]));
    for (int axis = 0; axis < 3; ++axis) {
      const double middle = prior.root.origin[static_cast<size_t>(axis)] + 0.5 * prior.root.side;
      reach = std::max(reach, std::abs(world[axis] - middle) / (0.25 * prior.root.side));
    }
  }
  return reach;
}

TEST(ScenePrior, HasAShellWherePicturesAreOpaque) {
  using enum ShellChoice;
  const auto seen = [](float unknown_share, bool with_alpha, ShellChoice shell) {
    const auto views = wallViews(unknown_share, with_alpha);
    ScenePriorOptions options;
    options.depth_points = 3000;
    options.shell = shell;
    return scenePrior(*views, all(*views), options);
  };
  // All depth ends inside: it stands right behind the walls.
  ASSERT_TRUE(seen(0.0f, false, kAuto).contracted);
  EXPECT_LE(reachOf(seen(0.0f, false, kAuto)), 2.001);
  EXPECT_FALSE(seen(0.0f, false, kOff).contracted);
  EXPECT_FALSE(seen(0.3f, true, kAuto).contracted) << "alpha says what belongs to the scene";
  EXPECT_TRUE(seen(0.0f, false, kOn).contracted);
  EXPECT_TRUE(seen(0.3f, true, kOn).contracted);
  const ScenePrior plain = seen(0.3f, false, kOff), shell = seen(0.3f, false, kAuto);
  EXPECT_FALSE(plain.contracted);
  ASSERT_TRUE(shell.contracted);
  EXPECT_GT(reachOf(shell), 20);
  EXPECT_DOUBLE_EQ(shell.root.side, 2 * plain.root.side);
  double inside = 0, around = 0;
  for (size_t i = 0; i < shell.weights.size(); ++i) {
    bool is_inside = true;
    for (size_t axis = 0; axis < 3; ++axis) {
      const auto place = static_cast<double>(shell.positions[i * 3 + axis]);
      EXPECT_GT(place, shell.root.origin[axis]);
      EXPECT_LT(place, shell.root.origin[axis] + shell.root.side);
      const double from_middle = place - shell.root.origin[axis] - 0.5 * shell.root.side;
      is_inside = is_inside && std::abs(from_middle) <= 0.5 * plain.root.side;
    }
    (is_inside ? inside : around) += static_cast<double>(shell.weights[i]);
  }
  EXPECT_NEAR(around / inside, 0.25, 0.03);
}

TEST(ScenePrior, HasAShellWhereDepthIsUnknownEverywhere) {
  auto views = std::make_shared<MemoryViewSource>(ColourSpace::kDisplay);
  const auto with_depth = wallViews(0, false);
  for (size_t v = 0; v < 6; ++v) {
    ViewPicture picture = with_depth->load(v);
    picture.depth.clear();
    views->add(with_depth->camera(v), std::move(picture));
  }
  views->setPoints(toyPoints(toyBall(1000)));
  ScenePriorOptions options;
  EXPECT_TRUE(scenePrior(*views, all(*views), options).contracted);
  options.shell = ShellChoice::kOff;
  EXPECT_FALSE(scenePrior(*views, all(*views), options).contracted);
}

TEST(ScenePrior, AShellIsThereWithoutPointsWhereItIsAskedFor) {
  const auto views = toyViews(toyBall(3000, 0.5f), 40, 64, false);
  ScenePriorOptions options;
  const ScenePrior plain = scenePrior(*views, all(*views), options);
  options.shell = ShellChoice::kOn;
  const ScenePrior shell = scenePrior(*views, all(*views), options);
  EXPECT_FALSE(plain.contracted);
  ASSERT_TRUE(shell.contracted);
  EXPECT_GT(reachOf(shell), 20);
  EXPECT_DOUBLE_EQ(shell.root.side, 2 * plain.root.side);
  EXPECT_EQ(shell.known_level, plain.known_level + 1) << "cells of the hull stay as large";
  EXPECT_GT(shell.weights.size(), plain.weights.size());
}

/// The same pictures, over black where they have alpha.
std::shared_ptr<MemoryViewSource> withoutAlpha(const MemoryViewSource& views) {
  auto opaque = std::make_shared<MemoryViewSource>(views.colourSpace());
  for (size_t v = 0; v < views.count(); ++v) {
    ViewPicture picture = views.load(v);
    picture.alpha.clear();
    opaque->add(views.camera(v), std::move(picture));
  }
  return opaque;
}

TEST(ScenePrior, WithoutPointsOrAlphaTakesWhereThePicturesOfCamerasAgree) {
  const auto views =
      testing::sphereViews(testing::camerasAround(24, 64), testing::Behind::kPattern);
  ScenePriorOptions options;
  options.shell = ShellChoice::kOff;
  const ScenePrior prior = scenePrior(*views, all(*views), options);
  ASSERT_GT(prior.weights.size(), 500u);
  size_t right = 0;
  for (size_t i = 0; i < prior.weights.size(); ++i) {
    const double distance = Eigen::Map<const Vec3f>(&prior.positions[i * 3]).cast<double>().norm();
    right += std::abs(distance - 1) < 0.1 || distance > 5;
  }
  EXPECT_GT(right, prior.weights.size() * 9 / 10);
  options.shell = ShellChoice::kAuto;
  EXPECT_TRUE(scenePrior(*views, all(*views), options).contracted);
  // Before a backdrop of one colour little more than outlines would be certain.
  const auto before_blank =
      testing::sphereViews(testing::camerasAround(24, 64), testing::Behind::kBlank);
  EXPECT_TRUE(scenePrior(*before_blank, all(*before_blank), options).weights.empty());
}

/// Before black.
TEST(ScenePrior, WithoutPointsOrAlphaTakesWhatTheCamerasShare) {
  const auto views = withoutAlpha(*toyViews(toyBall(100), 12, 16, false));
  const ScenePrior prior = scenePrior(*views, all(*views), {});
  EXPECT_TRUE(prior.weights.empty());
  // Around the origin; half an angle of view of atan(1 / 2.8): radius 3.5 sin of it, 1.18.
  const double side = 2 * 3.5 * std::sin(std::atan(1 / 2.8)) * 1.1;
  EXPECT_NEAR(prior.root.side, side, 0.01);
  for (const double origin : prior.root.origin) EXPECT_NEAR(origin, -0.5 * side, 0.01);
  const std::vector<size_t> one = {0};
  EXPECT_GT(scenePrior(*views, one, {}).root.side, 0.01);
}

double lengthOf(const float* p) {
  return std::hypot(static_cast<double>(p[0]), static_cast<double>(p[1]),
                    static_cast<double>(p[2]));
}

/// A small ball, so that the ball that the cameras share is far larger than what they show.
TEST(ScenePrior, WithoutPointsTakesTheHullOfSilhouettes) {
  const auto views = toyViews(toyBall(3000, 0.5f), 40, 64, false);
  const ScenePrior prior = scenePrior(*views, all(*views), {});
  // Half a ball's splat and a pixel (3.5 / (1.4 * 64) = 0.04) beyond its surface, and a tenth.
  EXPECT_GT(prior.root.side, 1.05);
  EXPECT_LT(prior.root.side, 1.4);
  double sum = 0, near_surface = 0;
  for (size_t i = 0; i < prior.weights.size(); ++i) {
    const double length = lengthOf(&prior.positions[i * 3]);
    // Between 40 silhouettes the hull stands out by some hundredths.
    EXPECT_LT(length, 0.65);
    sum += static_cast<double>(prior.weights[i]);
    if (length > 0.45) near_surface += static_cast<double>(prior.weights[i]);
  }
  EXPECT_NEAR(sum / static_cast<double>(prior.weights.size()), 1, 1e-3);
  // A tenth is spread inside, of which a ball of 0.45 has six tenths at most.
  EXPECT_GT(near_surface / sum, 0.9);
  EXPECT_LT(near_surface / sum, 0.99);
  EXPECT_GT(prior.weights.size(), 30000u);
}

TEST(VisualHull, IsEmptyWhereSilhouettesTellNothing) {
  const auto shown = toyViews(toyBall(1000), 8, 32, false);
  const RootCube where = {{-1.5, -1.5, -1.5}, 3.0};
  EXPECT_FALSE(visualHull(*shown, all(*shown), where, {}).weights.empty());
  EXPECT_TRUE(visualHull(*withoutAlpha(*shown), all(*shown), where, {}).weights.empty());
  for (const float alpha : {0.0f, 1.0f}) {
    auto even = std::make_shared<MemoryViewSource>(shown->colourSpace());
    for (size_t v = 0; v < shown->count(); ++v) {
      ViewPicture picture = shown->load(v);
      picture.alpha.assign(picture.alpha.size(), alpha);
      even->add(shown->camera(v), std::move(picture));
    }
    EXPECT_TRUE(visualHull(*even, all(*even), where, {}).weights.empty()) << alpha;
  }
}

TEST(VisualHull, ForgivesAHoleInOneOfManySilhouettes) {
  const auto whole = toyViews(toyBall(3000, 0.5f), 60, 48, false);
  auto holed = std::make_shared<MemoryViewSource>(whole->colourSpace());
  for (size_t v = 0; v < whole->count(); ++v) {
    ViewPicture picture = whole->load(v);
    if (v == 7) std::fill(picture.alpha.begin(), picture.alpha.end(), 0.0f);
    holed->add(whole->camera(v), std::move(picture));
  }
  const RootCube where = {{-1, -1, -1}, 2.0};
  const size_t count = visualHull(*whole, all(*whole), where, {}).weights.size();
  const size_t with_hole = visualHull(*holed, all(*holed), where, {}).weights.size();
  EXPECT_NEAR(static_cast<double>(with_hole), static_cast<double>(count),
              0.2 * static_cast<double>(count));
}

TEST(VisualHull, HasTheSameBitsForAnyNumberOfThreads) {
  const auto views = toyViews(toyBall(500), 8, 32, false);
  VisualHull hulls[2];
  for (const unsigned threads : {1u, 2u}) {
    withThreads(threads, [&] {
      hulls[threads - 1] = visualHull(*views, all(*views), {{-1.5, -1.5, -1.5}, 3.0}, {});
    });
  }
  EXPECT_EQ(hulls[0].positions, hulls[1].positions);
  EXPECT_EQ(hulls[0].weights, hulls[1].weights);
}

TEST(VisualHull, RefusesLevelsOutOfRange) {
  const auto views = toyViews(toyBall(100), 3, 16, false);
  for (const int level : {2, 9}) {
    VisualHullOptions options;
    options.level = level;
    EXPECT_THROW(visualHull(*views, all(*views), {{-1, -1, -1}, 2.0}, options), Error) << level;
  }
}

}  // namespace
}  // namespace stipple
