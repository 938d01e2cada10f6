#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "train/loss_reference.h"
#include "train/optimiser/adam.h"
#include "train/optimiser/adam_kernel.h"
#include "train/optimiser/image_loss.h"
#include "train/optimiser/image_loss_kernel.h"

// Hard pictures and gradients with floating-point traps on, for every kernel, judged in double.

namespace stipple {
namespace {

using testing::centralDifference;
using testing::Pictures;
using testing::Planes;
using testing::randomPictures;
using testing::referenceLoss;

struct Seen {
  ImageLossValue value;
  std::vector<float> gradient;
};

Seen evaluate(const LossKernel& kernel, const Planes& x, const Planes& y) {
  const std::vector<float> rendered = x.planar(), target = y.planar();
  Seen seen;
  seen.gradient.assign(rendered.size(), 0.0f);
  ImageLoss loss(kernel);
  seen.value =
      loss.evaluate(static_cast<uint32_t>(x.width), static_cast<uint32_t>(x.height),
                    {rendered.data(), PixelLayout::kPlanar}, {target.data(), PixelLayout::kPlanar},
                    nullptr, {seen.gradient.data(), PixelLayout::kPlanar});
  return seen;
}

/// In: relative: of the largest gradient.
void expectSound(const Planes& x, const Planes& y, double value_tolerance, double relative) {
  const double expected = referenceLoss(x, y, 0.2).loss;
  for (const LossKernel& kernel : lossKernels()) {
    SCOPED_TRACE(kernel.target);
    const Seen seen = evaluate(kernel, x, y);
    EXPECT_NEAR(seen.value.loss, expected, value_tolerance);
    EXPECT_LE(std::abs(seen.value.ssim), 1.0 + 1e-6);
    double largest = 0;
    for (const float g : seen.gradient) {
      ASSERT_TRUE(std::isfinite(g));
      largest = std::max(largest, std::abs(static_cast<double>(g)));
    }
    const size_t plane = x.width * x.height;
    for (size_t i = 0; i < 3 * plane; i += 7) {
      // The kink of L1 has no central difference.
      if (std::abs(x.values[i] - y.values[i]) < 1e-4) continue;
      EXPECT_NEAR(seen.gradient[i],
                  centralDifference(x, y, 0.2, i / plane, i % plane / x.width, i % x.width),
                  relative * largest);
    }
  }
}

TEST(LossStability, NothingWasRendered) {
  // Transmittance 1 everywhere leaves black; the target is a photograph, or black or white.
  const Pictures p = randomPictures(37, 21, 0.5, 1);
  for (const Planes& target : {p.target, Planes(37, 21, 1.0)}) {
    expectSound(Planes(37, 21), target, 1e-5, 1e-4);
  }
  expectSound(Planes(37, 21), Planes(37, 21), 0, 0);
}

TEST(LossStability, EverythingIsOpaqueWhiteOnAWhiteTargetButOnePixel) {
  // Variances are 0 away from one pixel: float32 leaves up to 5e-7 where C2 is 9e-4.
  Planes x(31, 25, 1.0);
  const Planes y(31, 25, 1.0);
  x.at(1, 12, 14) = 0.875;
  expectSound(x, y, 1e-5, 1e-3);
}

TEST(LossStability, OneTimesOnePixel) {
  for (const double x : {0.0, 1.0, 0.5})
    expectSound(Planes(1, 1, x), Planes(1, 1, 0.25), 1e-6, 1e-4);
}

TEST(LossStability, TheLargestColoursStayFinite) {
  // No digits are left for variances of flat parts here; L1 is 2e6 and SSIM within -1..1.
  Planes x(40, 30, 1e6), y(40, 30, -1e6);
  for (size_t i = 0; i < x.values.size(); i += 3) x.values[i] = -1e6;
  for (const LossKernel& kernel : lossKernels()) {
    SCOPED_TRACE(kernel.target);
    const Seen seen = evaluate(kernel, x, y);
    EXPECT_NEAR(seen.value.l1, 2e6 * 2 / 3, 1);
    EXPECT_LE(std::abs(seen.value.ssim), 1.0 + 1e-6);
    for (const float g : seen.gradient) ASSERT_TRUE(std::isfinite(g));
  }
}

TEST(LossStability, DenormalColours) {
  expectSound(Planes(20, 20, 1e-40), Planes(20, 20, 0.0), 1e-9, 0);
}

TEST(LossStability, NanAndInfinityAreRefusedWithoutATrap) {
  const Pictures p = randomPictures(70, 9, 0.5, 3);
  for (const LossKernel& kernel : lossKernels()) {
    for (const double bad :
         {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
          -std::numeric_limits<double>::infinity(), -3e38}) {
      for (const size_t element : {0u, 33u, 69u, 70u * 9u - 1u}) {
        Pictures broken = p;
        broken.rendered.values[element] = bad;
        EXPECT_THROW(evaluate(kernel, broken.rendered, p.target), Error) << kernel.target;
        EXPECT_THROW(evaluate(kernel, p.target, broken.rendered), Error) << kernel.target;
      }
    }
  }
}

TEST(AdamStability, ExtremeGradientsKeepEverythingFinite) {
  const float sizes[] = {0.0f, 1e-45f, 1e-38f, 1e-20f, 1e-15f, 1.0f, 1e10f, 1e18f, -1e18f, -1e-45f};
  for (const AdamKernel& kernel : adamKernels()) {
    SCOPED_TRACE(kernel.target);
    std::vector<float> p(370, 1.0f), g(370), m(370), v(370);
    const AdamGroup groups[] = {{p.data(), g.data(), m.data(), v.data(), 37, 10, 1e-2}};
    for (uint64_t t = 1; t <= 300; ++t) {
      for (size_t i = 0; i < g.size(); ++i) g[i] = sizes[(i + t * (i % 5)) % 10];
      adamStepWith(kernel, groups, t);
    }
    for (size_t i = 0; i < p.size(); ++i) {
      ASSERT_TRUE(std::isfinite(p[i]) && std::isfinite(m[i]) && v[i] >= 0 && std::isfinite(v[i]));
      // |m'| / sqrt(v') is at most (1 - b1)/sqrt(1 - b2) = 3.2 where gradients come and go.
      EXPECT_LE(std::abs(p[i] - 1.0f), 300 * 1e-2f * 3.2f);
    }
  }
}

TEST(AdamStability, NanAndInfinityAreRefusedWithoutATrap) {
  for (const AdamKernel& kernel : adamKernels()) {
    for (const float bad :
         {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), 3e38f}) {
      std::vector<float> p(40, 1.0f), g(40, bad), m(40), v(40);
      const AdamGroup groups[] = {{p.data(), g.data(), m.data(), v.data(), 40, 1, 1e-2}};
      EXPECT_THROW(adamStepWith(kernel, groups, 1), Error) << kernel.target;
      for (const float value : p) EXPECT_EQ(value, 1.0f);
    }
  }
}

TEST(AdamStability, ManyStepsKeepTheBiasCorrectionFinite) {
  std::vector<float> p(1, 0.0f), g(1, 1.0f), m(1), v(1);
  const AdamGroup groups[] = {{p.data(), g.data(), m.data(), v.data(), 1, 1, 1e-2}};
  for (const uint64_t t : {uint64_t{1}, uint64_t{30000}, uint64_t{1} << 40, ~uint64_t{0}}) {
    adamStep(groups, t);
    ASSERT_TRUE(std::isfinite(p[0]));
  }
}

}  // namespace
}  // namespace stipple
