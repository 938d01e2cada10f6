// Expected numbers: counts of layers made apart from these functions, rounded to two digits, with
// small layers left out; therefore 4 %.
#include "generate/flow_cost.h"

#include <gtest/gtest.h>

namespace stipple {
namespace {

constexpr double kTera = 1e12;
constexpr double kShare = 0.04;

void expectAbout(double seen, double expected) {
  EXPECT_NEAR(seen, expected, kShare * expected);
}

TEST(FlowCost, IsThatOfThePublishedNetworks) {
  const FlowSizes flow = publishedFlowSizes();
  expectAbout(structureEncoderCost(1024).flops, 9.6 * kTera);
  expectAbout(structureEncoderCost(1024).attention_flops, 2.8 * kTera);
  expectAbout(colourEncoderCost(1024).flops, 4.9 * kTera);
  expectAbout(colourEncoderCost(1024).attention_flops, 0.55 * kTera);
  expectAbout(structureEncoderCost(512).flops, 1.9 * kTera);
  expectAbout(colourEncoderCost(512).flops, 1.13 * kTera);
  expectAbout(flowCallCost(flow, 8192, 4101).flops, 23.5 * kTera);
  expectAbout(flowCallCost(flow, 8192, 4101).attention_flops, 14.9 * kTera + 0.55 * kTera);
  // Without an image: 11.5, and the refiners, 0.97.
  expectAbout(flowCallCost(flow, 8192, 1).flops, 12.5 * kTera);
  expectAbout(octreeLevelCost(8192, 8192).flops, 1.8 * kTera);
  expectAbout(splatDecoderCost(8192, 8192).flops, 12.7 * kTera);
  expectAbout(splatDecoderCost(1024, 8192).flops, 1.1 * kTera);
}

TEST(FlowCost, OfSamplingIsThatOfItsCalls) {
  const FlowSizes flow = publishedFlowSizes();
  const double with = flowCallCost(flow, 8192, 4101).flops;
  const double without = flowCallCost(flow, 8192, 1).flops;
  const double context = flowContextCost(flow, 4101).flops;
  const FlowSettings settings = {.steps = 20, .guidance = 3};
  EXPECT_DOUBLE_EQ(flowSamplingCost(flow, 8192, 4101, settings).flops,
                   context + 20 * with + 20 * without);
  EXPECT_DOUBLE_EQ(flowSamplingCost(flow, 8192, 4101, {.steps = 10, .guidance = 1}).flops,
                   context + 10 * with);
  expectAbout(flowSamplingCost(flow, 8192, 4101, settings).flops, 0.72e15);
}

TEST(FlowCost, CountsTheBytesOfTheFiles) {
  // Files: biases, norms and tables are the rest.
  expectAbout(static_cast<double>(structureEncoderCost(1024).weight_bytes), 1681.2e6);
  expectAbout(static_cast<double>(colourEncoderCost(1024).weight_bytes), 138e6);
  expectAbout(
      static_cast<double>(flowSamplingCost(publishedFlowSizes(), 8192, 4101, {}).weight_bytes),
      741.1e6);
  expectAbout(static_cast<double>(octreeCost(8192, 8192).weight_bytes), 102e6);
  expectAbout(static_cast<double>(splatDecoderCost(8192, 8192).weight_bytes), 475e6);
}

TEST(FlowCost, ListsEveryStageAndRisesWithWhatIsAskedFor) {
  const std::vector<NamedCost> full = generationCosts({});
  const std::vector<NamedCost> fast =
      generationCosts({.canvas_size = 512, .flow = {.steps = 10}, .splat_count = 32768});
  ASSERT_EQ(full.size(), 5u);
  for (size_t i = 0; i < full.size(); ++i) {
    EXPECT_LT(fast[i].cost.flops, full[i].cost.flops) << full[i].stage;
    EXPECT_LE(full[i].cost.attention_flops, full[i].cost.flops);
    EXPECT_GT(full[i].cost.weight_bytes, 0u);
  }
}

}  // namespace
}  // namespace stipple
