// Expectations come from a run of the released code in PyTorch, float32 on a CPU; the same network
// in float64 differs from them by up to 2.6e-5.
#include "generate/flow_network.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "base/progress.h"
#include "flow_golden.h"
#include "generate/flow_sampler.h"
#include "generate/peak_memory.h"
#include "generate/seeded_noise.h"
#include "generate/sobol_points.h"

namespace stipple {
namespace {

using testing::expectLatentsNear;
using testing::expectSameLatents;
using testing::flowCondition;
using testing::flowGolden;
using testing::kFlowGoldenTime;
using testing::pipelineCondition;
using testing::pipelineGolden;

constexpr float kCallTolerance = 5e-5f;
/// Two orders of the same sums of float32, for velocities of up to 4.4.
constexpr float kOrderTolerance = 2e-5f;

Latent velocityOf(const FlowNetwork& network, const Latent& state, double time,
                  const FlowContext& context) {
  Latent velocity;
  network.velocity({}, state, time, context, velocity);
  return velocity;
}

std::string messageOf(const std::function<void()>& work, ErrorCode code) {
  try {
    work();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code) << error.what();
    return error.what();
  }
  ADD_FAILURE() << "no error";
  return "";
}

TEST(FlowNetwork, ReadsItsSizesFromItsTensors) {
  const FlowSizes sizes = FlowNetwork(flowGolden().weights()).sizes();
  EXPECT_EQ(sizes.block.channels, 96u);
  EXPECT_EQ(sizes.block.heads, 4u);
  EXPECT_EQ(sizes.block.head_width, 24u);
  EXPECT_EQ(sizes.block.mlp_width, 384u);
  EXPECT_EQ(sizes.block.rotary_width, 12u);
  EXPECT_EQ(sizes.block_count, 2u);
  EXPECT_EQ(sizes.noise_refiner_count, 2u);
  EXPECT_EQ(sizes.context_refiner_count, 2u);
  EXPECT_EQ(sizes.token_width, 16u);
  EXPECT_EQ(sizes.structure_width, 40u);
  EXPECT_EQ(sizes.colour_width, 12u);
  EXPECT_EQ(sizes.time_width, 256u);
}

TEST(FlowNetwork, GivesTheRecordedVelocity) {
  const FlowNetwork network(flowGolden().weights());
  EXPECT_EQ(sobolPoints(64), flowGolden().floats("input.sobol"));
  const FlowContext context = network.context({}, flowCondition());
  expectLatentsNear(velocityOf(network, flowGolden().latent("input"), kFlowGoldenTime, context),
                    flowGolden().latent("expect.velocity"), kCallTolerance);
}

TEST(FlowNetwork, GivesTheRecordedVelocitiesOfHalfPrecisionWeightsAtEveryStep) {
  const FlowNetwork network(pipelineGolden().weights());
  const FlowContext image = network.context({}, pipelineCondition());
  const FlowContext nothing = network.emptyContext({}, image.rows);
  const double times[] = {1, 0.9, 0.75, 0.5};
  Latent state = pipelineGolden().latent("input");
  for (int step = 0; step < 4; ++step) {
    SCOPED_TRACE(step);
    const std::string name = "expect.step" + std::to_string(step);
    expectLatentsNear(velocityOf(network, state, times[step], image),
                      pipelineGolden().latent(name + ".cond"), kCallTolerance);
    expectLatentsNear(velocityOf(network, state, times[step], nothing),
                      pipelineGolden().latent(name + ".uncond"), kCallTolerance);
    state = pipelineGolden().latent(name + ".x");
  }
}

TEST(FlowNetwork, NeedsOneRowOfAnEmptyImage) {
  const FlowNetwork network(pipelineGolden().weights());
  ImageCondition zeros = pipelineCondition();
  std::fill(zeros.structure.begin(), zeros.structure.end(), 0.0f);
  std::fill(zeros.colour.begin(), zeros.colour.end(), 0.0f);
  const FlowContext full = network.context({}, zeros);
  const FlowContext one = network.emptyContext({}, zeros.rows);
  EXPECT_EQ(one.rows, 1u);
  EXPECT_EQ(one.copies, zeros.rows);
  const Latent state = pipelineGolden().latent("input");
  expectLatentsNear(velocityOf(network, state, 1, one), velocityOf(network, state, 1, full),
                    kOrderTolerance);
}

// More tokens than go through a block at a time; each row of the image 210 times is the same as
// each counted 210 times.
TEST(FlowNetwork, CutsManyTokensIntoPieces) {
  constexpr uint64_t kCopies = 210;
  const FlowNetwork network(flowGolden().weights());
  const ImageCondition few = flowCondition();
  ImageCondition many = few;
  many.rows = few.rows * kCopies;
  for (uint64_t copy = 1; copy < kCopies; ++copy) {
    many.structure.insert(many.structure.end(), few.structure.begin(), few.structure.end());
    many.colour.insert(many.colour.end(), few.colour.begin(), few.colour.end());
  }
  ASSERT_GT(many.rows, kFlowRowsAtATime);
  const FlowContext all = network.context({}, many);
  FlowContext counted = network.context({}, few);
  for (size_t i = 0; i < counted.values.size(); ++i) {
    ASSERT_NEAR(all.values[i], counted.values[i], kOrderTolerance);
    ASSERT_NEAR(all.values[all.values.size() - 1 - i],
                counted.values[counted.values.size() - 1 - i], kOrderTolerance);
  }
  counted.copies = kCopies;
  const Latent state = flowGolden().latent("input");
  expectLatentsNear(velocityOf(network, state, 0.3, all), velocityOf(network, state, 0.3, counted),
                    kOrderTolerance);
}

TEST(FlowNetwork, DoesNotSeeTheOrderOfAnImagesRows) {
  const FlowNetwork network(flowGolden().weights());
  ImageCondition turned = flowCondition();
  const auto reverseRows = [](std::vector<float>& values, size_t width) {
    std::reverse(values.begin(), values.end());
    for (size_t i = 0; i < values.size(); i += width) {
      std::reverse(values.begin() + static_cast<ptrdiff_t>(i),
                   values.begin() + static_cast<ptrdiff_t>(i + width));
    }
  };
  reverseRows(turned.structure, turned.structure_width);
  reverseRows(turned.colour, turned.colour_width);
  const Latent state = flowGolden().latent("input");
  expectLatentsNear(velocityOf(network, state, 0.5, network.context({}, turned)),
                    velocityOf(network, state, 0.5, network.context({}, flowCondition())),
                    kOrderTolerance);
}

TEST(FlowNetwork, ReadsTheImageTheTimeAndEveryToken) {
  const FlowNetwork network(flowGolden().weights());
  const FlowContext context = network.context({}, flowCondition());
  const Latent state = flowGolden().latent("input");
  const Latent velocity = velocityOf(network, state, 0.5, context);
  const auto differs = [&](const Latent& other) {
    for (size_t i = 0; i < other.tokens.size(); ++i) {
      if (std::abs(other.tokens[i] - velocity.tokens[i]) > 1e-4f) return true;
    }
    return false;
  };
  EXPECT_TRUE(differs(velocityOf(network, state, 0.6, context)));
  EXPECT_TRUE(differs(velocityOf(network, state, 0.5, network.emptyContext({}, context.rows))));
  Latent other = state;
  other.camera[4] += 0.5f;
  EXPECT_TRUE(differs(velocityOf(network, other, 0.5, context)));
  other = state;
  other.tokens.back() += 0.5f;
  EXPECT_TRUE(differs(velocityOf(network, other, 0.5, context)));
}

TEST(FlowNetwork, GivesTheSameBitsForAnyNumberOfThreads) {
  const FlowNetwork network(flowGolden().weights());
  std::vector<Latent> velocities;
  for (const unsigned threads : {1u, 2u, 3u}) {
    withThreads(threads, [&] {
      const FlowContext context = network.context({}, flowCondition());
      velocities.push_back(velocityOf(network, flowGolden().latent("input"), 0.7, context));
    });
  }
  expectSameLatents(velocities[1], velocities[0]);
  expectSameLatents(velocities[2], velocities[0]);
}

TEST(FlowNetwork, TakesNoMoreMemoryThanItsBound) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "the sanitizer's own memory would be measured";
#endif
  constexpr uint64_t kTokens = 4500;
  const FlowNetwork network(flowGolden().weights());
  const FlowContext context = network.context({}, flowCondition());
  const GenerationNoise noise = drawNoise({.tokens = kTokens * 16}, {});
  const Latent state = startSampling(network, kTokens, noise, {}).latent;
  uint64_t bound = 0, peak = 0;
  withThreads(2, [&] {
    bound = network.memoryBound(kTokens, context.rows);
    peak = peakMemoryOf([&] { velocityOf(network, state, 0.5, context); });
  });
  // Large arrays take whole pages of 2 MiB, of which there are five; the result comes on top.
  const uint64_t rounding = (5 * uint64_t{2} << 20) + kTokens * 16 * sizeof(float);
  EXPECT_GT(peak, bound / 2);  // else this measures nothing
  EXPECT_LE(peak, bound + rounding);
}

