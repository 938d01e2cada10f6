#include "train/detail/detail_model.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "densify/raw_splats.h"
#include "nn/matrix_backend.h"
#include "train/detail/detail_trainer.h"
#include "train/trained_ball.h"

namespace stipple {
namespace {

/// Flat splats on a ball, in an order and with axes that say nothing.
SplatCloud shell(size_t count, double scale) {
  SplatCloud cloud;
  cloud.resize(count);
  for (size_t i = 0; i < count; ++i) {
    const double z = 1 - 2 * (static_cast<double>(i) + 0.5) / static_cast<double>(count);
    const double turn = 2.399963229728653 * static_cast<double>(i), flat = std::sqrt(1 - z * z);
    const Vec3d normal(flat * std::cos(turn), flat * std::sin(turn), z);
    const Eigen::Quaterniond q = Eigen::Quaterniond::FromTwoVectors(Vec3d(0, 0, 1), normal);
    const double numbers[4] = {q.w(), q.x(), q.y(), q.z()};
    const Vec3d colour = colourAt(kRadius * normal);
    for (size_t k = 0; k < 4; ++k) cloud.rotations[i * 4 + k] = static_cast<float>(numbers[k]);
    for (size_t axis = 0; axis < 3; ++axis) {
      cloud.positions[i * 3 + axis] = static_cast<float>(kRadius * normal[static_cast<int>(axis)]);
      cloud.scales[i * 3 + axis] =
          static_cast<float>(scale * (axis == 2 ? 0.2 : (axis == i % 2 ? 1.3 : 0.9)));
      cloud.sh[i * 3 + axis] =
          static_cast<float>((colour[static_cast<int>(axis)] - 0.5) / static_cast<double>(kShC0));
    }
    cloud.opacities[i] = 0.7f + 0.25f * unitFloat(mixBits(i));
  }
  return cloud;
}

std::vector<DetailView> viewsOfBall(size_t count) {
  const TrainingObject object = ball();
  std::vector<size_t> all(count);
  std::iota(all.begin(), all.end(), size_t{0});
  return detailViews(*object.views, all);
}

DetailModelSizes smallSizes(size_t layers, size_t children) {
  DetailModelSizes sizes;
  sizes.heads = 2;
  sizes.head_width = 4;
  sizes.layers = layers;
  sizes.blocks = 1;
  sizes.patch = 16;
  sizes.mlp_ratio = 2;
  sizes.children = children;
  return sizes;
}

std::vector<float> drawnValues(const DetailModel& model, float size) {
  std::vector<float> values = model.startValues(1);
  for (size_t i = 0; i < values.size(); ++i) {
    values[i] += size * (2 * unitFloat(keyedBits(9, RandomUse::kNetworkStart, i)) - 1);
  }
  return values;
}

double psnrBetween(const SplatCloud& a, const SplatCloud& b, const Camera& camera) {
  const std::unique_ptr<ImageRenderer> images = cpuBackends()->makeImageRenderer();
  RenderResult drawn[2];
  const SplatInstance instances[2] = {{&a}, {&b}};
  for (int i = 0; i < 2; ++i) images->render({&instances[i], 1}, camera, {}, {}, drawn[i]);
  double squares = 0;
  for (size_t i = 0; i < drawn[0].colour.size(); ++i) {
    const double off = static_cast<double>(drawn[0].colour[i] - drawn[1].colour[i]);
    squares += off * off / static_cast<double>(drawn[0].colour.size());
  }
  return -10 * std::log10(squares);
}

TEST(CoarseEvidence, ScoresWhatTheViewsContradict) {
  SplatCloud cloud = shell(300, 0.03);
  // A splat of a colour that is nowhere, in front of the first camera.
  const std::vector<DetailView> views = viewsOfBall(3);
  const Vec3d towards = cameraCentre(views[0].camera).normalized();
  size_t nearest = 0;
  double best = -1;
  for (size_t n = 0; n < cloud.size(); ++n) {
    double along = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
      along += towards[static_cast<int>(axis)] * static_cast<double>(cloud.positions[n * 3 + axis]);
    }
    if (along > best) nearest = n;
    best = std::max(best, along);
  }
  for (size_t c = 0; c < 3; ++c) cloud.sh[nearest * 3 + c] = 9;
  const CoarseEvidence made = gatherEvidence(*cpuBackends(), cloud, views, 1);
  EXPECT_EQ(made.points, (std::vector<uint32_t>{static_cast<uint32_t>(nearest)}));
  EXPECT_EQ(made.scores.size(), cloud.size());
  EXPECT_EQ(made.shows[0], 1);
  // The image is darker than the splat, at its middle and in every channel.
  for (size_t c = 0; c < 3; ++c) EXPECT_GT(made.seen[3 + c], 0.2f) << c;
}

TEST(CoarseEvidence, IsTheSameWhereAllIsMovedAndScaled) {
  const SplatCloud cloud = shell(200, 0.03);
  const std::vector<DetailView> views = viewsOfBall(2);
  SplatCloud moved = cloud;
  std::vector<DetailView> moved_views = views;
  const Vec3d to(3, -2, 1);
  constexpr double kScale = 4;
  for (size_t i = 0; i < cloud.positions.size(); ++i) {
    moved.positions[i] = static_cast<float>(kScale * static_cast<double>(cloud.positions[i]) +
                                            to[static_cast<int>(i % 3)]);
    moved.scales[i] *= 4;
  }
  for (DetailView& view : moved_views) {
    Mat4d& camera = view.camera.world_to_camera;
    const Vec3d shift = kScale * camera.block<3, 1>(0, 3) - camera.block<3, 3>(0, 0) * to;
    camera.block<3, 1>(0, 3) = shift;
    view.camera.near_plane *= kScale;
  }
  const CoarseEvidence a = gatherEvidence(*cpuBackends(), cloud, views, 200);
  const CoarseEvidence b = gatherEvidence(*cpuBackends(), moved, moved_views, 200);
  EXPECT_NEAR(a.side, b.side, 1e-6 * a.side);
  ASSERT_EQ(a.seen.size(), b.seen.size());
  // Float32 positions of a few metres: 1e-6 of them, against splats of 0.1.
  for (size_t i = 0; i < a.places.size(); ++i) ASSERT_NEAR(a.places[i], b.places[i], 1e-5) << i;
  size_t off = 0;  // A depth at the border of a splat may be that of its neighbour.
  for (size_t i = 0; i < a.seen.size(); ++i) off += std::abs(a.seen[i] - b.seen[i]) > 5e-3f;
  for (size_t i = 0; i < a.own.size(); ++i) off += std::abs(a.own[i] - b.own[i]) > 5e-3f;
  EXPECT_LT(off, a.seen.size() / 200);
}

TEST(CoarseEvidence, RefusesWhatItCannotLookAt) {
  const SplatCloud cloud = shell(10, 0.05);
  const std::vector<DetailView> views = viewsOfBall(1);
  EXPECT_THROW(gatherEvidence(*cpuBackends(), SplatCloud(), views, 1), Error);
  EXPECT_THROW(gatherEvidence(*cpuBackends(), cloud, {}, 1), Error);
  EXPECT_THROW(gatherEvidence(*cpuBackends(), cloud, views, 0), Error);
  std::vector<DetailView> wrong = views;
  wrong[0].image.pop_back();
  EXPECT_THROW(gatherEvidence(*cpuBackends(), cloud, wrong, 1), Error);
  wrong = views;
  wrong[0].camera.model = CameraModel::kEquirectangular;
  EXPECT_THROW(gatherEvidence(*cpuBackends(), cloud, wrong, 1), Error);
  EXPECT_EQ(gatherEvidence(*cpuBackends(), cloud, views, 1000).points.size(), 10u);
}

TEST(DetailModel, CountsWhatItMakes) {
  const SplatCloud cloud = shell(50, 0.08);
  const std::vector<DetailView> views = viewsOfBall(2);
  for (const size_t layers : {1u, 2u}) {
    for (const size_t children : {1u, 2u, 4u, 8u}) {
      const DetailModel model(smallSizes(layers, children));
      const CoarseEvidence evidence = gatherEvidence(*cpuBackends(), cloud, views, 17);
      DetailModel::Tape tape;
      const SplatCloud fine = model.forward(model.startValues(1), cloud, evidence, tape);
      validate(fine, "the finer splats");
      EXPECT_EQ(fine.size(), model.splatCount(50, 17)) << layers << " " << children;
      if (children == 1) continue;
      const uint64_t points = model.pointsFor(50, 80);
      EXPECT_LE(model.splatCount(50, points), 80u);
      if (points < 50) {
        EXPECT_GT(model.splatCount(50, points + 1), 80u);
      }
    }
  }
}

TEST(DetailModel, BeginsAsTheCoarseSplats) {
  const SplatCloud cloud = shell(400, 0.03);
  const std::vector<DetailView> views = viewsOfBall(2);
  const CoarseEvidence evidence = gatherEvidence(*cpuBackends(), cloud, views, 400);
  // What halving costs: a splat and its parts are the same in mean and variance, not in shape.
  // One child each is the splat itself, but for the limits of opacities.
  const std::pair<size_t, double> kCases[] = {{1, 60}, {2, 30}, {4, 28}, {8, 27}};
  for (const auto& [children, least] : kCases) {
    const DetailModel model(smallSizes(1, children));
    DetailModel::Tape tape;
    const SplatCloud fine = model.forward(model.startValues(1), cloud, evidence, tape);
    EXPECT_GT(psnrBetween(cloud, fine, views[0].camera), least) << children;
  }
}

TEST(DetailModel, KeepsWhatDoesNotBecomeFiner) {
  const SplatCloud cloud = shell(60, 0.08);
  const CoarseEvidence evidence = gatherEvidence(*cpuBackends(), cloud, viewsOfBall(2), 20);
  const DetailModel model(smallSizes(1, 4));
  DetailModel::Tape tape;
  const SplatCloud fine = model.forward(drawnValues(model, 0.3f), cloud, evidence, tape);
  size_t row = 0;
  for (uint32_t n = 0; n < cloud.size(); ++n) {
    if (std::binary_search(evidence.points.begin(), evidence.points.end(), n)) continue;
    for (size_t k = 0; k < 3; ++k) {
      EXPECT_EQ(fine.positions[row * 3 + k], cloud.positions[n * 3 + k]);
      EXPECT_EQ(fine.scales[row * 3 + k], cloud.scales[n * 3 + k]);
    }
    EXPECT_EQ(fine.opacities[row], cloud.opacities[n]);
    ++row;
  }
  EXPECT_EQ(row, 40u);
}

/// A number that weighs every stored value of finer splats, and its derivatives.
double weighed(const SplatCloud& fine, SplatCloud* by) {
  double sum = 0;
  uint64_t key = 0;
  const auto add = [&](const std::vector<float>& values, std::vector<float>* to, double factor) {
    for (size_t i = 0; i < values.size(); ++i) {
      const double weight = factor * (2 * unitDouble(mixBits(++key)) - 1);
      sum += weight * static_cast<double>(values[i]);
      if (to != nullptr) to->push_back(static_cast<float>(weight));
    }
  };
  add(fine.positions, by ? &by->positions : nullptr, 3);
  add(fine.rotations, by ? &by->rotations : nullptr, 1);
  add(fine.scales, by ? &by->scales : nullptr, 10);
  add(fine.opacities, by ? &by->opacities : nullptr, 1);
  add(fine.sh, by ? &by->sh : nullptr, 1);
  return sum;
}

TEST(DetailModel, DerivativesAreThoseOfDifferences) {
  const SplatCloud cloud = shell(40, 0.08);
  const CoarseEvidence evidence = gatherEvidence(*cpuBackends(), cloud, viewsOfBall(3), 24);
  const DetailModel model(smallSizes(1, 4));
  std::vector<float> values = drawnValues(model, 0.2f);
  DetailModel::Tape tape;
  const SplatCloud fine = model.forward(values, cloud, evidence, tape);
  SplatCloud by;
  weighed(fine, &by);
  std::vector<float> gradients(values.size(), 0.0f);
  model.backward(values, cloud, evidence, tape, fine, by, gradients);
  // Along the gradient of each tensor, where the difference is largest against the rounding of
  // float32, with a step that changes the weighed sum by about 0.02, so that it stays straight. The
  // steps that weights really take are counted, as they are rounded too.
  size_t tensors = 0;
  for (const Parameter& parameter : model.layout().parameters()) {
    double squares = 0;
    for (size_t i = 0; i < parameter.count; ++i) {
      const auto g = static_cast<double>(gradients[parameter.first + i]);
      squares += g * g;
    }
    if (squares < 1e-4) continue;  // as biases of keys, whose derivative is 0
    const double step = std::min(0.01 / squares, 1e-3 / std::sqrt(squares));
    std::vector<float> around[2] = {values, values};
    double found[2], expected = 0;
    for (size_t side = 0; side < 2; ++side) {
      for (size_t i = parameter.first; i < parameter.first + parameter.count; ++i) {
        const auto g = static_cast<double>(gradients[i]);
        around[side][i] =
            static_cast<float>(static_cast<double>(values[i]) + (side == 0 ? step : -step) * g);
      }
      DetailModel::Tape ignored;
      found[side] = weighed(model.forward(around[side], cloud, evidence, ignored), nullptr);
    }
    for (size_t i = 0; i < values.size(); ++i) {
      expected += static_cast<double>(gradients[i]) *
                  (static_cast<double>(around[0][i]) - static_cast<double>(around[1][i]));
    }
    EXPECT_NEAR((found[0] - found[1]) / expected, 1, 0.02) << parameter.name << " " << squares;
    ++tensors;
  }
  EXPECT_GT(tensors, 30u);
}

TEST(DetailModel, IsTheSameForAnyNumberOfThreads) {
  const SplatCloud cloud = shell(120, 0.05);
  const std::vector<DetailView> views = viewsOfBall(2);
  const DetailModel model(smallSizes(2, 2));
  const std::vector<float> values = drawnValues(model, 0.2f);
  std::vector<SplatCloud> made;
  std::vector<std::vector<float>> gradients;
  const auto run = [&] {
    const CoarseEvidence evidence = gatherEvidence(*cpuBackends(), cloud, views, 70);
    DetailModel::Tape tape;
    made.push_back(model.forward(values, cloud, evidence, tape));
    SplatCloud by;
    weighed(made.back(), &by);
    gradients.emplace_back(values.size(), 0.0f);
    model.backward(values, cloud, evidence, tape, made.back(), by, gradients.back());
  };
  for (const unsigned threads : {1u, 2u}) withThreads(threads, run);
  EXPECT_EQ(made[0].positions, made[1].positions);
  EXPECT_EQ(made[0].opacities, made[1].opacities);
  EXPECT_EQ(gradients[0], gradients[1]);
}

TEST(DetailModel, RefusesSizesOutOfRange) {
  DetailModelSizes sizes;
  sizes.children = 3;
  EXPECT_THROW(DetailModel{sizes}, Error);
  sizes = {};
  sizes.layers = 3;
  EXPECT_THROW(DetailModel{sizes}, Error);
  sizes = {};
  sizes.ratio = 0;
  EXPECT_THROW(DetailModel{sizes}, Error);
}

/// The ball as coarse splats that know nothing of its pattern.
class GreyBall final : public DetailSource {
 public:
  size_t count() const override { return 1; }
  const ObjectViews& views(size_t) const override { return *object_.views; }
  SplatCloud coarse(size_t, uint64_t splats) const override {
    SplatCloud cloud = shell(splats, 0.5 / std::sqrt(static_cast<double>(splats)));
    std::fill(cloud.sh.begin(), cloud.sh.end(), 0.0f);
    return cloud;
  }

