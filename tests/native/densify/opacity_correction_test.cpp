#include "densify/parts/opacity_correction.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "densify/control_scene.h"
#include "densify/quantities/opacity_forms.h"
#include "densify/strategies.h"

namespace stipple {
namespace {

using ::testing::HasSubstr;
using namespace stipple::testing;

TEST(OpacityCorrection, TwoLayersAreAsOpaqueAsTheirParent) {
  for (double logit = -30; logit <= 30; logit += 0.37) {
    const long double x = static_cast<long double>(static_cast<float>(logit));
    // 1 - o = 1 / (1 + e^x); o' = o / (1 + sqrt(1 - o)).
    const long double transparency = 1 / (1 + std::exp(x));
    const long double root = std::sqrt(transparency);
    const long double shared = 1 / (1 + std::exp(-x)) / (1 + root);
    const double expected = static_cast<double>(std::log(shared) - std::log(root));
    const float seen = sharedOpacityLogit(static_cast<float>(logit));
    // Half a last digit of float32.
    EXPECT_NEAR(seen, expected, 6e-8 * std::max(1.0, std::abs(expected))) << logit;
  }
  // o = 0.5 becomes 0.29289.
  EXPECT_NEAR(activatedOpacity(sharedOpacityLogit(0)), 0.2928932f, 1e-7f);
}

TEST(OpacityCorrection, EndsOfNumbersStayFinite) {
  // o -> 0: half of it; o -> 1: the square root of what is left.
  EXPECT_NEAR(sharedOpacityLogit(-60), -60 - 0.6931472, 4e-6);
  EXPECT_NEAR(sharedOpacityLogit(3000), 1500, 1e-3);
  for (const float x : {-std::numeric_limits<float>::max(), std::numeric_limits<float>::max()}) {
    EXPECT_TRUE(std::isfinite(sharedOpacityLogit(x)));
  }
}

TEST(OpacityCorrection, CorrectsASplatAndItsCopy) {
  const auto strategy = makeStrategy("adaptive+opacity_correction");
  strategy->observe(at(1), Seen({1, 0}).statistics());
  const RawSplats splats = splatsOf({{0.005f, 0.5f}, {0.005f, 0.5f}});
  const RawSplats now = after(*editAt(*strategy, at(600), splats), splats);
  ASSERT_EQ(now.size(), 3u);
  for (const size_t row : {0u, 2u}) EXPECT_NEAR(now.logits[row], -0.8813736f, 1e-6f);
  EXPECT_EQ(now.logits[1], splats.logits[1]);
}

TEST(OpacityCorrection, CorrectsBothChildrenOfASplit) {
  const auto strategy = makeStrategy("adaptive+opacity_correction");
  strategy->observe(at(1), Seen({1}).statistics());
  const RawSplats splats = splatsOf({{0.05f, 0.5f}});
  const RawSplats now = after(*editAt(*strategy, at(600), splats), splats);
  ASSERT_EQ(now.size(), 2u);
  for (const float logit : now.logits) EXPECT_NEAR(logit, -0.8813736f, 1e-6f);
}

TEST(OpacityCorrection, IsRefusedBesideWhatDecidesTheSame) {
  const char* expected = "does not go with long_axis_split: both decide the opacity of children";
  EXPECT_THAT(messageOf([] { makeStrategy("adaptive+long_axis_split+opacity_correction"); }),
              HasSubstr(expected));
  // In any order: what a user names is not taken away.
  EXPECT_THAT(messageOf([] { makeStrategy("adaptive+opacity_correction+long_axis_split"); }),
              HasSubstr("does not go with opacity_correction: both decide"));
}

}  // namespace
}  // namespace stipple
