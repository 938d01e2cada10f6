#include "shot/renderer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <future>

#include "base/error.h"
#include "math/colour.h"
#include "math/empty_depth.h"
#include "splat/random_scene.h"

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::frontCamera;
using testing::randomCloud;

class CpuImages final : public ImageRendererFactory {
 public:
  std::unique_ptr<ImageRenderer> makeImageRenderer() const override {
    return makeCpuImageRenderer();
  }
};

std::shared_ptr<const ImageRendererFactory> cpuImages() {
  return std::make_shared<CpuImages>();
}

constexpr uint32_t kWidth = 48, kHeight = 40;

Instances placed(size_t count = 300, ColourSpace space = ColourSpace::kDisplay) {
  CloudRecipe recipe;
  recipe.count = count;
  recipe.colour_space = space;
  Instances made;
  made.shares.push_back(std::make_shared<const SplatCloud>(randomCloud(recipe, 4)));
  made.list.push_back(testing::instanceOf(*made.shares[0]));
  return made;
}

Camera view() {
  return frontCamera(kWidth, kHeight, 50, 4);
}

std::vector<float> colourOf(Renderer& renderer, const Instances& instances,
                            const ShotSettings& settings) {
  std::vector<float> colour(size_t{kWidth} * kHeight * 4);
  ShotPasses passes;
  passes.colour = colour.data();
  ShotSettings asked = settings;
  askForPasses(passes, asked);
  Progress progress;
  renderer.render(instances, view(), asked, passes, progress);
  return colour;
}

ShotSettings settingsFor(const Instances& instances, OutputColour output) {
  ShotSettings settings;
  takeOutput(output, instances, settings);
  return settings;
}

double largestDifference(const std::vector<float>& a, const std::vector<float>& b) {
  double largest = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    largest = std::max(largest, std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i])));
  }
  return largest;
}

TEST(Renderer, LightIsTheCompositedPictureConverted) {
  const Instances instances = placed();
  Renderer renderer(cpuImages());
  std::vector<float> composited =
      colourOf(renderer, instances, settingsFor(instances, OutputColour::kComposited));
  const std::vector<float> light =
      colourOf(renderer, instances, settingsFor(instances, OutputColour::kSceneLinear));
  EXPECT_GT(largestDifference(composited, light), 0.05);
  lineariseColour(composited.data(), composited.size() / 4);
  EXPECT_EQ(composited, light);
}

TEST(Renderer, CloudsOfLightAreNotConverted) {
  const Instances instances = placed(300, ColourSpace::kLinear);
  Renderer renderer(cpuImages());
  EXPECT_EQ(colourOf(renderer, instances, settingsFor(instances, OutputColour::kSceneLinear)),
            colourOf(renderer, instances, settingsFor(instances, OutputColour::kComposited)));
}

TEST(Renderer, EveryMethodDrawsTheSamePicture) {
  const Instances instances = placed(100);
  Renderer renderer(cpuImages());
  ShotSettings settings = settingsFor(instances, OutputColour::kComposited);
  settings.options.low_pass = LowPass::kNone;
  const std::vector<float> tiled = colourOf(renderer, instances, settings);
  settings.method = ShotMethod::kReference;
  // The bound of single precision; docs of the knob "precision".
  EXPECT_LT(largestDifference(colourOf(renderer, instances, settings), tiled), 1e-4 * 2);
}

/// Draws everything in one colour.
class PlainImages final : public ImageRendererFactory {
 public:
  std::unique_ptr<ImageRenderer> makeImageRenderer() const override {
    return std::make_unique<Plain>();
  }
  RenderMemory imageMemory(std::span<const SplatInstance>, const Camera&, const RenderOptions&,
                           const RenderAccuracy&) const override {
    return {.result_bytes = 7};
  }

 private:
  class Plain final : public ImageRenderer {
   public:
    void render(std::span<const SplatInstance>, const Camera& camera, const RenderOptions&,
                const RenderAccuracy&, RenderResult& result, Progress*) override {
      result.width = camera.width;
      result.height = camera.height;
      result.colour.assign(size_t{4} * camera.width * camera.height, 0.25f);
    }
    void order(std::span<const SplatInstance>, const Camera&, const DrawOrderOutput&,
               Progress*) override {}
    uint64_t memoryBytes() const override { return 0; }
  };
};