TEST(FlowNetwork, StopsWithinASecondAtAnyMoment) {
  // 6000 tokens take a second or more; each try is cancelled at another moment of it.
  const FlowNetwork network(flowGolden().weights());
  const FlowContext context = network.context({}, flowCondition());
  const GenerationNoise noise = drawNoise({.tokens = 6000 * 16}, {});
  const Latent state = startSampling(network, 6000, noise, {}).latent;
  using Clock = std::chrono::steady_clock;
  for (const int milliseconds : {5, 50, 150, 300}) {
    Progress progress;
    Clock::time_point cancelled;
    std::thread user([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds));
      cancelled = Clock::now();
      progress.cancel();
    });
    Latent velocity;
    bool was_cancelled = false;
    try {
      network.velocity({.progress = &progress}, state, 0.5, context, velocity);
    } catch (const Error& error) {
      was_cancelled = error.code() == ErrorCode::kCancelled;
    }
    const Clock::time_point stopped = Clock::now();
    user.join();
    EXPECT_TRUE(was_cancelled || milliseconds > 50) << milliseconds;
    if (was_cancelled) {
      EXPECT_LT(stopped - cancelled, std::chrono::seconds(1));
    }
  }
}

TEST(FlowNetwork, StopsWhenCancelled) {
  const FlowNetwork network(flowGolden().weights());
  Progress progress;
  const NetworkRun run = {.progress = &progress};
  const FlowContext context = network.context(run, flowCondition());
  progress.cancel();
  Latent velocity;
  messageOf([&] { network.velocity(run, flowGolden().latent("input"), 0.5, context, velocity); },
            ErrorCode::kCancelled);
  messageOf([&] { network.context(run, flowCondition()); }, ErrorCode::kCancelled);
}

