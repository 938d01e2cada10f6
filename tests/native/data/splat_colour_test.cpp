#include "data/clouds/splat_colour.h"

#include <gtest/gtest.h>

#include <cmath>

#include "math/colour.h"

namespace stipple {
namespace {

TEST(SplatColour, ConvertsTheBaseExactlyAndHarmonicsBySlope) {
  for (const float base : {-0.2f, 0.001f, 0.02f, 0.3f, 1.5f}) {
    SplatCloud cloud;
    cloud.sh_degree = 1;
    cloud.resize(1);
    cloud.colour_space = ColourSpace::kLinear;
    for (float& value : cloud.sh) value = 0.1f;
    for (size_t c = 0; c < 3; ++c) cloud.sh[c] = (base - 0.5f) / kShC0;
    convertColours(cloud, ColourSpace::kDisplay);
    EXPECT_EQ(cloud.colour_space, ColourSpace::kDisplay);
    // Colours near 0 come from a difference with 0.5: 1e-7 of that, times the steepest slope 12.92.
    EXPECT_NEAR(double(kShC0 * cloud.sh[0]) + 0.5, linearToSrgb(double(base)), 2e-6);
    // Central difference; 1e-4 of the value for its own error.
    const double h = 1e-5;
    const double slope =
        (linearToSrgb(double(base) + h) - linearToSrgb(double(base) - h)) / (2 * h);
    EXPECT_NEAR(double(cloud.sh[5]), 0.1 * slope, 0.1 * slope * 1e-4);
    convertColours(cloud, ColourSpace::kLinear);
    EXPECT_NEAR(double(kShC0 * cloud.sh[0]) + 0.5, double(base), 2e-6);
    EXPECT_NEAR(double(cloud.sh[5]), 0.1, 1e-5);
  }
}

}  // namespace
}  // namespace stipple
