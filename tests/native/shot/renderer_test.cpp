#include "shot/renderer.h"

#include <gtest/gtest.h>

#include <future>

#include "base/error.h"
#include "math/colour.h"
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
  askForPasses(passes, asked.options);
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
         {ShotMethod::kTiled, ShotMethod::kRays, ShotMethod::kReference, ShotMethod::kYardstick}) {
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
  askForPasses({}, asked.options);
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
  Instances held_out = instances;
  held_out.list[0].holdout = true;
  EXPECT_THROW(requireDerivative(settingsFor(instances, OutputColour::kComposited), held_out),
               Error);
}

}  // namespace
}  // namespace stipple