TEST(Renderer, TheFactoryDrawsWhatIsNotADefinition) {
  const Instances instances = placed(100);
  Renderer renderer(std::make_shared<PlainImages>());
  ShotSettings settings = settingsFor(instances, OutputColour::kComposited);
  for (const bool is_blurred : {false, true}) {
    settings.sampling.aperture.radius = is_blurred ? 0.1 : 0;
    settings.sampling.samples = is_blurred ? 2 : 0;
    for (const ShotMethod method :
         {ShotMethod::kTiled, ShotMethod::kRays, ShotMethod::kReference,
          ShotMethod::kRaysUnlimited}) {
      settings.method = method;
      const std::vector<float> colour = colourOf(renderer, instances, settings);
      const bool is_plain = std::all_of(colour.begin(), colour.end(), [](float value) {
        return std::abs(value - 0.25f) < 1e-6f;
      });
      EXPECT_EQ(is_plain, method == ShotMethod::kTiled || method == ShotMethod::kRays)
          << static_cast<int>(method) << (is_blurred ? " blurred" : "");
    }
  }
  settings.sampling = {};
  settings.method = ShotMethod::kRays;
  // By rays means the exact order and shape of splats, in double.
  Renderer own(cpuImages());
  ShotSettings asked = settings;
  askForPasses({}, asked);
  EXPECT_EQ(colourOf(own, instances, settings),
            renderRays(instances.list, view(), asked.options, {}).colour);
  EXPECT_EQ(renderer.memory(instances, view(), settings).sum(), 7u);
}

TEST(Renderer, AShareOfTheSplatsIsThatOfTheCutAndDrawsFewer) {
  const Instances instances = placed(400);
  Renderer renderer(cpuImages());
  ShotSettings settings = settingsFor(instances, OutputColour::kComposited);
  settings.budget_share = 0.25;
  Instances cut = instances;
  CloudCuts cuts;
  cuts.cut(cut, 0.25, nullptr);
  EXPECT_EQ(splatCount(cut), 100u);
  ShotSettings whole = settings;
  whole.budget_share = 1;
  EXPECT_EQ(colourOf(renderer, instances, settings), colourOf(renderer, cut, whole));
  EXPECT_GT(renderer.memory(instances, view(), settings).sum(),
            renderer.memory(instances, view(), whole).sum());
}

TEST(Renderer, PicturesThatAreMadeAtOnceHaveTheBitsOfThoseMadeAlone) {
  const Instances instances = placed(2000);
  Renderer renderer(cpuImages());
  ShotSettings blurred = settingsFor(instances, OutputColour::kSceneLinear);
  blurred.sampling.aperture.radius = 0.1;
  blurred.sampling.aperture.focus_distance = 4;
  blurred.sampling.samples = 16;
  const ShotSettings sharp = settingsFor(instances, OutputColour::kSceneLinear);
  const std::vector<float> sharp_alone = colourOf(renderer, instances, sharp);
  const std::vector<float> blurred_alone = colourOf(renderer, instances, blurred);
  EXPECT_NE(sharp_alone, blurred_alone);
  auto first =
      std::async(std::launch::async, [&] { return colourOf(renderer, instances, blurred); });
  auto second =
      std::async(std::launch::async, [&] { return colourOf(renderer, instances, sharp); });
  EXPECT_EQ(first.get(), blurred_alone);
  EXPECT_EQ(second.get(), sharp_alone);
}

TEST(Renderer, BlursSplatsThatChangeWithEveryMethodAndShare) {
  const Instances instances = placed();
  SplatCloud after = *instances.shares[0];
  for (size_t i = 0; i < after.size(); ++i) after.positions[3 * i] += 0.4f;
  Renderer renderer(cpuImages());
  ShotSettings settings = settingsFor(instances, OutputColour::kSceneLinear);
  settings.sampling.shutter.step_count = 2;
  settings.sampling.samples = 8;
  for (const double share : {1.0, 0.5}) {
    for (const ShotMethod method : {ShotMethod::kTiled, ShotMethod::kReference, ShotMethod::kRays,
                                    ShotMethod::kRaysUnlimited}) {
      settings.method = method;
      settings.budget_share = share;
      ShotSettings by_clouds = settings, by_matrices = settings;
      by_clouds.sampling.shutter.clouds = {nullptr, std::make_shared<const SplatCloud>(after)};
      Mat4d last = Mat4d::Identity();
      last(0, 3) = 0.4;
      by_matrices.sampling.shutter.instances = {Mat4d::Identity(), last};
      const std::vector<float> still = colourOf(renderer, instances, settings);
      const std::vector<float> changed = colourOf(renderer, instances, by_clouds);
      const std::vector<float> moved = colourOf(renderer, instances, by_matrices);
      double from_still = 0, from_moved = 0;
      for (size_t i = 0; i < still.size(); ++i) {
        from_still += static_cast<double>(std::abs(changed[i] - still[i]));
        from_moved += static_cast<double>(std::abs(changed[i] - moved[i]));
      }
      // Places of float32, and splats at the rim of 1/255 in one of 8 pictures.
      EXPECT_LT(from_moved, 1e-3 * from_still) << static_cast<int>(method) << " at " << share;
      EXPECT_GT(from_still, 10);
      EXPECT_GT(renderer.memory(instances, view(), by_clouds).sum(),
                renderer.memory(instances, view(), by_matrices).sum() + 300 * 14 * 4 * share - 1);
    }
  }
}