 private:
  TrainingObject object_ = ball();
};

DetailTrainer trainerOf(uint64_t steps, std::shared_ptr<const DetailSource> source,
                        LossScaling scaling = LossScaling::kNone, TrainerRun run = {}) {
  DetailSchedule schedule;
  schedule.least_splats = 60;
  schedule.most_splats = 120;
  schedule.views = 3;
  schedule.seen = 2;
  schedule.optimiser.total_steps = steps;
  schedule.optimiser.warm_up = 5;
  schedule.optimiser.learning_rate = 3e-3;
  schedule.optimiser.mean_decay = 0.9;
  schedule.optimiser.loss_scaling = scaling;
  DetailModelSizes sizes = smallSizes(1, 4);
  sizes.head_width = 8;
  return {sizes, schedule, 3, std::move(source), cpuBackends(), std::move(run)};
}

TEST(DetailTrainer, LearnsToColourByTheViews) {
  DetailTrainer trainer = trainerOf(300, std::make_shared<GreyBall>());
  double first = 0, last = 0;
  for (int i = 0; !trainer.isDone(); ++i) {
    const DetailStep done = trainer.step();
    EXPECT_FALSE(done.weights.is_skipped);
    if (i < 10) first += done.l1 / 10;
    if (i >= 290) last += done.l1 / 10;
  }
  EXPECT_LT(last, 0.85 * first);
}

TEST(DetailTrainer, GoesOnBitForBit) {
  const auto source = std::make_shared<GreyBall>();
  DetailTrainer whole = trainerOf(6, source), first = trainerOf(6, source),
                second = trainerOf(6, source);
  for (int i = 0; i < 6; ++i) whole.step();
  for (int i = 0; i < 3; ++i) first.step();
  second.resume(first.state());
  for (int i = 0; i < 3; ++i) second.step();
  EXPECT_EQ(whole.values(), second.values());
  EXPECT_EQ(whole.meanValues(), second.meanValues());
  TensorTable broken = first.state();
  broken.erase("detail.weights");
  EXPECT_THROW(second.resume(broken), Error);
}

TEST(DetailTrainer, InBfloat16LearnsAboutAsMuch) {
  const TrainerRun narrow = {nullptr, FactorPrecision::kBfloat16};
  if (!defaultMatrixBackend().has(narrow.precision)) GTEST_SKIP() << "no products in bfloat16 here";
  const auto source = std::make_shared<GreyBall>();
  double last[2] = {0, 0};
  std::vector<float> values[2];
  for (const bool is_narrow : {false, true}) {
    DetailTrainer trainer =
        trainerOf(150, source, LossScaling::kDynamic, is_narrow ? narrow : TrainerRun{});
    for (int i = 0; !trainer.isDone(); ++i) {
      const double l1 = trainer.step().l1;
      if (i >= 130) last[is_narrow] += l1 / 20;
    }
    values[is_narrow] = trainer.values();
  }
  EXPECT_NE(values[0], values[1]);
  // Rounding of 2^-9 is noise; of the autoencoder's losses it moved up to 1.3 %, of four seeds.
  EXPECT_NEAR(last[1], last[0], 0.05 * last[0]);
}

TEST(DetailTrainer, AScaleOfLossesChangesNoBit) {
  const auto source = std::make_shared<GreyBall>();
  DetailTrainer plain = trainerOf(8, source), scaled = trainerOf(8, source, LossScaling::kDynamic);
  while (!plain.isDone()) {
    const DetailStep one = plain.step(), other = scaled.step();
    EXPECT_EQ(one.l1, other.l1);
    EXPECT_EQ(other.weights.loss_scale, std::exp2(20));
  }
  EXPECT_EQ(scaled.values(), plain.values());
}

}  // namespace
}  // namespace stipple
