#include "train/optimiser/image_loss.h"

#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "train/allocation_count.h"
#include "train/loss_reference.h"
#include "train/optimiser/image_loss_kernel.h"

namespace stipple {
namespace {

using testing::centralDifference;
using testing::Pictures;
using testing::Planes;
using testing::randomPictures;
using testing::referenceLoss;
using testing::ssimErrorAt;
using testing::weightAt;
using testing::weightSum;

struct Evaluated {
  ImageLossValue value;
  std::vector<float> gradient;
};

/// Both pictures and the gradient planar.
Evaluated evaluate(ImageLoss& loss, const Planes& x, const Planes& y, double share = 0.2,
                   const std::vector<float>& weights = {}) {
  const std::vector<float> rendered = x.planar();
  const std::vector<float> target = y.planar();
  Evaluated result;
  result.gradient.assign(rendered.size(), std::numeric_limits<float>::quiet_NaN());
  result.value =
      loss.evaluate(static_cast<uint32_t>(x.width), static_cast<uint32_t>(x.height),
                    {rendered.data(), PixelLayout::kPlanar}, {target.data(), PixelLayout::kPlanar},
                    weights.empty() ? nullptr : weights.data(),
                    {result.gradient.data(), PixelLayout::kPlanar}, {share});
  return result;
}

Evaluated evaluate(const Planes& x, const Planes& y, double share = 0.2,
                   const std::vector<float>& weights = {}) {
  ImageLoss loss;
  return evaluate(loss, x, y, share, weights);
}

std::vector<float> someWeights(size_t count) {
  std::vector<float> weights(count);
  for (size_t i = 0; i < count; ++i) weights[i] = i % 3 == 0 ? 0.0f : 0.25f * float(i % 11);
  return weights;
}

/// The gradient's largest size, for tolerances relative to it.
double largest(const std::vector<float>& values) {
  float most = 0;
  for (const float v : values) most = std::max(most, std::abs(v));
  return static_cast<double>(most);
}

/// float32: V = G p^2/2 - (G p)^2/2 with p^2 up to 4 is off by about 5e-7, against
/// V + W + C2 >= 9e-4 + the pictures' variance (0.08 and, where they are smooth, 0.002): 2.5e-4 of
/// a derivative at worst, 1e-4 of the largest one seen in a picture.
constexpr double kGradientTolerance = 1e-4;

TEST(ImageLoss, GivesTheReferenceValue) {
  for (const double noise : {0.02, 0.6}) {
    for (const auto& [width, height] : {std::pair<size_t, size_t>{7, 5}, {37, 29}, {300, 101}}) {
      const Pictures p = randomPictures(width, height, noise, 3);
      for (const auto& weights : {std::vector<float>(), someWeights(width * height)}) {
        SCOPED_TRACE(::testing::Message()
                     << width << "x" << height << " noise " << noise << " " << weights.size());
        const auto expected = referenceLoss(p.rendered, p.target, 0.2, weights);
        const ImageLossValue seen = evaluate(p.rendered, p.target, 0.2, weights).value;
        // L1: differences rounded to float32. SSIM: the variance's 5e-7 against C2 at most, with
        // both signs, so far less in the mean.
        EXPECT_NEAR(seen.l1, expected.l1, 1e-7);
        EXPECT_NEAR(seen.ssim, expected.ssim, 2e-5);
        EXPECT_NEAR(seen.loss, expected.loss, 5e-6);
      }
    }
  }
}

TEST(ImageLoss, KeepsTheStructureErrorOfEachPixel) {
  constexpr size_t kWidth = 300, kHeight = 101;  // two tiles in each direction
  const Pictures p = randomPictures(kWidth, kHeight, 0.3, 4);
  const std::vector<float> x = p.rendered.planar(), y = p.target.planar();
  for (const auto& weights : {std::vector<float>(), someWeights(kWidth * kHeight)}) {
    ImageLoss loss;
    ImageLossOptions options;
    options.with_structure_errors = true;
    const ImageLossValue value = loss.evaluate(
        kWidth, kHeight, {x.data(), PixelLayout::kPlanar}, {y.data(), PixelLayout::kPlanar},
        weights.empty() ? nullptr : weights.data(), {}, options);
    const std::span<const float> errors = loss.structureErrors();
    ASSERT_EQ(errors.size(), kWidth * kHeight);
    double sum = 0;
    for (const float error : errors) sum += static_cast<double>(error);
    // Their weighted mean is that of the loss; both are sums of the same float32 numbers.
    EXPECT_NEAR(1 - sum / weightSum(p.rendered, weights), value.ssim, 1e-6);
    for (const size_t pixel :
         {size_t{0}, size_t{150}, 50 * kWidth + 149, 51 * kWidth + 150, kWidth * kHeight - 1}) {
      double expected = 0;
      for (size_t c = 0; c < 3; ++c) {
        expected += ssimErrorAt(p.rendered, p.target, c, pixel / kWidth, pixel % kWidth) / 3;
      }
      // The variance's 5e-7 against C2 at most, times two.
      EXPECT_NEAR(errors[pixel], expected * weightAt(weights, pixel), 1e-3);
    }
    loss.evaluate(kWidth, kHeight, {x.data(), PixelLayout::kPlanar},
                  {y.data(), PixelLayout::kPlanar}, nullptr, {});
    EXPECT_TRUE(loss.structureErrors().empty());
  }
}

TEST(ImageLoss, GradientIsThatOfTheDoubleReference) {
  for (const double share : {0.0, 0.2, 1.0}) {
    for (const double noise : {0.02, 0.6}) {
      const Pictures p = randomPictures(29, 23, noise, 5);
      for (const auto& weights : {std::vector<float>(), someWeights(29 * 23)}) {
        SCOPED_TRACE(::testing::Message()
                     << "share " << share << " noise " << noise << " " << weights.size());
        const Evaluated seen = evaluate(p.rendered, p.target, share, weights);
        const double tolerance = kGradientTolerance * largest(seen.gradient);
        for (size_t i = 0; i < seen.gradient.size(); ++i) {
          const double expected = centralDifference(p.rendered, p.target, share, i / (29 * 23),
                                                    i / 29 % 23, i % 29, weights);
          ASSERT_NEAR(seen.gradient[i], expected, tolerance) << "element " << i;
        }
      }
    }
  }
}

TEST(ImageLoss, GradientIsRightAtTheSeamsOfTiles) {
  // Tiles of at most 256 x 96: seams at column 150 and 300, at rows 50 and 67.
  const size_t width = 451, height = 199;
  const Pictures p = randomPictures(width, height, 0.3, 7);
  const Evaluated seen = evaluate(p.rendered, p.target);
  const double tolerance = kGradientTolerance * largest(seen.gradient);
  for (size_t c = 0; c < 3; ++c) {
    for (size_t row = 0; row < height; row += 3) {
      for (const size_t column : {0, 4, 9, 140, 145, 149, 150, 151, 155, 160, 220, 225, 226, 230,
                                  296, 301, 310, 445, 450}) {
        const double expected = centralDifference(p.rendered, p.target, 0.2, c, row, column);
        ASSERT_NEAR(seen.gradient[(c * height + row) * width + column], expected, tolerance)
            << "row " << row << " column " << column;
      }
    }
  }
}

TEST(ImageLoss, TinyPicturesHaveGradients) {
  for (const auto& [width, height] :
       {std::pair<size_t, size_t>{1, 1}, {2, 1}, {1, 9}, {5, 3}, {11, 11}, {16, 2}, {17, 1}}) {
    SCOPED_TRACE(::testing::Message() << width << "x" << height);
    const Pictures p = randomPictures(width, height, 0.5, 9);
    const Evaluated seen = evaluate(p.rendered, p.target);
    EXPECT_NEAR(seen.value.loss, referenceLoss(p.rendered, p.target, 0.2).loss, 5e-6);
    for (size_t i = 0; i < seen.gradient.size(); ++i) {
      EXPECT_NEAR(seen.gradient[i],
                  centralDifference(p.rendered, p.target, 0.2, i / (width * height),
                                    i / width % height, i % width),
                  kGradientTolerance * largest(seen.gradient));
    }
  }
}

TEST(ImageLoss, IdenticalPicturesHaveNoLossAndNoGradient) {
  const Pictures p = randomPictures(70, 31, 0.5, 11);
  for (const Planes& picture : {p.target, Planes(70, 31, 1.0), Planes(70, 31, 0.0)}) {
    const Evaluated seen = evaluate(picture, picture);
    EXPECT_EQ(seen.value.loss, 0.0);
    EXPECT_EQ(seen.value.ssim, 1.0);
    for (const float g : seen.gradient) ASSERT_EQ(g, 0.0f);
  }
}

TEST(ImageLoss, ConstantPicturesDifferInLevelOnly) {
  // Away from the borders the windows see constants: SSIM = (2 x y + C1)/(x^2 + y^2 + C1).
  const Planes x(41, 37, 0.75), y(41, 37, 0.25);
  const Evaluated seen = evaluate(x, y);
  EXPECT_NEAR(seen.value.l1, 0.5, 1e-12);
  EXPECT_NEAR(seen.value.ssim, referenceLoss(x, y, 0.2).ssim, 2e-5);
  const double expected = centralDifference(x, y, 0.2, 1, 18, 20);
  // White on grey: V and W are rounding (2e-7) where they should be 0, C2 carries the quotient.
  EXPECT_NEAR(seen.gradient[(37 + 18) * 41 + 20], expected, 1e-3 * std::abs(expected));
}

TEST(ImageLoss, LayoutsGiveTheSameBits) {
  const Pictures p = randomPictures(43, 19, 0.4, 13);
  const Evaluated planar = evaluate(p.rendered, p.target);
  const std::vector<float> rgb = p.target.interleaved(3);
  const std::vector<float> rgba = p.rendered.interleaved(4);
  ImageLoss loss;
  std::vector<float> gradient(43 * 19 * 4, 9.0f);
  const ImageLossValue value =
      loss.evaluate(43, 19, {rgba.data(), PixelLayout::kRgba}, {rgb.data(), PixelLayout::kRgb},
                    nullptr, {gradient.data(), PixelLayout::kRgba});
  EXPECT_EQ(value.loss, planar.value.loss);
  for (size_t i = 0; i < 43 * 19; ++i) {
    for (size_t c = 0; c < 3; ++c) {
      ASSERT_EQ(gradient[i * 4 + c], planar.gradient[c * 43 * 19 + i]);
    }
    ASSERT_EQ(gradient[i * 4 + 3], 0.0f);
  }
  std::vector<float> rgb_gradient(43 * 19 * 3 + 1, 9.0f);
  loss.evaluate(43, 19, {rgba.data(), PixelLayout::kRgba}, {rgb.data(), PixelLayout::kRgb}, nullptr,
                {rgb_gradient.data(), PixelLayout::kRgb});
  EXPECT_EQ(rgb_gradient[3], gradient[4]);
  EXPECT_EQ(rgb_gradient.back(), 9.0f);
}

TEST(ImageLoss, ValueAloneIsTheSameValue) {
  const Pictures p = randomPictures(280, 120, 0.4, 15);
  const std::vector<float> x = p.rendered.planar(), y = p.target.planar();
  ImageLoss loss;
  const ImageLossValue alone = loss.evaluate(280, 120, {x.data(), PixelLayout::kPlanar},
                                             {y.data(), PixelLayout::kPlanar}, nullptr, {});
  const Evaluated full = evaluate(p.rendered, p.target);
  EXPECT_EQ(alone.loss, full.value.loss);
  EXPECT_EQ(alone.ssim, full.value.ssim);
}

TEST(ImageLoss, SameBitsForAnyNumberOfThreadsAndAfterOtherSizes) {
  const Pictures p = randomPictures(530, 310, 0.4, 17);
  const Pictures other = randomPictures(91, 400, 0.9, 19);
  std::vector<Evaluated> results;
  for (const unsigned threads : {1u, 2u, 5u}) {
    withThreads(threads, [&] {
      ImageLoss loss;
      evaluate(loss, other.rendered, other.target);
      results.push_back(evaluate(loss, p.rendered, p.target));
    });
  }
  for (const Evaluated& result : results) {
    EXPECT_EQ(result.value.loss, results[0].value.loss);
    EXPECT_EQ(result.value.ssim, results[0].value.ssim);
    EXPECT_EQ(result.gradient, results[0].gradient);
  }
}

TEST(ImageLoss, AllocatesNothingAfterTheFirstCallOfASize) {
  const Pictures p = randomPictures(530, 310, 0.4, 21);
  const std::vector<float> x = p.rendered.planar(), y = p.target.planar();
  const std::vector<float> weights = someWeights(530 * 310);
  std::vector<float> gradient(x.size());
  withThreads(2, [&] {
    ImageLoss loss;
    const auto call = [&] {
      loss.evaluate(530, 310, {x.data(), PixelLayout::kPlanar}, {y.data(), PixelLayout::kPlanar},
                    weights.data(), {gradient.data(), PixelLayout::kPlanar});
    };
    const size_t none = testing::allocationCount();
    call();
    const size_t before = testing::allocationCount();
    EXPECT_GT(before, none);
    call();
    call();
    EXPECT_EQ(testing::allocationCount(), before);
    EXPECT_LT(loss.workspaceBytes(), 2 * 500000 + 2 * 3 * 310 * 8 + 310 * 8 + 1);
  });
}

TEST(ImageLoss, WeightsOfZeroEverywhereGiveNoLoss) {
  const Pictures p = randomPictures(20, 20, 0.4, 23);
  const Evaluated seen = evaluate(p.rendered, p.target, 0.2, std::vector<float>(400, 0.0f));
  EXPECT_EQ(seen.value.loss, 0.0);
  for (const float g : seen.gradient) ASSERT_EQ(g, 0.0f);
}

TEST(ImageLoss, AnEmptyPictureHasNoLoss) {
  ImageLoss loss;
  EXPECT_EQ(loss.evaluate(0, 7, {}, {}, nullptr, {}).loss, 0.0);
}

std::string messageOf(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    return error.what();
  }
  return "nothing thrown";
}

TEST(ImageLoss, RefusesBadInputByName) {
  using ::testing::Message;
  const Pictures good = randomPictures(300, 20, 0.4, 25);
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), -std::numeric_limits<double>::infinity(), 2e6}) {
    Pictures p = good;
    p.target.at(2, 13, 271) = bad;
    EXPECT_NE(messageOf([&] {
                evaluate(p.rendered, p.target);
              }).find("target image: channel 2 of the pixel in row 13, column 271 is "),
              std::string::npos);
    p.rendered.at(0, 3, 1) = bad;
    EXPECT_NE(messageOf([&] {
                evaluate(p.rendered, p.target);
              }).find("rendered image: channel 0 of the pixel in row 3, column 1 is "),
              std::string::npos);
  }
  std::vector<float> weights(300 * 20, 1.0f);
  weights[301] = -1;
  EXPECT_NE(messageOf([&] {
              evaluate(good.rendered, good.target, 0.2, weights);
            }).find("weight of the pixel in row 1, column 1 is -1"),
            std::string::npos);
  EXPECT_NE(messageOf([&] { evaluate(good.rendered, good.target, 1.5); }).find("ssim_share is 1.5"),
            std::string::npos);
  ImageLoss loss;
  EXPECT_NE(messageOf([&] { loss.evaluate(2, 2, {}, {}, nullptr, {}); }).find("must not be null"),
            std::string::npos);
  // It still works after refusing.
  EXPECT_EQ(evaluate(loss, good.target, good.target).value.loss, 0.0);
}

