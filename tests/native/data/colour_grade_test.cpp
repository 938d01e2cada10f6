#include "data/clouds/colour_grade.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <string>

#include "base/error.h"
#include "math/colour.h"

namespace stipple {
namespace {

using ::testing::HasSubstr;
using Colour = std::array<double, 3>;

Colour graded(const GradeSettings& settings, ColourSpace space, Colour colour) {
  applyGrade(gradeOf(settings, space), colour.data());
  return colour;
}

std::string refusalOf(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    return error.what();
  }
  return "no error";
}

TEST(ColourGrade, IsExactlyNeutralByDefault) {
  for (const ColourSpace space : {ColourSpace::kDisplay, ColourSpace::kLinear}) {
    EXPECT_TRUE(gradeOf({}, space).isNeutral());
  }
}

TEST(ColourGrade, MultipliesTheLightOfDisplayColoursAboveTheFoot) {
  for (const double stops : {-2.0, -0.5, 1.0, 3.0}) {
    GradeSettings settings;
    settings.exposure = stops;
    settings.tint = {1.0, 0.5, 2.0};
    for (const double value : {0.05, 0.2, 0.5, 1.0, 1.7}) {
      const Colour seen = graded(settings, ColourSpace::kDisplay, {value, value, value});
      for (size_t c = 0; c < 3; ++c) {
        const double factor = std::exp2(stops) * settings.tint[c];
        const double exact = linearToSrgb(srgbToLinear(value) * factor);
        // The published foot and slope of the curve meet to 3e-8 only; the power law is the curve.
        if (exact > 0.0405) {
          EXPECT_NEAR(seen[c], exact, 1e-7 * (1 + exact));
        } else {
          // As the renderer shows it: what is below black is black.
          const double gain = std::pow(factor, 1.0 / 2.4);
          EXPECT_NEAR(std::max(seen[c], 0.0), exact, 0.055 * std::abs(gain - 1.0) + 1e-7);
        }
      }
    }
  }
}

TEST(ColourGrade, StraysFromTheLightOfDarkColoursByItsBound) {
  double worst = 0;
  for (double stops = -6; stops <= 6; stops += 0.25) {
    GradeSettings settings;
    settings.exposure = stops;
    const double gain = std::exp2(stops / 2.4);
    for (double value = 0; value <= 1.0; value += 1.0 / 512) {
      const Colour seen = graded(settings, ColourSpace::kDisplay, {value, value, value});
      const double exact = linearToSrgb(srgbToLinear(value) * std::exp2(stops));
      const double error = std::abs(std::max(seen[0], 0.0) - exact);
      EXPECT_LE(error, 0.055 * std::abs(gain - 1.0) + 1e-7) << stops << " " << value;
      if (stops < 0) worst = std::max(worst, error);
    }
  }
  EXPECT_LT(worst, 0.04);  // darkening: black takes back what goes below it
}

TEST(ColourGrade, MultipliesSceneLinearColoursExactly) {
  GradeSettings settings;
  settings.exposure = 1.5;
  settings.tint = {0.25, 1.0, 3.0};
  const Colour seen = graded(settings, ColourSpace::kLinear, {0.5, -0.125, 4.0});
  const double stop = std::exp2(1.5);
  EXPECT_DOUBLE_EQ(seen[0], 0.5 * stop * 0.25);
  EXPECT_DOUBLE_EQ(seen[1], -0.125 * stop);
  EXPECT_DOUBLE_EQ(seen[2], 4.0 * stop * 3.0);
}

TEST(ColourGrade, SaturatesAboutLuma) {
  const Colour colour = {0.9, 0.3, 0.1};
  const double luma = 0.2126 * 0.9 + 0.7152 * 0.3 + 0.0722 * 0.1;
  for (const double saturation : {0.0, 0.5, 1.0, 2.0}) {
    GradeSettings settings;
    settings.saturation = saturation;
    const Colour seen = graded(settings, ColourSpace::kDisplay, colour);
    for (size_t c = 0; c < 3; ++c) {
      EXPECT_NEAR(seen[c], luma + saturation * (colour[c] - luma), 1e-15);
    }
  }
}

TEST(ColourGrade, ClampsNothing) {
  GradeSettings settings;
  settings.saturation = 3;
  EXPECT_LT(graded(settings, ColourSpace::kDisplay, {1, 0, 0})[1], 0);
  settings.exposure = 4;
  EXPECT_GT(graded(settings, ColourSpace::kDisplay, {1, 0, 0})[0], 1);
}

TEST(ColourGrade, BakesIntoHarmonicsForEveryDirection) {
  GradeSettings settings;
  settings.exposure = 0.7;
  settings.tint = {1.0, 0.8, 0.6};
  settings.saturation = 1.4;
  settings.opacity = 0.5;
  const ColourGrade grade = gradeOf(settings, ColourSpace::kDisplay);
  SplatCloud cloud;
  cloud.sh_degree = 1;
  cloud.resize(2);
  cloud.opacities = {0.25f, 1.0f};
  for (size_t i = 0; i < cloud.sh.size(); ++i)
    cloud.sh[i] = 0.1f * static_cast<float>(i % 7) - 0.2f;
  SplatCloud baked = cloud;
  bakeGrade(baked, grade);
  EXPECT_EQ(baked.opacities, (std::vector<float>{0.125f, 0.5f}));
  const double bases[2][4] = {{0.28209479177387814, 0.1, -0.4, 0.2},
                              {0.28209479177387814, -0.3, 0.05, 0.35}};
  for (size_t i = 0; i < 2; ++i) {
    for (const auto& basis : bases) {
      Colour before = {0.5, 0.5, 0.5}, after = before;
      for (size_t k = 0; k < 4; ++k) {
        for (size_t c = 0; c < 3; ++c) {
          before[c] += basis[k] * static_cast<double>(cloud.sh[i * 12 + k * 3 + c]);
          after[c] += basis[k] * static_cast<double>(baked.sh[i * 12 + k * 3 + c]);
        }
      }
      applyGrade(grade, before.data());
      // Four coefficients of about 1, rounded to float32 each.
      for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(after[c], before[c], 4e-7);
    }
  }
}

TEST(ColourGrade, KeepsEveryBitWhereItIsNeutral) {
  SplatCloud cloud;
  cloud.resize(1);
  cloud.opacities = {0.3f};
  cloud.sh = {0.1f, -0.7f, 1e-30f};
  SplatCloud baked = cloud;
  bakeGrade(baked, {});
  EXPECT_EQ(baked.sh, cloud.sh);
  EXPECT_EQ(baked.opacities, cloud.opacities);
}

TEST(ColourGrade, RefusesSettingsOutsideTheirRange) {
  const auto refusal = [](auto change) {
    GradeSettings settings;
    change(settings);
    return refusalOf([&] { gradeOf(settings, ColourSpace::kDisplay); });
  };
  EXPECT_EQ(refusal([](GradeSettings& s) { s.exposure = 17; }),
            "exposure is 17; -16 to 16 is allowed");
  EXPECT_EQ(refusal([](GradeSettings& s) { s.tint[1] = -1; }), "tint is -1; 0 to 16 is allowed");
  EXPECT_EQ(refusal([](GradeSettings& s) { s.saturation = -0.5; }),
            "saturation is -0.5; 0 to 16 is allowed");
  EXPECT_EQ(refusal([](GradeSettings& s) { s.opacity = 1.5; }),
            "opacity is 1.5; 0 to 1 is allowed");
  EXPECT_THAT(refusal([](GradeSettings& s) { s.exposure = std::nan(""); }), HasSubstr("nan"));
  ColourGrade grade;
  grade.matrix[4] = std::numeric_limits<double>::infinity();
  EXPECT_THAT(refusalOf([&] { validate(grade, "instance 2"); }),
              HasSubstr("instance 2: an entry of the colour matrix is inf"));
}

TEST(ColourGrade, RefusesToBakeWhatLeavesFloat32) {
  SplatCloud cloud;
  cloud.resize(1);
  cloud.sh = {1e36f, 0, 0};
  ColourGrade grade;
  grade.matrix[0] = 1e6;
  EXPECT_THAT(refusalOf([&] { bakeGrade(cloud, grade); }), HasSubstr("3.4e38"));
}

}  // namespace
}  // namespace stipple
