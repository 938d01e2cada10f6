#include "fit/fit_settings.h"

#include <gtest/gtest.h>

#include <functional>
#include <sstream>
#include <string>

#include "base/error.h"
#include "data/views/memory_view_source.h"
#include "fit/fit_memory.h"
#include "fit/fit_option_table.h"

namespace stipple {
namespace {

std::string messageOf(const std::function<void()>& work, ErrorCode code) {
  try {
    work();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code);
    return error.what();
  }
  return "no error";
}

MemoryViewSource threeViews() {
  MemoryViewSource views(ColourSpace::kDisplay);
  for (int v = 0; v < 3; ++v) {
    Camera camera;
    camera.width = 4;
    camera.height = 3;
    camera.fx = camera.fy = 4;
    camera.cx = 2;
    camera.cy = 1.5;
    ViewPicture picture;
    picture.width = 4;
    picture.height = 3;
    picture.colour.assign(4 * 3 * 3, 0.5f);
    views.add(camera, std::move(picture), std::to_string(v));
  }
  return views;
}

FitOptions fieldOptions() {
  FitOptions options = defaultFitOptions();
  applyPreset(options, FitKind::kField, FitQuality::kFast);
  return options;
}

// Texts that checkpoints have had from the beginning: the order and the form of every value count.
TEST(FitSettings, AreWrittenAsCheckpointsHaveThem) {
  FitSettings settings{resolved(defaultFitOptions()), 3, "00ff"};
  settings.options.strategy = "adaptive(threshold=0.1)";
  EXPECT_EQ(
      settingsJson(settings),
      "{\"model\": \"explicit\", \"strategy\": \"adaptive(threshold=0.1)\", \"start_splats\": "
      "0, \"max_splats\": 150000, \"sh_degree\": 3, \"antialias\": 0, \"iterations\": 2000, "
      "\"background\": 2, \"holdout\": 8, \"seed\": 0, \"ssim_share\": 0.20000000000000001, "
      "\"coarse_to_fine\": 1, \"measure_interval\": 0, \"views\": 3, \"views_key\": \"00ff\"}");
  settings.options = resolved(fieldOptions());
  EXPECT_EQ(
      settingsJson(settings),
      "{\"model\": \"field\", \"least_anchors\": 1024, \"most_anchors\": 8192, "
      "\"gaussians_per_anchor\": 4, \"sh_degree\": 0, \"antialias\": 1, \"density_gradient\": "
      "1, \"jitter\": 1, \"shell\": 0, \"iterations\": 500, \"background\": 2, \"holdout\": 8, "
      "\"seed\": 0, \"ssim_share\": 0.20000000000000001, \"measure_interval\": 0, \"views\": "
      "3, \"views_key\": \"00ff\"}");
}

/// Another value of an option, within its range.
FitValue otherValue(const FitOption& option, const FitOptions& options) {
  const FitValue value = option.member.get(options);
  if (option.name == std::string("strategy")) return std::string("mcmc");
  if (std::holds_alternative<std::string>(value)) return std::string("other");
  if (const auto* number = std::get_if<double>(&value)) return *number / 3;
  const uint64_t count = std::get<uint64_t>(value);
  const bool has_room = static_cast<double>(count) + 1 <= option.maximum;
  return has_room ? count + 1 : count - 1;
}

TEST(FitSettings, ComeBackAsTheyWereWritten) {
  FitOptions moving = defaultFitOptions();
  moving.model = FitKind::kMotion;
  for (FitOptions options :
       {resolved(defaultFitOptions()), resolved(fieldOptions()), resolved(moving)}) {
    const uint32_t model = 1u << static_cast<uint32_t>(options.model);
    for (const FitOption& option : fitOptionTable()) {
      const bool is_stored = (option.stored_of & model) != 0;
      if (is_stored && option.name != std::string("model")) {
        option.member.set(options, otherValue(option, options));
      }
    }
    const FitSettings settings{options, 5, "0123456789abcdef"};
    const FitSettings read = readSettings(settingsJson(settings));
    EXPECT_EQ(settingsJson(read), settingsJson(settings));
    for (const FitOption& option : fitOptionTable()) {
      if ((option.stored_of & model) == 0) continue;
      EXPECT_EQ(option.member.get(read.options), option.member.get(options)) << option.name;
    }
  }
}

TEST(FitSettings, FormerNamesAndWordsAndMissingOptionsAreUnderstood) {
  const FitSettings read =
      readSettings(R"({"model": "explicit", "gaussians": 12, "background": "white"})");
  EXPECT_EQ(read.options.max_splats, 12u);
  EXPECT_EQ(read.options.background, BackgroundPolicy::kWhite);
  EXPECT_EQ(read.options.ssim_share, defaultFitOptions().ssim_share);
  EXPECT_EQ(read.options.strategy, "adaptive");
}

TEST(FitSettings, TextThatIsNoSettingsIsRefused) {
  for (const char* text : {"", "[]", "{\"iterations\": {}}", "{\"iterations\": 0}", "{\"a\": 1}",
                           "{\"views\": \"x\"}", "{\"seed\": -1}"}) {
    EXPECT_NE(messageOf([&] { readSettings(text); }, ErrorCode::kFormat).find("cannot be read"),
              std::string::npos)
        << text;
  }
}

TEST(FitSettings, AFitGoesOnWithNothingElseChanged) {
  const MemoryViewSource views = threeViews();
  for (const FitOptions& options : {resolved(defaultFitOptions()), resolved(fieldOptions())}) {
    const uint32_t model = 1u << static_cast<uint32_t>(options.model);
    const FitSettings now = settingsOf(options, views);
    requireSameSettings(settingsJson(now), now, "a");
    for (const FitOption& option : fitOptionTable()) {
      SCOPED_TRACE(option.name);
      if (option.name == std::string("model")) continue;
      FitSettings before = now;
      const FitValue other = otherValue(option, options);
      option.member.set(before.options, other);
      const auto resume = [&] { requireSameSettings(settingsJson(before), now, "a.checkpoint"); };
      if ((option.stored_of & model) == 0) {
        resume();
        continue;
      }
      std::ostringstream wanted;
      wanted << "a.checkpoint is of a fit whose " << option.name << " was "
             << fitValueText(option, other) << "; now it is "
             << fitValueText(option, option.member.get(options)) << ", and resuming needs the same";
      EXPECT_EQ(messageOf(resume, ErrorCode::kInvalidArgument), wanted.str());
    }
  }
}

TEST(FitSettings, AFitDoesNotGoOnAsAnotherModelOrWithOtherViews) {
  const MemoryViewSource views = threeViews();
  const FitSettings now = settingsOf(resolved(defaultFitOptions()), views);
  const auto message = [&](const FitSettings& before) {
    return messageOf([&] { requireSameSettings(settingsJson(before), now, "a"); },
                     ErrorCode::kInvalidArgument);
  };
  EXPECT_NE(message(settingsOf(resolved(fieldOptions()), views))
                .find("model was field; now it is explicit"),
            std::string::npos);
  FitSettings other = now;
  other.views_key = "0";
  EXPECT_NE(message(other).find("other views"), std::string::npos);
  other.view_count = 2;
  EXPECT_NE(message(other).find("number of views was 2; now it is 3"), std::string::npos);
}

TEST(FitSettings, AFitDoesNotGoOnFromAnotherStart) {
  const MemoryViewSource views = threeViews();
  const FitOptions options = resolved(defaultFitOptions());
  SplatCloud start;
  start.resize(2);
  const FitSettings own = settingsOf(options, views);
  const FitSettings given = settingsOf(options, views, &start);
  EXPECT_EQ(readSettings(settingsJson(given)).start_key, given.start_key);
  requireSameSettings(settingsJson(given), given, "a");
  start.positions[5] = 1;
  const FitSettings other = settingsOf(options, views, &start);
  const auto message = [&](const FitSettings& before, const FitSettings& now) {
    return messageOf([&] { requireSameSettings(settingsJson(before), now, "a"); },
                     ErrorCode::kInvalidArgument);
  };
  EXPECT_NE(message(given, other).find("began with other splats"), std::string::npos);
  EXPECT_NE(message(given, own).find("began with other splats"), std::string::npos);
  EXPECT_NE(message(own, given).find("began without splats"), std::string::npos);
}

TEST(FitMemory, LowersSplatsAndImagesToItsLimit) {
  const MemoryViewSource views = threeViews();
  FitOptions options = resolved(defaultFitOptions());
  const FitOptions free = options;
  holdToMemory(options, views);
  EXPECT_EQ(options.max_splats, free.max_splats);
  options.max_bytes = 10 << 20;
  options.start_splats = 100000;
  holdToMemory(options, views);
  EXPECT_LT(options.max_splats, free.max_splats);
  EXPECT_EQ(options.start_splats, options.max_splats);
  EXPECT_EQ(options.picture_bytes, 5u << 20);
  EXPECT_LE(fitMemoryBound(options, views), options.max_bytes);
  options.max_bytes = 100;
  EXPECT_NE(messageOf([&] { holdToMemory(options, views); }, ErrorCode::kMemoryLimit)
                .find("options->max_bytes is 100; one splat"),
            std::string::npos);
  FitOptions field = fieldOptions();
  field.max_bytes = 1 << 20;
  EXPECT_NE(
      messageOf([&] { holdToMemory(field, views); }, ErrorCode::kMemoryLimit).find("8192 anchors"),
      std::string::npos);
}

}  // namespace
}  // namespace stipple