TEST(ImageLoss, EveryTargetIsTheScalarOne) {
  const std::vector<LossKernel> kernels = lossKernels();
  ASSERT_GE(kernels.size(), 2u);
  EXPECT_EQ(std::string(kernels.front().target), "scalar");
  for (const double noise : {0.02, 0.6}) {
    for (const auto& [width, height] :
         {std::pair<size_t, size_t>{1, 1}, {31, 33}, {33, 7}, {293, 110}}) {
      const Pictures p = randomPictures(width, height, noise, 27);
      const std::vector<float> weights = someWeights(width * height);
      ImageLoss scalar(kernels.front());
      for (const auto& used : {std::vector<float>(), weights}) {
        if (width == 1 && !used.empty()) continue;  // its only weight is 0
        const Evaluated expected = evaluate(scalar, p.rendered, p.target, 0.2, used);
        for (const LossKernel& kernel : kernels) {
          SCOPED_TRACE(::testing::Message() << kernel.target << " " << width << "x" << height);
          ImageLoss loss(kernel);
          const Evaluated seen = evaluate(loss, p.rendered, p.target, 0.2, used);
          // Fused products change the last bits; the variance passes them on as in
          // kGradientTolerance.
          EXPECT_NEAR(seen.value.loss, expected.value.loss, 5e-6);
          const double tolerance = kGradientTolerance * largest(expected.gradient);
          for (size_t i = 0; i < seen.gradient.size(); ++i) {
            ASSERT_NEAR(seen.gradient[i], expected.gradient[i], tolerance);
          }
        }
      }
    }
  }
}

