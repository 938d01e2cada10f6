#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "densify/control_part.h"
#include "densify/control_scene.h"
#include "densify/strategies.h"
#include "densify/strategies/adaptive.h"

namespace stipple {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using namespace stipple::testing;

/// Decides nothing; stands where roles matter alone.
class Owner final : public ControlPart {
 public:
  Owner(const char* name, ControlRoles owned, ControlRoles needed = 0)
      : name_(name), owned_(owned), needed_(needed) {}
  const char* name() const override { return name_; }
  ControlRoles owns() const override { return owned_; }
  ControlRoles needs() const override { return needed_; }

 private:
  const char* name_;
  ControlRoles owned_;
  ControlRoles needed_;
};

std::vector<std::string> namesOf(const ControlAssembly& assembly) {
  std::vector<std::string> names;
  for (const auto& part : assembly.parts) names.emplace_back(part->name());
  return names;
}

TEST(DensityControl, APartTakesThePlaceOfTheOneThatDecidesTheSame) {
  ControlAssembly assembly = adaptiveControl();
  addPart(assembly, std::make_unique<Owner>(
                        "other", roles(ControlRole::kChildren, ControlRole::kChildOpacity)));
  EXPECT_THAT(namesOf(assembly),
              ElementsAre("screen_pull", "faint_removal", "opacity_reset", "other"));
}

TEST(DensityControl, RefusesTwoOwnersOfOneDecisionByName) {
  ControlAssembly assembly = adaptiveControl();
  addPart(assembly, std::make_unique<Owner>(
                        "wide", roles(ControlRole::kChildren, ControlRole::kChildOpacity)));
  const std::string message = messageOf([&] {
    addPart(assembly, std::make_unique<Owner>("narrow", roles(ControlRole::kChildOpacity)));
  });
  EXPECT_EQ(message, "narrow does not go with wide: both decide the opacity of children");
}

TEST(DensityControl, RefusesAPartWhoseNeedNobodyMeetsWhateverTheRole) {
  for (uint32_t bit = 0; bit < kControlRoleCount; ++bit) {
    const ControlRole role = static_cast<ControlRole>(1u << bit);
    ASSERT_STRNE(wordsOf(role), "") << bit;
    ControlAssembly assembly;
    addPart(assembly, std::make_unique<Owner>("needy", 0, roles(role)));
    EXPECT_EQ(messageOf([&] { makeDensityControl("own", std::move(assembly)); }),
              std::string("needy does not go with own: nothing there decides ") + wordsOf(role));
  }
  EXPECT_STREQ(wordsOf(static_cast<ControlRole>(1u << kControlRoleCount)), "");
}

TEST(DensityControl, RefusesPartsThatNobodyWouldAsk) {
  ControlAssembly assembly;
  const ControlRoles whole = roles(ControlRole::kMultiplication, ControlRole::kChildren);
  addPart(assembly, std::make_unique<Owner>("whole", whole));
  addPart(assembly, std::make_unique<Owner>("score", roles(ControlRole::kScore)));
  EXPECT_EQ(messageOf([&] { makeDensityControl("own", std::move(assembly)); }),
            "score does not go with whole, which decides which splats multiply first itself");
}

TEST(DensityControl, SchedulesCountTheirEvents) {
  FitMoment moment;
  moment.iterations = 30000;
  moment.iteration = 600;
  const EventSchedule schedule;
  EXPECT_TRUE(controlMoment(moment, schedule).is_event);
  EXPECT_EQ(controlMoment(moment, schedule).event, 0u);
  EXPECT_EQ(controlMoment(moment, schedule).event_count, 144u);
  EXPECT_EQ(controlMoment(moment, schedule).until_event, 0u);
  EXPECT_EQ(controlMoment(moment, schedule).interval, 100u);
  moment.iteration = 1;
  EXPECT_EQ(controlMoment(moment, schedule).until_event, 599u);
  moment.iteration = 601;
  EXPECT_EQ(controlMoment(moment, schedule).until_event, 99u);
  moment.iteration = 14900;
  EXPECT_TRUE(controlMoment(moment, schedule).is_event);
  EXPECT_EQ(controlMoment(moment, schedule).event, 143u);
  moment.iteration = 15000;
  EXPECT_FALSE(controlMoment(moment, schedule).is_event);
  EXPECT_FALSE(controlMoment(moment, schedule).is_learning);
  EXPECT_EQ(controlMoment(moment, schedule).until_event, UINT64_MAX);
  EXPECT_EQ(controlMoment(moment, schedule).progress, 1.0);
  moment.iteration = 500;
  EXPECT_FALSE(controlMoment(moment, schedule).is_event);
  EXPECT_EQ(controlMoment(moment, schedule).progress, 0.0);
}

TEST(DensityControl, DrawsByWeightWithoutReplacement) {
  FitMoment moment;
  const std::vector<uint32_t> rows = {0, 1, 2};
  const std::vector<double> weights = {1, 0, 3};
  int first_of_three = 0;
  constexpr int kDraws = 20000;
  for (int k = 0; k < kDraws; ++k) {
    moment.iteration = static_cast<uint64_t>(k) + 1;
    const std::vector<uint32_t> one =
        drawWithoutReplacement(moment, RandomUse::kDensifyChoice, rows, weights, 1);
    ASSERT_EQ(one.size(), 1u);
    ASSERT_NE(one[0], 1u);
    first_of_three += one[0] == 2;
  }
  // Expected 0.75; four standard deviations are 4 sqrt(0.75 0.25 / 20000) = 0.0122.
  EXPECT_NEAR(first_of_three / double{kDraws}, 0.75, 0.0122);
  EXPECT_EQ(drawWithoutReplacement(moment, RandomUse::kDensifyChoice, rows, weights, 5).size(), 2u);
}

/// Every part in every strategy, and every two parts: made, or refused with what they share.
TEST(Strategies, TakeEveryPartOrSayWhyNot) {
  std::vector<std::string> refused;
  const auto attempt = [&](const std::string& text, const std::string& part) {
    const std::string message = messageOf([&] { makeStrategy(text); });
    if (message == "nothing thrown") return;
    EXPECT_THAT(message, HasSubstr(part + " does not go with ")) << text;
    EXPECT_THAT(message, HasSubstr("decide")) << text;
    refused.push_back(text);
  };
  for (const std::string& name : strategyNames()) {
    for (const StrategyEntry& part : partEntries()) {
      attempt(name + "+" + part.name, part.name);
      for (const StrategyEntry& second : partEntries()) {
        if (part.name == second.name) continue;
        if (name == "adaptive") attempt(name + "+" + part.name + "+" + second.name, second.name);
      }
    }
  }
  EXPECT_THAT(refused,
              ::testing::IsSupersetOf({"improved+opacity_correction", "mcmc+long_axis_split",
                                       "adaptive+opacity_correction+long_axis_split"}));
}

TEST(Strategies, RefuseWhatIsNotThere) {
  EXPECT_THAT(messageOf([] { makeStrategy("adaptive+nothing"); }), HasSubstr("part is 'nothing'"));
  EXPECT_THAT(messageOf([] { makeStrategy("adaptive(treshold=1)"); }),
              HasSubstr("adaptive has no setting 'treshold'; there is threshold"));
  EXPECT_THAT(messageOf([] { makeStrategy("adaptive(threshold=-1)"); }),
              HasSubstr("adaptive.threshold is -1"));
  EXPECT_THAT(messageOf([] { makeStrategy("adaptive(threshold"); }), HasSubstr("is allowed"));
  EXPECT_THAT(messageOf([] { makeStrategy("adaptive(threshold=a)"); }), HasSubstr("is allowed"));
  EXPECT_THAT(messageOf([] { makeStrategy(""); }), HasSubstr("strategy is ''"));
}

}  // namespace
}  // namespace stipple
