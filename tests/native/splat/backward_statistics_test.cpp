#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "base/error.h"
#include "splat/backward_cases.h"
#include "splat/cpu/tiles/tile_kernel_backward.h"
#include "splat/cpu/tiles/tiled_backward.h"
#include "splat/reference_backward.h"

// Contributions are judged by rendering the double reference again without the splat, statistics by
// differences of it.

namespace stipple {
namespace {

using testing::frontCamera;
using testing::linearLoss;
using testing::pixelCount;
using testing::randomWeights;
using testing::smallCamera;
using testing::smallCloud;

ReferenceResult reference(const SplatCloud& cloud, const Camera& camera,
                          const RenderOptions& options) {
  const SplatInstance instance{&cloud};
  return renderReference({&instance, 1}, camera, options);
}

/// The cloud with some splats made transparent, which then never show.
SplatCloud without(SplatCloud cloud, const std::set<size_t>& left_out) {
  for (const size_t i : left_out) cloud.opacities[i] = 0;
  return cloud;
}

/// Sum of w (|R| - |R'|) over pixels and channels, R' the residual of another picture.
double errorChange(const ReferenceResult& picture, const ReferenceResult& other,
                   const std::vector<float>& residual, const std::vector<float>& weights) {
  double sum = 0;
  for (size_t pixel = 0; pixel < picture.colour.size() / 4; ++pixel) {
    const double weight = weights.empty() ? 1.0 : static_cast<double>(weights[pixel]);
    for (size_t c = 0; c < 3; ++c) {
      const double r = static_cast<double>(residual[pixel * 3 + c]);
      const double change = picture.colour[pixel * 4 + c] - other.colour[pixel * 4 + c];
      sum += weight * (std::abs(r) - std::abs(r - change));
    }
  }
  return sum;
}

struct Case {
  const char* name;
  bool with_background;
  double background;
  float opacity;  ///< 0: as they come
  bool weighted;
};

constexpr Case kCases[] = {{"nothing behind", false, 0, 0, false},
                           {"black", true, 0, 0, false},
                           {"white", true, 1, 0, true},
                           {"white and opaque", true, 1, 1, false}};

/// Pixels do not end early here, so taking a splat away changes nothing but its own share.
SplatCloud stack(const Case& c, size_t count, uint32_t seed) {
  SplatCloud cloud = smallCloud(count, 0, seed);
  if (c.opacity > 0) std::fill(cloud.opacities.begin(), cloud.opacities.end(), c.opacity);
  return cloud;
}

BackwardResult contributions(const SplatCloud& cloud, const Camera& camera,
                             const RenderOptions& options, const std::vector<float>& residual,
                             const std::vector<float>& weights) {
  const std::vector<float> gradient(pixelCount(camera) * 4, 0.25f);
  const SplatInstance instance{&cloud};
  BackwardInput input;
  input.colour_gradient = gradient;
  input.residual = residual;
  input.residual_weights = weights;
  return renderBackward({&instance, 1}, camera, options, input);
}

TEST(Contribution, IsTheErrorWithMinusTheErrorWithout) {
  const Camera camera = smallCamera();
  for (const Case& c : kCases) {
    SCOPED_TRACE(c.name);
    // Three opaque splats bring T to 1e-6 and would end the pixel: two leave it at 1e-4.
    const SplatCloud cloud = stack(c, c.opacity > 0 ? 2 : 25, 200);
    RenderOptions options;
    options.with_background = c.with_background;
    std::fill(options.background, options.background + 3, c.background);
    const ReferenceResult picture = reference(cloud, camera, options);
    // Residuals about as large as the changes: both branches of the minimum are met.
    const std::vector<float> residual = randomWeights(pixelCount(camera) * 3, 13, -0.1f, 0.1f);
    std::vector<float> weights;
    if (c.weighted) weights = randomWeights(pixelCount(camera), 14, 0, 2);
    const BackwardResult result = contributions(cloud, camera, options, residual, weights);
    double largest = 0;
    for (size_t i = 0; i < cloud.size(); ++i) {
      const double expected =
          errorChange(picture, reference(without(cloud, {i}), camera, options), residual, weights);
      // About 500 pixels of three channels, each off by float32's rounding (6e-8) of a change below
      // 0.1, and their float32 sum, which scalar kernels add pixel by pixel: 1e-5 and a millionth
      // of the sum. 1.5e-5 is seen of 20. Where alpha is 0.99 the transmittance is found by a
      // division that magnifies rounding a hundredfold; 7e-6 is seen.
      EXPECT_NEAR(static_cast<double>(result.instances[0].contributions[i]), expected,
                  (c.opacity > 0 ? 5e-5 : 1e-5) + 1e-6 * std::abs(expected))
          << i;
      largest = std::max(largest, std::abs(expected));
    }
    EXPECT_GT(largest, 1);
  }
}

TEST(Contribution, AddsUpToThatOfAnAnchorWhereItsSplatsDoNotOverlap) {
  // Joint removal of S, front to back, is sum of dC_m / prod (1 - alpha) over the members before m;
  // members that never meet in a pixel make every product 1.
  SplatCloud cloud = smallCloud(12, 0, 210);
  for (float& scale : cloud.scales) scale = 0.04f;
  const std::set<size_t> anchor = {0, 1, 2, 3};
  for (const size_t i : anchor) {
    cloud.positions[i * 3] = -0.9f + 0.6f * static_cast<float>(i);
    cloud.positions[i * 3 + 2] = 0.1f;
  }
  const Camera camera = frontCamera(64, 48, 50, 3);
  const ReferenceResult picture = reference(cloud, camera, {});
  const std::vector<float> residual = randomWeights(pixelCount(camera) * 3, 15, -0.1f, 0.1f);
  const BackwardResult result = contributions(cloud, camera, {}, residual, {});
  double sum = 0;
  for (const size_t i : anchor) {
    sum += static_cast<double>(result.instances[0].contributions[i]);
  }
  const double expected =
      errorChange(picture, reference(without(cloud, anchor), camera, {}), residual, {});
  EXPECT_GT(std::abs(expected), 0.1);
  EXPECT_NEAR(sum, expected, 1e-5);  // rounding as above
}

TEST(Contribution, OfOverlappingSplatsIsTheJointRemovalLessTheHiddenPart) {
  // Three splats over each other at one pixel: the colour change of removing all of them is
  // sum of dC_m / prod (1 - alpha) over the members before m, dC_m the single changes.
  SplatCloud cloud = smallCloud(5, 0, 220);
  for (float& scale : cloud.scales) scale = 3.0f;
  for (size_t i = 0; i < cloud.size(); ++i) {
    cloud.positions[i * 3] = cloud.positions[i * 3 + 2] = 0;
    cloud.positions[i * 3 + 1] = 0.2f * static_cast<float>(i);
    cloud.opacities[i] = 0.3f + 0.1f * static_cast<float>(i);
    for (size_t c = 0; c < 3; ++c) {
      cloud.sh[i * 3 + c] = std::abs(cloud.sh[i * 3 + c]) + 0.1f;
    }
  }
  const Camera camera = frontCamera(1, 1, 1, 3);
  const std::set<size_t> anchor = {1, 2, 4};
  const ReferenceResult picture = reference(cloud, camera, {});
  const ReferenceResult joint = reference(without(cloud, anchor), camera, {});
  // A residual of 10 keeps every |R - dC| on one side: contributions are then dC itself.
  const std::vector<float> residual(3, 10.0f);
  const BackwardResult result = contributions(cloud, camera, {}, residual, {});
  double sum = 0;
  double passed = 1;
  for (const size_t m : anchor) {
    sum += static_cast<double>(result.instances[0].contributions[m]) / passed;
    SplatCloud alone = without(cloud, {0, 1, 2, 3, 4});
    alone.opacities[m] = cloud.opacities[m];
    passed *= 1.0 - reference(alone, camera, {}).colour[3];
  }
  EXPECT_NEAR(sum, errorChange(picture, joint, residual, {}), 2e-6);
}

TEST(BlendingWeights, AddUpToTheCoverageOfTheReference) {
  SplatCloud cloud = smallCloud(60, 0, 230);
  const Camera camera = smallCamera();
  const std::vector<float> gradient(pixelCount(camera) * 4, 1.0f);
  const ReferenceResult picture = reference(cloud, camera, {});
  const SplatInstance instance{&cloud};
  // An edge weight that picks out one pixel gives the weights at that pixel.
  for (const size_t pixel : {size_t{0}, size_t{200}, size_t{283}, pixelCount(camera) - 1}) {
    std::vector<float> edges(pixelCount(camera), 0.0f);
    edges[pixel] = 1.0f;
    BackwardInput input;
    input.colour_gradient = gradient;
    input.edge_weights = edges;
    input.with_blending_weights = true;
    const BackwardResult result = renderBackward({&instance, 1}, camera, {}, input);
    double here = 0;
    double everywhere = 0;
    for (size_t i = 0; i < cloud.size(); ++i) {
      here += static_cast<double>(result.instances[0].edge_weights[i]);
      everywhere += static_cast<double>(result.instances[0].blending_weights[i]);
    }
    double coverage = 0;
    for (size_t i = 3; i < picture.colour.size(); i += 4) coverage += picture.colour[i];
    // 60 float32 terms of at most 1, alpha off by 3e-7.
    EXPECT_NEAR(here, picture.colour[pixel * 4 + 3], 5e-6);
    EXPECT_NEAR(everywhere, coverage, 1e-6 * static_cast<double>(pixelCount(camera)));
  }
}

TEST(EdgeWeights, ThoseOfAllSplatsAndOfWhatPassesThemAreThoseOfThePicture) {
  const SplatCloud cloud = smallCloud(60, 0, 232);
  const Camera camera = smallCamera();
  const std::vector<float> gradient(pixelCount(camera) * 4, 1.0f);
  const std::vector<float> edges = randomWeights(pixelCount(camera), 17, 0, 1);
  const ReferenceResult picture = reference(cloud, camera, {});
  const SplatInstance instance{&cloud};
  BackwardInput input;
  input.colour_gradient = gradient;
  input.edge_weights = edges;
  const BackwardResult result = renderBackward({&instance, 1}, camera, {}, input);
  double sum = 0, whole = 0;
  for (const float score : result.instances[0].edge_weights) sum += static_cast<double>(score);
  for (size_t p = 0; p < edges.size(); ++p) {
    const double transmittance = 1 - picture.colour[p * 4 + 3];
    sum += static_cast<double>(edges[p]) * transmittance;
    whole += static_cast<double>(edges[p]);
  }
  // Every pixel's weight is shared between the splats and what is behind them; alpha is off by 3e-7
  // in each, and sums of single precision by as much.
  EXPECT_NEAR(sum, whole, 1e-6 * static_cast<double>(pixelCount(camera)));
}

TEST(EdgeWeights, AreTheSameAloneAndBesideOthers) {
  // Faint splats and opaque ones, so that some pixels are in doubt and are judged in double.
  SplatCloud cloud = smallCloud(400, 1, 233);
  for (size_t i = 0; i < cloud.size(); i += 3) cloud.opacities[i] = 1;
  const Camera camera = frontCamera(83, 61, 60, 3);
  const std::vector<float> gradient = randomWeights(pixelCount(camera) * 4, 18, -1, 1);
  const std::vector<float> edges = randomWeights(pixelCount(camera), 19, 0, 1);
  const SplatInstance instance{&cloud};
  BackwardInput input;
  input.colour_gradient = gradient;
  input.edge_weights = edges;
  const SplatGradients alone = renderBackward({&instance, 1}, camera, {}, input).instances[0];
  input.with_blending_weights = true;
  const SplatGradients beside = renderBackward({&instance, 1}, camera, {}, input).instances[0];
  double most = 0;
  for (size_t i = 0; i < cloud.size(); ++i) {
    // Sums of the same terms in float32, of up to the pixels of a tile, in another order.
    EXPECT_NEAR(alone.edge_weights[i], beside.edge_weights[i],
                1e-5 * static_cast<double>(beside.edge_weights[i]) + 1e-7);
    most = std::max(most, static_cast<double>(beside.edge_weights[i]));
    EXPECT_NEAR(alone.opacities[i], beside.opacities[i],
                1e-5 * std::abs(static_cast<double>(beside.opacities[i])) + 1e-5);
  }
  EXPECT_GT(most, 1);
}

TEST(BlendingWeights, AreTheSameAloneAndBesideDerivatives) {
  // Opaque splats too, so that some pixels are in doubt and are judged in double.
  SplatCloud cloud = smallCloud(400, 1, 234);
  for (size_t i = 0; i < cloud.size(); i += 3) cloud.opacities[i] = 1;
  const Camera camera = frontCamera(83, 61, 60, 3);
  const std::vector<float> gradient = randomWeights(pixelCount(camera) * 4, 18, -1, 1);
  const SplatInstance instance{&cloud};
  RenderOptions options;
  options.with_background = true;
  BackwardInput input;
  input.with_blending_weights = true;
  const SplatGradients alone = renderBackward({&instance, 1}, camera, options, input).instances[0];
  EXPECT_TRUE(alone.positions.empty());
  EXPECT_TRUE(alone.sh.empty());
  input.colour_gradient = gradient;
  const SplatGradients beside = renderBackward({&instance, 1}, camera, options, input).instances[0];
  ASSERT_EQ(alone.blending_weights.size(), cloud.size());
  double most = 0;
  for (size_t i = 0; i < cloud.size(); ++i) {
    // Sums of the same terms in float32, of up to the pixels of a tile, in another order.
    EXPECT_NEAR(alone.blending_weights[i], beside.blending_weights[i],
                1e-5 * static_cast<double>(beside.blending_weights[i]) + 1e-7);
    most = std::max(most, static_cast<double>(beside.blending_weights[i]));
  }
  EXPECT_GT(most, 1);
}

TEST(UnhiddenWeights, AreTheSumOfAlphaOfASplatThatStandsAlone) {
  SplatCloud cloud = smallCloud(3, 0, 235);
  // One in the middle of the image, one beyond its border, one behind the camera.
  const float places[9] = {0, 0, 0, 50, 0, 0, 0, 0, -10};
  std::copy(places, places + 9, cloud.positions.begin());
  for (float& scale : cloud.scales) scale = 0.1f;
  cloud.opacities.assign(3, 0.8f);
  const Camera camera = frontCamera(83, 61, 60, 3);
  const SplatInstance instance{&cloud};
  RenderWorkspace workspace;
  workspace.keepForBackward(true);
  RenderResult picture;
  renderTiled({&instance, 1}, camera, {}, workspace, picture);
  std::vector<float> unhidden;
  unhiddenWeights(workspace, unhidden);
  BackwardInput input;
  input.with_blending_weights = true;
  BackwardWorkspace memory;
  BackwardResult result;
  renderBackward(workspace, picture, input, memory, result);
  ASSERT_EQ(unhidden.size(), 3u);
  const double seen = static_cast<double>(result.instances[0].blending_weights[0]);
  EXPECT_GT(seen, 5);
  // The integral of the Gaussian instead of a sum that ends at alpha = 1/255 of 0.8: 1/200 of it.
  EXPECT_NEAR(static_cast<double>(unhidden[0]) / seen, 1.0 + 1.0 / 200, 2e-3);
  EXPECT_EQ(unhidden[1], 0.0f);
  EXPECT_EQ(unhidden[2], 0.0f);
}

TEST(ErrorContributions, SumAndLargestAgreeWithThePixelsOneByOne) {
  const SplatCloud cloud = smallCloud(15, 0, 240);
  const Camera camera = frontCamera(11, 9, 8, 3);
  const std::vector<float> gradient(pixelCount(camera) * 4, 1.0f);
  const std::vector<float> errors = randomWeights(pixelCount(camera), 16, 0, 1);
  const SplatInstance instance{&cloud};
  BackwardInput input;
  input.colour_gradient = gradient;
  input.errors = errors;
  const SplatGradients all = renderBackward({&instance, 1}, camera, {}, input).instances[0];
  std::vector<double> sums(cloud.size(), 0.0);
  std::vector<float> largest(cloud.size(), 0.0f);
  for (size_t pixel = 0; pixel < errors.size(); ++pixel) {
    std::vector<float> single(errors.size(), 0.0f);
    single[pixel] = errors[pixel];
    input.errors = single;
    const SplatGradients one = renderBackward({&instance, 1}, camera, {}, input).instances[0];
    for (size_t i = 0; i < cloud.size(); ++i) {
      sums[i] += static_cast<double>(one.errors[i]);
      largest[i] = std::max(largest[i], one.errors[i]);
    }
  }
  for (size_t i = 0; i < cloud.size(); ++i) {
    // The same products in another order of addition.
    EXPECT_NEAR(static_cast<double>(all.errors[i]), sums[i], 1e-5);
    EXPECT_EQ(all.largest_errors[i], largest[i]);
  }
  EXPECT_GT(*std::max_element(largest.begin(), largest.end()), 0.1f);
}

TEST(CoveredPixels, AreThoseThatShowTheSplatHoweverLittleOfIt) {
  const SplatCloud cloud = smallCloud(15, 0, 245);
  const Camera camera = frontCamera(21, 19, 16, 3);
  const std::vector<float> gradient(pixelCount(camera) * 4, 1.0f);
  const std::vector<float> errors = randomWeights(pixelCount(camera), 21, 0, 1);
  const SplatInstance instance{&cloud};
  BackwardInput input;
  input.colour_gradient = gradient;
  input.with_covered = true;
  const SplatGradients bare = renderBackward({&instance, 1}, camera, {}, input).instances[0];
  EXPECT_TRUE(bare.covered_errors.empty());
  EXPECT_TRUE(bare.blending_weights.empty());
  input.errors = errors;
  const SplatGradients all = renderBackward({&instance, 1}, camera, {}, input).instances[0];
  EXPECT_EQ(all.covered_pixels, bare.covered_pixels);

  // Where a pixel shows a splat, an error of that pixel alone is one of the splat.
  const PlacedScene scene = placeScene({&instance, 1}, camera, {});
  const std::vector<testing::ReferenceSplat> splats = testing::visibleInOrder(scene);
  std::vector<double> counts(cloud.size()), sums(cloud.size()), distances(cloud.size());
  for (size_t pixel = 0; pixel < errors.size(); ++pixel) {
    std::vector<float> single(errors.size(), 0.0f);
    single[pixel] = 1.0f;
    input.errors = single;
    const SplatGradients one = renderBackward({&instance, 1}, camera, {}, input).instances[0];
    for (const testing::ReferenceSplat& splat : splats) {
      if (!(one.errors[splat.index] > 0)) continue;
      const Footprint<double>& f = splat.projected.footprint;
      EXPECT_EQ(one.covered_errors[splat.index], 1.0f);
      ++counts[splat.index];
      sums[splat.index] += static_cast<double>(errors[pixel]);
      distances[splat.index] +=
          std::hypot(static_cast<double>(pixel % camera.width) + 0.5 - f.mean_x,
                     static_cast<double>(pixel / camera.width) + 0.5 - f.mean_y);
    }
  }
  for (size_t i = 0; i < cloud.size(); ++i) {
    EXPECT_EQ(all.covered_pixels[i], counts[i]);
    // Sums of float32 in another order; distances through the inverse of their metric.
    EXPECT_NEAR(all.covered_errors[i], sums[i], 1e-6 * (1 + sums[i]));
    EXPECT_NEAR(all.covered_distances[i], distances[i], 1e-5 * (1 + distances[i]));
  }
  EXPECT_GT(*std::max_element(counts.begin(), counts.end()), 20);
}

TEST(ScreenGradients, AgreeWithThePixelsOneByOne) {
  const SplatCloud cloud = smallCloud(12, 0, 250);
  const Camera camera = frontCamera(10, 9, 8, 3);
  const std::vector<float> gradient = randomWeights(pixelCount(camera) * 4, 17);
  const SplatInstance instance{&cloud};
  BackwardInput input;
  input.colour_gradient = gradient;
  input.with_screen_gradients = input.with_absolute_screen_gradients = true;
  const SplatGradients all = renderBackward({&instance, 1}, camera, {}, input).instances[0];
  std::vector<double> sum(cloud.size() * 2), absolute(cloud.size() * 2), norm(cloud.size());
  for (size_t pixel = 0; pixel < pixelCount(camera); ++pixel) {
    std::vector<float> single(gradient.size(), 0.0f);
    std::copy_n(&gradient[pixel * 4], 4, &single[pixel * 4]);
    input.colour_gradient = single;
    const SplatGradients one = renderBackward({&instance, 1}, camera, {}, input).instances[0];
    for (size_t i = 0; i < cloud.size(); ++i) {
      const double x = static_cast<double>(one.screen_gradients[i * 2]);
      const double y = static_cast<double>(one.screen_gradients[i * 2 + 1]);
      sum[i * 2] += x;
      sum[i * 2 + 1] += y;
      absolute[i * 2] += std::abs(x);
      absolute[i * 2 + 1] += std::abs(y);
      norm[i] += std::hypot(x, y);
    }
  }
  double cancelled = 0;
  for (size_t i = 0; i < cloud.size(); ++i) {
    for (size_t k = i * 2; k < i * 2 + 2; ++k) {
      // 90 float32 terms, each off by 1e-6 of its size.
      EXPECT_NEAR(static_cast<double>(all.screen_gradients[k]), sum[k], 2e-6 * absolute[k] + 1e-9);
      EXPECT_NEAR(static_cast<double>(all.absolute_screen_gradients[k]), absolute[k],
                  4e-6 * absolute[k] + 1e-9);
      cancelled += absolute[k] - std::abs(sum[k]);
    }
    EXPECT_NEAR(static_cast<double>(all.screen_gradient_norms[i]), norm[i], 4e-6 * norm[i] + 1e-9);
  }
  EXPECT_GT(cancelled, 0.1);
}

TEST(ScreenGradients, AreTheDerivativeByTheProjectedCentre) {
  // With an orthographic camera of 1 pixel per metre the projected centre moves as x does.
  const SplatCloud cloud = smallCloud(12, 0, 260);
  Camera camera = frontCamera(12, 10, 8, 3);
  camera.model = CameraModel::kOrthographic;
  const std::vector<float> gradient = randomWeights(pixelCount(camera) * 4, 18);
  const SplatInstance instance{&cloud};
  BackwardInput input;
  input.colour_gradient = gradient;
  input.with_screen_gradients = true;
  const SplatGradients seen = renderBackward({&instance, 1}, camera, {}, input).instances[0];
  for (size_t i = 0; i < cloud.size(); ++i) {
    EXPECT_NEAR(8 * seen.screen_gradients[i * 2], seen.positions[i * 3], 1e-5);
    EXPECT_NEAR(-8 * seen.screen_gradients[i * 2 + 1], seen.positions[i * 3 + 2], 1e-5);
  }
}

TEST(Backward, ChangesNoGradientWhenStatisticsAreAskedFor) {
  const SplatCloud cloud = smallCloud(200, 1, 270);
  const Camera camera = frontCamera(50, 40, 40, 3);
  const std::vector<float> gradient = randomWeights(pixelCount(camera) * 4, 19);
  const std::vector<float> residual = randomWeights(pixelCount(camera) * 3, 20);
  const SplatInstance instance{&cloud};
  BackwardInput input;
  input.colour_gradient = gradient;
  const SplatGradients plain = renderBackward({&instance, 1}, camera, {}, input).instances[0];
  EXPECT_TRUE(plain.contributions.empty());
  EXPECT_TRUE(plain.screen_gradients.empty());
  input.residual = residual;
  const SplatGradients judged = renderBackward({&instance, 1}, camera, {}, input).instances[0];
  input.with_screen_gradients = true;
  const SplatGradients signed_only = renderBackward({&instance, 1}, camera, {}, input).instances[0];
  EXPECT_TRUE(signed_only.screen_gradient_norms.empty());
  input.with_absolute_screen_gradients = input.with_blending_weights = true;
  const SplatGradients full = renderBackward({&instance, 1}, camera, {}, input).instances[0];
  for (const SplatGradients* other : {&judged, &full}) {
    EXPECT_EQ(plain.positions, other->positions);
    EXPECT_EQ(plain.rotations, other->rotations);
    EXPECT_EQ(plain.scales, other->scales);
    EXPECT_EQ(plain.opacities, other->opacities);
    EXPECT_EQ(plain.sh, other->sh);
  }
  EXPECT_EQ(judged.contributions, full.contributions);
}

TEST(Backward, EveryTargetAgreesWithTheScalarOne) {
  // Long lists of many batches; faint, so that pixels do not end before.
  SplatCloud cloud = smallCloud(9000, 0, 280);
  for (float& opacity : cloud.opacities) opacity = 0.008f;
  const Camera camera = frontCamera(40, 33, 30, 3);
  const std::vector<float> gradient = randomWeights(pixelCount(camera) * 4, 21);
  const std::vector<float> residual = randomWeights(pixelCount(camera) * 3, 22);
  const SplatInstance instance{&cloud};
  BackwardInput input;
  input.colour_gradient = gradient;
  input.residual = residual;
  input.with_screen_gradients = input.with_absolute_screen_gradients = true;
  input.with_blending_weights = true;
  const std::vector<BackwardKernel> kernels = backwardKernels();
  ASSERT_GE(kernels.size(), 2u);
  const SplatGradients expected =
      renderBackwardWith(kernels[0], takeBackScalar, {&instance, 1}, camera, {}, input)
          .instances[0];
  for (const BackwardKernel& kernel : kernels) {
    SCOPED_TRACE(kernel.target);
    const SplatGradients seen =
        renderBackwardWith(kernel, chosenBackProjector(), {&instance, 1}, camera, {}, input)
            .instances[0];
    for (const GradientArray& wanted : kGradientArrays) {
      const auto array = wanted.values;
      if ((expected.*array).empty()) continue;
      float largest = 0;
      for (const float value : expected.*array) largest = std::max(largest, std::abs(value));
      EXPECT_GT(largest, 0);
      for (size_t i = 0; i < (expected.*array).size(); ++i) {
        // Fused products and the polynomial: 3e-7 per alpha, and up to 700 splats behind a pixel's
        // first, whose roundings add up like a random walk.
        EXPECT_NEAR((seen.*array)[i], (expected.*array)[i], 3e-5f * largest);
      }
    }
  }
}

TEST(Backward, GivesZerosAndTheBackgroundForNoSplats) {
  const SplatCloud empty;
  const SplatInstance instance{&empty};
  const Camera camera = frontCamera(20, 10, 10, 3);
  const std::vector<float> gradient(pixelCount(camera) * 4, 0.5f);
  BackwardInput input;
  input.colour_gradient = gradient;
  RenderOptions options;
  options.with_background = true;
  for (const std::span<const SplatInstance> instances :
       {std::span<const SplatInstance>(), std::span<const SplatInstance>(&instance, 1)}) {
    const BackwardResult result = renderBackward(instances, camera, options, input);
    EXPECT_EQ(result.instances.size(), instances.size());
    EXPECT_EQ(result.visible_count, 0u);
    for (const double value : result.background) EXPECT_DOUBLE_EQ(value, 100.0);
    for (const double value : result.camera) EXPECT_EQ(value, 0.0);
  }
}

std::string refusal(const SplatCloud& cloud, const BackwardInput& input,
                    uint64_t memory_limit = UINT64_MAX) {
  const SplatInstance instance{&cloud};
  try {
    renderBackward({&instance, 1}, frontCamera(4, 3, 4, 3), {}, input, memory_limit);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(Backward, RefusesArraysOfAnotherSizeOrWithBadValues) {
  const SplatCloud cloud = smallCloud(3, 0, 290);
  const std::vector<float> good(48, 1.0f);
  BackwardInput input;
  EXPECT_NE(refusal(cloud, input).find("colour_gradient holds 0 values"), std::string::npos);
  input.colour_gradient = std::span(good).first(47);
  EXPECT_NE(refusal(cloud, input).find("colour_gradient holds 47 values"), std::string::npos);
  input.colour_gradient = good;
  EXPECT_EQ(refusal(cloud, input), "");
  for (const float bad : {std::nanf(""), INFINITY, -INFINITY, 1e6f, -1e6f}) {
    std::vector<float> values = good;
    values[5] = bad;
    BackwardInput broken = input;
    broken.colour_gradient = values;
    EXPECT_NE(refusal(cloud, broken).find("colour_gradient"), std::string::npos);
    broken = input;
    broken.residual = std::span(values).first(36);
    EXPECT_NE(refusal(cloud, broken).find("residual"), std::string::npos);
    broken = input;
    broken.edge_weights = std::span(values).first(12);
    EXPECT_NE(refusal(cloud, broken).find("edge_weights"), std::string::npos);
    broken = input;
    broken.errors = std::span(values).first(12);
    EXPECT_NE(refusal(cloud, broken).find("errors"), std::string::npos);
  }
  std::vector<float> negative(12, 1.0f);
  negative[3] = -0.5f;
  input.residual_weights = negative;
  EXPECT_NE(refusal(cloud, input).find("residual_weights holds -0.5"), std::string::npos);
}

TEST(Backward, RefusesMoreMemoryThanAllowedAndNamesIt) {
  const SplatCloud cloud = smallCloud(3, 0, 300);
  const std::vector<float> good(48, 1.0f);
  BackwardInput input;
  input.colour_gradient = good;
  const SplatInstance instance{&cloud};
  const uint64_t bound = backwardMemoryBound({&instance, 1}, frontCamera(4, 3, 4, 3), {}, input);
  EXPECT_EQ(refusal(cloud, input, bound), "");
  const std::string message = refusal(cloud, input, bound - 1);
  EXPECT_NE(message.find(std::to_string(bound)), std::string::npos) << message;
}

}  // namespace
}  // namespace stipple