TEST(ImageLoss, EveryTargetReadsAndWritesEveryLayoutUpToTheLastPixel) {
  for (const LossKernel& kernel : lossKernels()) {
    SCOPED_TRACE(kernel.target);
    for (size_t width = 1; width <= 40; ++width) {
      const Pictures p = randomPictures(width, 2, 0.5, 29);
      ImageLoss loss(kernel);
      const Evaluated planar = evaluate(loss, p.rendered, p.target);
      for (const PixelLayout layout : {PixelLayout::kRgb, PixelLayout::kRgba}) {
        const size_t channels = layout == PixelLayout::kRgb ? 3 : 4;
        // NaN in alpha and behind the picture must neither be read nor be overwritten.
        const float nan = std::numeric_limits<float>::quiet_NaN();
        const std::vector<float> x = p.rendered.interleaved(channels, nan);
        const std::vector<float> y = p.target.interleaved(channels, nan);
        std::vector<float> gradient(x.size() + 1, 9.0f);
        loss.evaluate(static_cast<uint32_t>(width), 2, {x.data(), layout}, {y.data(), layout},
                      nullptr, {gradient.data(), layout});
        for (size_t i = 0; i < width * 2; ++i) {
          for (size_t c = 0; c < 3; ++c) {
            ASSERT_EQ(gradient[i * channels + c], planar.gradient[c * width * 2 + i]);
          }
        }
        EXPECT_EQ(gradient.back(), 9.0f);
      }
    }
  }
}

}  // namespace
}  // namespace stipple