TEST(FlowNetwork, RefusesWhatDoesNotFitItsSizes) {
  const FlowNetwork network(flowGolden().weights());
  const FlowContext context = network.context({}, flowCondition());
  const Latent state = flowGolden().latent("input");
  const auto refused = [&](const Latent& bad, double time, const FlowContext& with) {
    return messageOf([&] { velocityOf(network, bad, time, with); }, ErrorCode::kInvalidArgument);
  };
  Latent bad = state;
  bad.token_count = 63;
  EXPECT_EQ(refused(bad, 0.5, context),
            "a latent has 63 tokens of 16 numbers; the flow network of flow.safetensors wants 1 to "
            "65536 of 16");
  bad = state;
  bad.tokens[7] = std::numeric_limits<float>::quiet_NaN();
  refused(bad, 0.5, context);
  bad = state;
  bad.camera[2] = std::numeric_limits<float>::infinity();
  refused(bad, 0.5, context);
  EXPECT_EQ(refused(state, 1.5, context), "the time of a flow is 1.5; 0 to 1 is allowed");
  refused(state, std::nan(""), context);
  FlowContext cut = context;
  cut.values.pop_back();
  refused(state, 0.5, cut);
  refused(state, 0.5, {});

  const auto refusedCondition = [&](const std::function<void(ImageCondition&)>& change) {
    ImageCondition condition = flowCondition();
    change(condition);
    return messageOf([&] { network.context({}, condition); }, ErrorCode::kInvalidArgument);
  };
  EXPECT_EQ(refusedCondition([](ImageCondition& c) { c.structure_width = 41; }),
            "a condition has 20 rows of 41 and 12 features; the flow network of flow.safetensors "
            "wants at least one row of 40 and 12");
  refusedCondition([](ImageCondition& c) { c.colour.pop_back(); });
  refusedCondition([](ImageCondition& c) { c.rows = 0; });
  refusedCondition([](ImageCondition& c) { c.colour[3] = std::nanf(""); });
}