TEST(Renderer, CountsTheSamplesOfABlurredPictureAlone) {
  const Instances instances = placed(10);
  ShotSettings settings;
  EXPECT_EQ(Renderer::sampleCount(instances, view(), settings), 1u);
  settings.sampling.aperture.radius = 0.1;
  settings.sampling.aperture.focus_distance = 4;
  EXPECT_GE(Renderer::sampleCount(instances, view(), settings), 16u);
  settings.sampling.samples = 9;
  EXPECT_EQ(Renderer::sampleCount(instances, view(), settings), 9u);
}

std::vector<float> everywhere(std::initializer_list<float> pixel) {
  std::vector<float> values;
  for (size_t i = 0; i < size_t{kWidth} * kHeight; ++i) {
    values.insert(values.end(), pixel.begin(), pixel.end());
  }
  return values;
}

TEST(Renderer, AnImageOfOneColourBehindSplatsIsThatBackground) {
  const Instances instances = placed();
  Renderer renderer(cpuImages());
  const std::vector<float> behind = everywhere({0.2f, 0.4f, 3.0f});
  // A matte leaves a hole in both.
  const std::vector<float> wall = everywhere({4.0f}), some = everywhere({0.75f});
  for (const OutputColour output : {OutputColour::kSceneLinear, OutputColour::kComposited}) {
    for (const bool has_matte : {false, true}) {
      ShotSettings settings;
      if (has_matte) settings.options.surface = {kWidth, kHeight, wall.data(), nullptr, some.data()};
      ShotSettings plain = settings;
      plain.options.with_background = true;
      for (size_t c = 0; c < 3; ++c) plain.options.background[c] = static_cast<double>(behind[c]);
      takeOutput(output, instances, plain);
      takeOutput(output, instances, settings);
      const std::vector<float> transparent = colourOf(renderer, instances, settings);
      settings.background_image = behind.data();
      const std::vector<float> over = colourOf(renderer, instances, settings);
      EXPECT_GT(largestDifference(over, transparent), 0.1);
      // Roundings of single precision around values of 3.
      EXPECT_LT(largestDifference(over, colourOf(renderer, instances, plain)), 2e-5);
      settings.options.with_background = true;
      EXPECT_THROW(validate(settings, view()), Error);
    }
  }
}

TEST(Renderer, AnImageBehindSplatsIsPixelByPixelAndNothingWhereItIsNoNumber) {
  const Instances instances = placed();
  Renderer renderer(cpuImages());
  ShotSettings settings = settingsFor(placed(1, ColourSpace::kLinear), OutputColour::kSceneLinear);
  const std::vector<float> alone = colourOf(renderer, instances, settings);
  std::vector<float> behind = everywhere({0, 0, 0});
  for (size_t i = 0; i < behind.size(); ++i) behind[i] = static_cast<float>(i % 7);
  behind[3] = std::nanf(""), behind[4] = INFINITY;
  settings.background_image = behind.data();
  const std::vector<float> over = colourOf(renderer, instances, settings);
  for (size_t i = 0; i < alone.size() / 4; ++i) {
    EXPECT_EQ(over[i * 4 + 3], 1.0f);
    for (size_t c = 0; c < 3; ++c) {
      const float light = std::isfinite(behind[i * 3 + c]) ? behind[i * 3 + c] : 0.0f;
      EXPECT_NEAR(over[i * 4 + c], alone[i * 4 + c] + (1 - alone[i * 4 + 3]) * light, 1e-5f);
    }
  }
}

/// Depths of splats, and what is needed to say what they should be.
struct Depths {
  std::vector<float> solid, mean, colour;
};

