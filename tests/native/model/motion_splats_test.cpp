#include "model/motion_splats.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "base/error.h"
#include "data/clouds/cloud_selection.h"
#include "io/assets/motion_asset.h"
#include "io/scratch_folder.h"
#include "model/model_kinds.h"
#include "moving_cloud.h"
#include "train/backend/backend_factory.h"

namespace stipple {
namespace {

using MotionSplatsFile = ScratchFolder;

constexpr uint64_t kCount = 40;

ModelRequest at(double seconds) {
  ModelRequest request;
  request.budget = kCount;
  request.time = seconds;
  return request;
}

TEST(MotionSplats, GivesItsSplatsAtEveryTime) {
  const MotionCloud moving = test::movingCloud(kCount);
  const auto model = makeMotionSplats(moving);
  for (const double time : {2.0, 2.6, 3.375, 17.0}) {
    const SplatCloud wanted = splatsAt(moving, time);
    const SplatCloud seen = model->decode(at(time));
    EXPECT_EQ(seen.positions, wanted.positions);
    EXPECT_EQ(seen.rotations, wanted.rotations);
    EXPECT_EQ(seen.opacities, wanted.opacities);
    EXPECT_EQ(seen.scales, moving.splats.scales);
    EXPECT_EQ(seen.sh, moving.splats.sh);
    EXPECT_EQ(seen.frame, Frame::kRFU);
  }
  EXPECT_NE(model->decode(at(2)).positions, model->decode(at(2.6)).positions);
  // Before the first frame and after the last one everything stands.
  EXPECT_EQ(model->decode(at(-9)).positions, model->decode(at(2)).positions);
  EXPECT_EQ(model->decode(at(3.375)).positions, model->decode(at(1e6)).positions);
}

TEST(MotionSplats, TellsItsClipAndHasEveryBudget) {
  const auto model = makeMotionSplats(test::movingCloud(kCount));
  const ModelSettings settings = model->settings();
  EXPECT_EQ(settings.budget_unit, BudgetUnit::kSplats);
  EXPECT_EQ(settings.minimum_budget, 1u);
  EXPECT_EQ(settings.maximum_budget, kCount);
  EXPECT_EQ(settings.default_budget, kCount);
  EXPECT_FALSE(settings.has_order || settings.has_seed);
  EXPECT_TRUE(settings.takes_mask);
  ASSERT_TRUE(settings.time);
  EXPECT_EQ(settings.time->begin, 2);
  EXPECT_EQ(settings.time->end, 2 + 11 / 8.0);
  EXPECT_EQ(model->density(), nullptr);
  EXPECT_EQ(model->info().leaf_count, kCount);
  EXPECT_EQ(model->info().sh_degree, 1);
  for (const uint64_t budget : {uint64_t{1}, kCount / 2, kCount - 1}) {
    ModelRequest request = at(2.5);
    request.budget = budget;
    EXPECT_EQ(model->decode(request).size(), budget);
  }
  ModelRequest more = at(2);
  more.budget = kCount + 1;
  try {
    model->decode(more);
    FAIL() << "a budget of more than the splats is accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    EXPECT_NE(std::string(error.what()).find("41 splats; 1 to 40 is allowed"), std::string::npos)
        << error.what();
  }
}

TEST_F(MotionSplatsFile, KeepsItsTreeOnceThereIsOne) {
  const MotionCloud moving = test::movingCloud(kCount);
  const auto model = makeMotionSplats(moving);
  model->save(path("without"));
  EXPECT_TRUE(readMotionAsset(path("without")).parents.empty());
  ModelRequest half = at(2.6);
  half.budget = kCount / 2;
  const SplatCloud wanted = model->decode(half);
  model->save(path("with"));
  const MotionAsset seen = readMotionAsset(path("with"));
  EXPECT_EQ(seen.parents.size(), 2 * kCount - 1);
  EXPECT_EQ(seen.nodes.waves[0].size(), 3 * (kCount - 1));
  EXPECT_EQ(loadModel(path("with"))->decode(half).positions, wanted.positions);
  // Whoever opens the file without a tree gets the same.
  EXPECT_EQ(loadModel(path("without"))->decode(half).positions, wanted.positions);
  loadModel(path("with"))->save(path("again"));
  EXPECT_EQ(load(path("again")), load(path("with")));
}

TEST_F(MotionSplatsFile, LooksAtItsSplatsWhereTheReaderHasWhatDraws) {
  // A shell of opaque splats filled with as many that nobody sees, all on one path.
  constexpr size_t kEach = 600;
  MotionCloud moving = test::movingCloud(2 * kEach);
  for (size_t i = 0; i < 2 * kEach; ++i) {
    const double turn = 2.4 * static_cast<double>(i % kEach);
    const double z = (2.0 * static_cast<double>(i % kEach) + 1) / kEach - 1;
    // Without room in the middle, which would be looked at from inside.
    const double depth = std::cbrt(0.001 * static_cast<double>(1 + i * 389 % 997));
    const double radius = i < kEach ? 1 : 0.8 * depth, ring = radius * std::sqrt(1 - z * z);
    moving.splats.positions[3 * i] = static_cast<float>(ring * std::cos(turn));
    moving.splats.positions[3 * i + 1] = static_cast<float>(ring * std::sin(turn));
    moving.splats.positions[3 * i + 2] = static_cast<float>(radius * z);
    for (size_t axis = 0; axis < 3; ++axis) {
      moving.splats.scales[3 * i + axis] = i < kEach ? 0.1f : 0.08f;
      for (auto& wave : moving.waves) wave[3 * i + axis] = 0.1f;
      moving.splats.rotations[4 * i + axis + 1] = 0;
    }
    moving.splats.opacities[i] = 0.99f;
    std::fill_n(&moving.phases[4 * i], 4, 0.0f);
    std::fill_n(&moving.spins[4 * i], 4, 0.0f);
    moving.centres[i] = 0.5f;
    moving.lifespans[2 * i] = moving.lifespans[2 * i + 1] = 1.1f;
  }
  makeMotionSplats(moving)->save(path("a"));
  const auto hiddenIn = [&](const SplatModel& model) {
    ModelRequest half = at(2.5);
    half.budget = kEach;
    const SplatCloud cut = model.decode(half), all = splatsAt(moving, 2.5);
    double centre[3] = {};
    for (size_t i = 0; i < all.positions.size(); ++i) {
      centre[i % 3] += static_cast<double>(all.positions[i]) / static_cast<double>(all.size());
    }
    size_t hidden = 0;
    for (size_t i = 0; i < cut.size(); ++i) {
      double squared = 0;
      for (size_t axis = 0; axis < 3; ++axis) {
        squared += std::pow(static_cast<double>(cut.positions[3 * i + axis]) - centre[axis], 2);
      }
      hidden += squared < 0.9 * 0.9 ? 1 : 0;
    }
    return hidden;
  };
  const size_t blind = hiddenIn(*loadModel(path("a")));
  const size_t looked = hiddenIn(*loadModel(path("a"), {{}, nullptr, cpuBackends()}));
  EXPECT_GT(blind, kEach / 5);
  EXPECT_LT(looked, blind / 2);
}

TEST_F(MotionSplatsFile, RefusesTreesThatDoNotFit) {
  MovingTree tree = buildMovingTree(test::movingCloud(5), {}, {});
  makeMotionSplats(test::movingCloud(5), {}, std::make_shared<const MovingTree>(tree))
      ->save(path("a"));
  const MotionAsset good = readMotionAsset(path("a"));
  // What the file may hold, and no tree has.
  const auto refused = [&](const auto& spoil, std::initializer_list<const char*> words) {
    MotionAsset asset = good;
    spoil(asset);
    writeMotionAsset(asset, path("bad"));
    expectError(ErrorCode::kFormat, words, [&] { loadModel(path("bad")); });
  };
  refused([](MotionAsset& asset) { asset.parents[3] = 7; }, {"parent 7"});
  refused([](MotionAsset& asset) { asset.errors[2] = 1e9f; }, {"error 2"});
  refused([](MotionAsset& asset) { asset.nodes.lifespans[1] = 3; }, {"inner nodes", "lifespans"});
  // What is not even written.
  const auto unwritten = [&](const auto& spoil, std::initializer_list<const char*> words) {
    MotionAsset asset = good;
    spoil(asset);
    expectError(ErrorCode::kInvalidArgument, words,
                [&] { writeMotionAsset(asset, path("never")); });
  };
  unwritten([](MotionAsset& asset) { asset.nodes.spins.pop_back(); }, {"tree.nodes.spins", "4"});
  unwritten([](MotionAsset& asset) { asset.errors.clear(); }, {"tree.errors", "0 rows; 4"});
  unwritten([](MotionAsset& asset) { asset.parents.pop_back(); }, {"tree.parents", "8 rows; 9"});
}

TEST(MotionSplats, LeavesSplatsOutAtAllTimes) {
  const auto model = makeMotionSplats(test::movingCloud(kCount));
  std::vector<uint8_t> mask(kCount, 0);
  for (size_t i = 1; i < kCount; i += 3) mask[i] = 1;
  const auto left = model->keep(mask);
  EXPECT_EQ(left->settings().maximum_budget, 13u);
  EXPECT_EQ(left->settings().time->end, model->settings().time->end);
  for (const double time : {2.0, 2.9}) {
    ModelRequest request = at(time);
    request.budget = 13;
    const SplatCloud seen = left->decode(request);
    const SplatCloud wanted = kept(model->decode(at(time)), mask);
    EXPECT_EQ(seen.positions, wanted.positions);
    EXPECT_EQ(seen.rotations, wanted.rotations);
    EXPECT_EQ(seen.scales, wanted.scales);
    EXPECT_EQ(seen.opacities, wanted.opacities);
    EXPECT_EQ(seen.sh, wanted.sh);
    EXPECT_EQ(seen.frame, wanted.frame);
    EXPECT_EQ(seen.antialias, wanted.antialias);
  }
  EXPECT_THROW(model->keep(std::vector<uint8_t>(kCount, 0)), Error);
  EXPECT_THROW(model->keep(std::vector<uint8_t>(kCount + 1, 1)), Error);
}

TEST(MotionSplats, RefusesWhatDoesNotMove) {
  EXPECT_THROW(makeMotionSplats({}), Error);
  MotionCloud moving = test::movingCloud(3);
  moving.lifespans[2] = 0;
  EXPECT_THROW(makeMotionSplats(moving), Error);
}

TEST_F(MotionSplatsFile, ComesBackBitForBitWithItsClipAndSettings) {
  const MotionCloud moving = test::movingCloud(kCount);
  makeMotionSplats(moving, {R"({"seed":7})", {}})->save(path("a"));
  const MotionAsset seen = readMotionAsset(path("a"));
  EXPECT_EQ(seen.splats.positions, moving.splats.positions);
  EXPECT_EQ(seen.splats.rotations, moving.splats.rotations);
  EXPECT_EQ(seen.splats.scales, moving.splats.scales);
  EXPECT_EQ(seen.splats.opacities, moving.splats.opacities);
  EXPECT_EQ(seen.splats.sh, moving.splats.sh);
  EXPECT_EQ(seen.splats.antialias, Antialias::kMip);
  EXPECT_EQ(seen.splats.frame, Frame::kRFU);
  EXPECT_EQ(seen.waves, moving.waves);
  EXPECT_EQ(seen.phases, moving.phases);
  EXPECT_EQ(seen.spins, moving.spins);
  EXPECT_EQ(seen.lifespans, moving.lifespans);
  EXPECT_EQ(seen.centres, moving.centres);
  EXPECT_EQ(seen.begin, 2);
  EXPECT_EQ(seen.frames_per_second, 8);
  EXPECT_EQ(seen.frame_count, 12u);
  EXPECT_EQ(seen.window_frames, kWindowFrames);
  EXPECT_EQ(seen.window_share, kWindowShare);
  EXPECT_EQ(seen.settings_json, R"({"seed":7,"time":{"begin":2.0,"end":3.375}})");
  EXPECT_EQ(loadModel(path("a"))->decode(at(2.6)).positions, splatsAt(moving, 2.6).positions);
}

TEST_F(MotionSplatsFile, EveryTruncatedPrefixIsRefused) {
  makeMotionSplats(test::movingCloud(3))->save(path("a"));
  const std::string bytes = load(path("a"));
  for (size_t length = 0; length < bytes.size(); length += 1 + length / 40) {
    EXPECT_THROW(loadModel(store("cut", bytes.substr(0, length))), Error) << length;
  }
}

TEST_F(MotionSplatsFile, SaysWhatIsWrongWithADamagedOne) {
  makeMotionSplats(test::movingCloud(3))->save(path("a"));
  const std::string good = load(path("a"));
  // Of the same length, so that what follows stays where it is.
  const auto refused = [&](const std::string& from, const std::string& to,
                           std::initializer_list<const char*> words) {
    std::string bytes = good;
    ASSERT_EQ(from.size(), to.size());
    const size_t place = bytes.find(from);
    ASSERT_NE(place, std::string::npos) << from;
    bytes.replace(place, from.size(), to);
    expectError(ErrorCode::kFormat, words, [&] { loadModel(store("bad", bytes)); });
  };
  refused("motion.phases", "motion.phazes", {"motion.phases"});
  refused("motion.sines.3", "motion.sines.9", {"motion.sines.3"});
  refused("\"shape\":[3,4]", "\"shape\":[4,3]", {"motion.phases"});
  refused("frames\\\":12", "frames\\\":-2", {"clip of -2 frames"});
  refused("frames\\\":12", "frames\\\":.2", {"clip"});
  refused("frames_per_second\\\":8.0", "frames_per_second\\\":0.0", {"at 0 a second"});
  refused("window_share\\\":0.7", "window_share\\\":1.7", {"share of 1.7"});
  refused("window_frames\\\"", "window_framez\\\"", {"'window_frames'"});
  refused("begin\\\":2.0,", "begin\\\":[2],", {"'begin'"});
  refused("sh_degree\":\"1", "sh_degree\":\"2", {"motion.sh"});
}

TEST_F(MotionSplatsFile, RefusesNumbersThatNoSplatHas) {
  const auto refused = [&](const auto& spoil, std::initializer_list<const char*> words) {
    makeMotionSplats(test::movingCloud(3))->save(path("a"));
    MotionAsset asset = readMotionAsset(path("a"));
    spoil(asset);
    writeMotionAsset(asset, path("a"));
    expectError(ErrorCode::kFormat, words, [&] { loadModel(path("a")); });
  };
  // What the file may hold, as finite numbers of the right sizes, and the splats may not.
  refused([](MotionAsset& asset) { asset.lifespans[1] = -1; }, {"lifespans", "-1", "1.1"});
  refused([](MotionAsset& asset) { asset.centres[0] = 2; }, {"centres", "2", "0 to 1"});
  refused([](MotionAsset& asset) { asset.phases[4] = 3.2e38f; }, {"phases"});
}

TEST_F(MotionSplatsFile, IsNotWrittenWithPartsThatDoNotFit) {
  makeMotionSplats(test::movingCloud(3))->save(path("a"));
  const MotionAsset good = readMotionAsset(path("a"));
  const auto refused = [&](const auto& spoil, std::initializer_list<const char*> words) {
    MotionAsset asset = good;
    spoil(asset);
    expectError(ErrorCode::kInvalidArgument, words,
                [&] { writeMotionAsset(asset, path("never")); });
    EXPECT_TRUE(load(path("never")).empty());
  };
  refused([](MotionAsset& asset) { asset.waves[3].pop_back(); }, {"motion.sines.2", "3"});
  refused([](MotionAsset& asset) { asset.centres.push_back(0); }, {"motion.centres", "4 rows"});
  refused([](MotionAsset& asset) { asset.spins[0] = std::numeric_limits<float>::infinity(); },
          {"motion.spins", "inf"});
  refused([](MotionAsset& asset) { asset.frame_count = 0; }, {"0 frames"});
  refused([](MotionAsset& asset) { asset.frames_per_second = 0; }, {"at 0 a second"});
  refused([](MotionAsset& asset) { asset.window_share = 1; }, {"share of 1"});
  refused([](MotionAsset& asset) { asset.splats.opacities[1] = 2; }, {"motion"});
}

}  // namespace
}  // namespace stipple