struct BadFile {
  const char* what;
  std::function<void(std::map<std::string, WeightTensor>&)> change;
  std::vector<std::string> words;  ///< of the message, beside the file's name
};

TEST(FlowNetwork, RefusesFilesThatAreNotOneInOneSentence) {
  static const float kNan[96] = {std::numeric_limits<float>::quiet_NaN()};
  const std::vector<BadFile> files = {
      {"missing matrix",
       [](auto& t) { t.erase("blocks.1.attn.out.weight"); },
       {"blocks.1.attn.out.weight", "96"}},
      {"missing bias", [](auto& t) { t.erase("out_layer.bias"); }, {"out_layer.bias", "16"}},
      {"no block at all",
       [](auto& t) {
         std::erase_if(t, [](const auto& e) { return e.first.starts_with("blocks."); });
       },
       {"blocks.0.attn.q_norm.gamma"}},
      {"a block too many",
       [](auto& t) { t["blocks.3.attn.out.weight"] = t["blocks.1.attn.out.weight"]; },
       {"1 tensor", "blocks.3.attn.out.weight", "2 blocks"}},
      {"another network's tensor",
       [](auto& t) { t["octree.in_proj.weight"] = t["out_layer.bias"]; },
       {"octree.in_proj.weight", "2 blocks"}},
      {"wrong shape",
       [](auto& t) {
         t["cam_out_layer.weight"].shape = {96, 5};
       },
       {"cam_out_layer.weight", "96, 5", "5, 96"}},
      {"heads that do not fill the channels",
       [](auto& t) {
         t["blocks.0.attn.q_norm.gamma"].shape = {3, 24};
       },
       {"blocks.0.attn.q_norm.gamma", "3, 24", "96"}},
      {"frequencies of another head",
       [](auto& t) { t["repo_layers.1.freqs_2"].shape = {3}; },
       {"repo_layers.1.freqs_0", "11", "12"}},
      {"whole numbers",
       [](auto& t) {
         t["input_layer.weight"].type = WeightType::kOther;
         t["input_layer.weight"].type_name = "I64";
       },
       {"input_layer.weight", "I64"}},
      {"NaN in a norm",
       [](auto& t) {
         t["repo_layers.0.norm.weight"].bytes = reinterpret_cast<const uint8_t*>(kNan);
       },
       {"repo_layers.0.norm.weight"}},
      {"nothing", [](auto& t) { t.clear(); }, {"input_layer.weight"}},
  };
  for (const BadFile& file : files) {
    SCOPED_TRACE(file.what);
    const WeightTable weights = flowGolden().weightsWith(file.change);
    const std::string message =
        messageOf([&] { FlowNetwork network(weights); }, ErrorCode::kFormat);
    EXPECT_NE(message.find("flow.safetensors"), std::string::npos) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos);
    for (const std::string& word : file.words) {
      EXPECT_NE(message.find(word), std::string::npos) << message << " lacks " << word;
    }
  }
}

TEST(FlowNetwork, LeavesTheTrainingProgramsBufferAlone) {
  const WeightTable weights =
      flowGolden().weightsWith([](auto& t) { t["pos_pe"] = t["input_layer.weight"]; });
  EXPECT_EQ(FlowNetwork(weights).sizes().block_count, 2u);
}

TEST(FlowNetwork, RefusesWeightsThatGiveNoNumbers) {
  static const std::vector<float> huge(16 * 96, 3e38f);
  const WeightTable weights = flowGolden().weightsWith(
      [](auto& t) { t["out_layer.weight"].bytes = reinterpret_cast<const uint8_t*>(huge.data()); });
  const FlowNetwork network(weights);
  const FlowContext context = network.context({}, flowCondition());
  const std::string message = messageOf(
      [&] { velocityOf(network, flowGolden().latent("input"), 0.5, context); }, ErrorCode::kFormat);
  EXPECT_NE(message.find("flow.safetensors"), std::string::npos) << message;
}

}  // namespace
}  // namespace stipple
