#include "fit/fit_options.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <set>
#include <string>

#include "base/error.h"
#include "fit/fit_option_table.h"

namespace stipple {
namespace {

std::string messageOf(const std::function<void()>& work) {
  try {
    work();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    return error.what();
  }
  return "no error";
}

TEST(FitOptionTable, SaysOfEveryOptionWhatItIs) {
  std::set<std::string> names;
  for (const FitOption& option : fitOptionTable()) {
    SCOPED_TRACE(option.name);
    EXPECT_TRUE(names.insert(option.name).second);
    bool has_end = false;
    for (const FitOptionAlias& alias : option.aliases) {
      EXPECT_TRUE(!*alias.name || (!has_end && names.insert(alias.name).second));
      EXPECT_GT(alias.unit, 0);
      has_end = !*alias.name;
    }
    const std::string help = option.help;
    EXPECT_GT(help.size(), 20u);
    EXPECT_EQ(help.back(), '.');
    EXPECT_NE(option.models, kOfNoModel);
    EXPECT_EQ(option.stored_of & ~option.models, 0u);
    EXPECT_LE(option.minimum, option.maximum);
    EXPECT_EQ(option.kind == FitOptionKind::kChoice, *option.choices != '\0');
  }
}

TEST(FitOptionTable, GivesBackWhatIsSet) {
  for (const FitOption& option : fitOptionTable()) {
    SCOPED_TRACE(option.name);
    FitOptions options;
    FitValue value = std::string("adaptive");
    if (option.kind == FitOptionKind::kNumber) {
      value = 0.5;
    } else if (option.kind != FitOptionKind::kText) {
      value = static_cast<uint64_t>(std::min(option.maximum, 7.0));
    }
    option.member.set(options, value);
    EXPECT_EQ(option.member.get(options), value);
    EXPECT_EQ(fitValueFrom(option, fitValueText(option, value), option.name), value);
  }
}

TEST(FitOptionTable, DefaultsAndPresetsAreInRange) {
  for (const FitOption& option : fitOptionTable()) {
    SCOPED_TRACE(option.name);
    requireInRange(option, option.member.get(defaultFitOptions()), option.name);
  }
  for (const FitKind model : {FitKind::kExplicit, FitKind::kField, FitKind::kMotion,
                              FitKind::kScaffold, FitKind::kRelay}) {
    for (const FitQuality quality :
         {FitQuality::kFast, FitQuality::kBalanced, FitQuality::kFineDetail}) {
      FitOptions options = defaultFitOptions();
      applyPreset(options, model, quality);
      EXPECT_EQ(options.model, model);
      requireFitOptions(options);
    }
  }
}

TEST(FitOptionTable, BalancedFieldsAreTheModelsOwnDefaults) {
  FitOptions options = defaultFitOptions();
  applyPreset(options, FitKind::kField, FitQuality::kBalanced);
  const FieldModelOptions model;
  EXPECT_EQ(options.least_anchors, model.least_anchors);
  EXPECT_EQ(options.most_anchors, model.most_anchors);
  EXPECT_EQ(options.gaussians_per_anchor, model.gaussians_per_anchor);
  EXPECT_EQ(static_cast<int>(options.sh_degree), model.sh_degree);
  EXPECT_EQ(options.antialias, model.antialias);
}

TEST(FitOptionTable, FindsOptionsByWhatTheyAreAndWereCalled) {
  double unit = 0;
  EXPECT_STREQ(findFitOption("--max-splats", &unit)->name, "max_splats");
  EXPECT_EQ(unit, 1);
  EXPECT_STREQ(findFitOption("gaussians")->name, "max_splats");
  EXPECT_STREQ(findFitOption("anchors")->name, "max_anchors");
  EXPECT_STREQ(findFitOption("most_anchors")->name, "max_anchors");
  EXPECT_STREQ(findFitOption("least_anchors")->name, "min_anchors");
  EXPECT_STREQ(findFitOption("picture_bytes", &unit)->name, "image_bytes");
  EXPECT_EQ(unit, 1);
  for (const char* scaled : {"picture_memory", "--image-memory"}) {
    EXPECT_STREQ(findFitOption(scaled, &unit)->name, "image_bytes");
    EXPECT_EQ(unit, 1 << 20);
  }
  EXPECT_STREQ(findFitOption("start")->name, "start_splats");
  EXPECT_STREQ(findFitOption("checkpoint_every")->name, "checkpoint_interval");
  EXPECT_STREQ(findFitOption("--memory", &unit)->name, "max_bytes");
  EXPECT_EQ(unit, 1 << 20);
  EXPECT_EQ(findFitOption("max"), nullptr);
  EXPECT_EQ(findFitOption(""), nullptr);
}

TEST(FitOptionTable, ReadsBytesWithTheirUnits) {
  const FitOption& option = *findFitOption("image_bytes");
  const auto read = [&](const char* text, double unit = 1) {
    return std::get<uint64_t>(fitValueFrom(option, text, "image_bytes", unit));
  };
  EXPECT_EQ(read("123"), 123u);
  EXPECT_EQ(read("2KiB"), 2048u);
  EXPECT_EQ(read("1.5 MiB"), 3u << 19);
  EXPECT_EQ(read("0.001", 1 << 20), 1048u);
  EXPECT_EQ(fitValueText(option, uint64_t{3} << 30), "3GiB");
  EXPECT_EQ(fitValueText(option, uint64_t{0}), "0");
  for (const char* text : {"", "-1", "GiB", "1TiB", "1e30GiB", "nanMiB"}) {
    EXPECT_NE(messageOf([&] { read(text); }).find("; 0 or more is allowed"), std::string::npos)
        << text;
  }
}

TEST(FitOptionTable, SaysWhatIsAllowed) {
  const auto message = [](const char* name, const char* text) {
    return messageOf([&] { fitValueFrom(*findFitOption(name), text, name); });
  };
  EXPECT_EQ(message("iterations", "0"), "iterations is 0; 1 to 10000000 is allowed");
  EXPECT_EQ(message("iterations", "-5"), "iterations is -5; 1 to 10000000 is allowed");
  EXPECT_EQ(message("iterations", "many"), "iterations is many; 1 to 10000000 is allowed");
  EXPECT_EQ(message("ssim_share", "nan"), "ssim_share is nan; 0 to 1 is allowed");
  EXPECT_EQ(message("jitter", "2"), "jitter is 2; 0 or 1 is allowed");
  EXPECT_EQ(message("shell", "never"), "shell is never; auto (0), on (1) or off (2) is allowed");
  EXPECT_EQ(message("checkpoint_seconds", "inf"),
            "checkpoint_seconds is inf; 0 or more is allowed");
}

TEST(FitOptions, AreRefusedWhereTheyDoNotGoTogether) {
  FitOptions options = defaultFitOptions();
  options.start_splats = 11;
  options.max_splats = 10;
  EXPECT_EQ(messageOf([&] { requireFitOptions(options); }),
            "options->start_splats is 11; 0 to 10 is allowed");
  options.model = FitKind::kField;  // it has no start
  requireFitOptions(options);
  options.least_anchors = options.most_anchors + 1;
  EXPECT_NE(messageOf([&] { requireFitOptions(options); }).find("options->min_anchors is"),
            std::string::npos);
  options = defaultFitOptions();
  options.model = static_cast<FitKind>(77);
  EXPECT_EQ(
      messageOf([&] { requireFitOptions(options); }),
      "options->model is 77; explicit (0), field (1), motion (2), scaffold (3) or relay (4) is "
      "allowed");
  options = defaultFitOptions();
  options.resume = true;
  EXPECT_NE(messageOf([&] { requireFitOptions(options); }).find("no checkpoint_path is given"),
            std::string::npos);
  options = defaultFitOptions();
  options.strategy = "best";
  EXPECT_NE(messageOf([&] { requireFitOptions(options); }).find("best"), std::string::npos);
  options.model = FitKind::kField;
  options.strategy = "adaptive";
  EXPECT_NE(messageOf([&] { requireFitOptions(options); }).find("there is learned_density"),
            std::string::npos);
}

TEST(FitOptions, AFieldsStrategySaysHowItsDensityIsLearned) {
  FitOptions options = defaultFitOptions();
  EXPECT_EQ(resolved(options).strategy, "adaptive");
  options.model = FitKind::kMotion;
  EXPECT_EQ(resolved(options).strategy, "temporal");
  options.model = FitKind::kField;
  options.density_gradient = false;
  EXPECT_FALSE(resolved(options).density_gradient);
  options.strategy = "learned_density";
  EXPECT_TRUE(resolved(options).density_gradient);
}

}  // namespace
}  // namespace stipple