Depths depthsOf(const Instances& instances, ShotSettings settings) {
  Depths made;
  Renderer renderer(cpuImages());
  for (const bool is_solid : {false, true}) {
    std::vector<float> depth(size_t{kWidth} * kHeight), colour(depth.size() * 4);
    ShotPasses passes;
    passes.depth = depth.data();
    passes.colour = colour.data();
    settings.solid_depth = is_solid;
    ShotSettings asked = settings;
    askForPasses(passes, asked);
    Progress progress;
    renderer.render(instances, view(), asked, passes, progress);
    (is_solid ? made.solid : made.mean) = depth;
    made.colour = colour;
  }
  return made;
}

TEST(Renderer, ASolidDepthIsThereWhereHalfOfAPixelIsCovered) {
  const Instances instances = placed(30);
  ShotSettings settings = settingsFor(instances, OutputColour::kSceneLinear);
  const Depths alone = depthsOf(instances, settings);
  size_t faint = 0, covered = 0;
  for (size_t i = 0; i < alone.solid.size(); ++i) {
    const bool is_solid = alone.colour[i * 4 + 3] >= 0.5f;
    covered += is_solid;
    faint += !is_solid && alone.mean[i] < kEmptyDepth;
    EXPECT_EQ(alone.solid[i], is_solid ? alone.mean[i] : kEmptyDepth);
  }
  EXPECT_GT(faint, 50u);
  EXPECT_GT(covered, 50u);
  // A background covers everything, and changes no depth.
  settings.options.with_background = true;
  EXPECT_EQ(depthsOf(instances, settings).solid, alone.solid);
}

TEST(Renderer, ASolidDepthIsOfSplatsOrOfTheSurfaceAndOfNothingBetween) {
  const Instances instances = placed(30);
  const std::vector<float> far = everywhere({1000.0f});
  for (const float opacity : {1.0f, 0.7f, 0.3f}) {
    const std::vector<float> colour = everywhere({0, 0, 0, opacity});
    ShotSettings settings = settingsFor(instances, OutputColour::kSceneLinear);
    const Depths alone = depthsOf(instances, settings);
    settings.options.surface = {kWidth, kHeight, far.data(), colour.data(), nullptr};
    settings.options.splats_apart = true;
    const Depths both = depthsOf(instances, settings);
    size_t splats_show = 0, surface_shows = 0;
    for (size_t i = 0; i < both.solid.size(); ++i) {
      const float alpha = alone.colour[i * 4 + 3], own = (1 - alpha) * opacity;
      if (std::abs(alpha - own) < 1e-4f || std::abs(alpha + own - 0.5f) < 1e-4f) continue;
      if (alpha == 0.0f || (own > alpha && alpha + own >= 0.5f)) {
        ++surface_shows;
        EXPECT_EQ(both.solid[i], 1000.0f);
      } else if (alpha + own < 0.5f) {
        EXPECT_EQ(both.solid[i], kEmptyDepth);
      } else {
        ++splats_show;
        // The surface's part of the mean is taken off again: roundings of a thousand metres.
        EXPECT_NEAR(both.solid[i], alone.mean[i], 2e-3f);
      }
    }
    EXPECT_GT(splats_show, 50u);
    EXPECT_GT(surface_shows, 50u);
  }
}

TEST(ShotSettings, DerivativesAreThoseOfOneSharpTiledPictureOfSplatsAlone) {
  const Instances instances = placed(5);
  const auto refuses = [&](auto change) {
    ShotSettings settings = settingsFor(instances, OutputColour::kComposited);
    EXPECT_NO_THROW(requireDerivative(settings, instances));
    change(settings);
    EXPECT_THROW(requireDerivative(settings, instances), Error);
  };
  refuses([](ShotSettings& s) { s.method = ShotMethod::kRays; });
  refuses([](ShotSettings& s) { s.has_accuracy = true; });
  refuses([](ShotSettings& s) { s.linearise = true; });
  refuses([](ShotSettings& s) { s.sampling.samples = 4; });
  refuses([](ShotSettings& s) { s.options.object_order = ObjectOrder::kApart; });
  refuses([](ShotSettings& s) { s.solid_depth = true; });
  const float image = 0;
  refuses([&](ShotSettings& s) { s.background_image = &image; });
  refuses([&](ShotSettings& s) { s.surroundings = {&image, 1, 1}; });
  Instances held_out = instances;
  held_out.list[0].holdout = true;
  EXPECT_THROW(requireDerivative(settingsFor(instances, OutputColour::kComposited), held_out),
               Error);
}

}  // namespace
}  // namespace stipple
