#include <gtest/gtest.h>

#include <cmath>

#include "base/parallel.h"
#include "splat/backward_cases.h"
#include "splat/cpu/tiles/tile_kernel_backward.h"
#include "splat/cpu/tiles/tiled_backward.h"

// Every number that the backward pass gives, in each of its modes: the same bits for any number of
// threads, and the same on every instruction set up to rounding.

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::frontCamera;
using testing::pixelCount;
using testing::randomCloud;
using testing::randomWeights;

enum class Wanted { kWeights, kGradients, kContributions, kEverything };

/// A scene of two clouds with pixels that end early, over a background.
struct Scene {
  explicit Scene(const CloudRecipe& recipe)
      : clouds{randomCloud(recipe, 501), randomCloud(recipe, 502)},
        gradient(randomWeights(pixelCount(camera) * 4, 503)),
        residual(randomWeights(pixelCount(camera) * 3, 504)),
        weights(randomWeights(pixelCount(camera), 505, 0, 1)) {
    options.with_background = true;
    options.background[1] = 1;
  }

  BackwardInput input(Wanted wanted) const {
    BackwardInput made;
    if (wanted == Wanted::kWeights) {
      made.with_blending_weights = true;
      return made;
    }
    made.colour_gradient = gradient;
    if (wanted == Wanted::kGradients) return made;
    made.residual = residual;
    made.residual_weights = weights;
    if (wanted == Wanted::kContributions) return made;
    made.edge_weights = weights;
    made.errors = weights;
    made.with_blending_weights = made.with_covered = true;
    made.with_screen_gradients = made.with_absolute_screen_gradients = true;
    return made;
  }

  std::vector<SplatInstance> instances() const {
    SplatInstance turned{&clouds[1]};
    turned.object_to_world.topLeftCorner<3, 3>() << 0, -1, 0, 1, 0, 0.25, 0, 0, 1;
    return {{&clouds[0]}, turned};
  }

  SplatCloud clouds[2];
  Camera camera = frontCamera(110, 83, 80, 3);
  RenderOptions options;
  std::vector<float> gradient, residual, weights;
};

constexpr Wanted kEveryMode[] = {Wanted::kWeights, Wanted::kGradients, Wanted::kContributions,
                                 Wanted::kEverything};

TEST(BackwardOutputs, AreTheSameBitsForAnyNumberOfThreads) {
  const Scene scene({.count = 5000, .degree = 2});
  for (const Wanted wanted : kEveryMode) {
    BackwardResult results[2];
    for (unsigned threads : {1u, 2u}) {
      withThreads(threads, [&] {
        results[threads - 1] =
            renderBackward(scene.instances(), scene.camera, scene.options, scene.input(wanted));
      });
    }
    EXPECT_EQ(results[0].camera, results[1].camera);
    EXPECT_EQ(results[0].background, results[1].background);
    for (size_t instance : {0u, 1u}) {
      for (const GradientArray& output : kGradientArrays) {
        EXPECT_EQ(results[0].instances[instance].*output.values,
                  results[1].instances[instance].*output.values)
            << output.name;
      }
    }
    EXPECT_EQ(results[0].instances[0].largest_errors.empty(), wanted != Wanted::kEverything);
  }
}

TEST(BackwardOutputs, AreThoseOfTheScalarKernelOnEveryTarget) {
  const Scene scene({.count = 1500, .degree = 1, .size_min = 0.01});
  const std::vector<BackwardKernel> kernels = backwardKernels();
  ASSERT_GE(kernels.size(), 2u);
  for (const Wanted wanted : kEveryMode) {
    const auto run = [&](const BackwardKernel& kernel) {
      return renderBackwardWith(kernel, chosenBackProjector(), scene.instances(), scene.camera,
                                scene.options, scene.input(wanted));
    };
    const BackwardResult expected = run(kernels[0]);
    for (const BackwardKernel& kernel : kernels) {
      SCOPED_TRACE(kernel.target);
      const BackwardResult seen = run(kernel);
      for (size_t c = 0; c < 3; ++c) {
        // Sums over 9,130 pixels of float32 transmittances.
        EXPECT_NEAR(seen.background[c], expected.background[c], 1e-3);
      }
      double most_camera = 0;
      for (const double value : expected.camera)
        most_camera = std::max(most_camera, std::abs(value));
      for (size_t k = 0; k < 6; ++k) {
        EXPECT_NEAR(seen.camera[k], expected.camera[k], 3e-5 * most_camera);
      }
      for (size_t instance : {0u, 1u}) {
        for (const GradientArray& output : kGradientArrays) {
          const std::vector<float>& of_scalar = expected.instances[instance].*output.values;
          const std::vector<float>& values = seen.instances[instance].*output.values;
          ASSERT_EQ(values.size(), of_scalar.size()) << output.name;
          float largest = 0;
          for (const float value : of_scalar) largest = std::max(largest, std::abs(value));
          for (size_t i = 0; i < values.size(); ++i) {
            // Fused products and the polynomial: 3e-7 per alpha; near alpha = 0.99 dividing T by
            // 1 - alpha makes a hundred of it.
            ASSERT_NEAR(values[i], of_scalar[i], 3e-5f * largest) << output.name << " " << i;
          }
        }
      }
    }
  }
}

}  // namespace
}  // namespace stipple
