// What it takes to compare an object that networks have made with its image, and to lead its
// colours there: beside as many images of it, and beside as many times as it is decoded and drawn.
#include <benchmark/benchmark.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "base/parallel.h"
#include "base/random.h"
#include "bench/comparison.h"
#include "fit/image_likeness.h"
#include "fit/image_matching.h"
#include "math/camera_rig.h"

namespace stipple::bench {
namespace {

constexpr int kRounds = 3;
constexpr uint64_t kAnchors = 256;
constexpr uint32_t kSide = 128;
constexpr size_t kTokens = 128;
/// About 820 images are drawn for a likeness, two thirds of them 128 pixels wide, others 64; 60 are
/// for matching.
constexpr int kLikenessImages = 820;
constexpr uint64_t kSteps = 60;

/// A disc in two colours.
PreparedImage disc() {
  PreparedImage image;
  image.size = kSide;
  for (uint32_t y = 0; y < kSide; ++y) {
    for (uint32_t x = 0; x < kSide; ++x) {
      const bool shows = std::hypot(x - 0.5 * kSide, y - 0.5 * kSide) < 0.42 * kSide;
      const bool is_upper = y < kSide / 2;
      for (const int value : {is_upper ? 200 : 60, 110, is_upper ? 60 : 200}) {
        image.rgb.push_back(static_cast<uint8_t>(shows ? value : 0));
      }
      image.alpha.push_back(shows ? 255 : 0);
    }
  }
  return image;
}

Camera straight() {
  Camera camera =
      cameraAlong({0, -2, 0}, {0, 1, 0}, Vec3d::UnitZ(), 40 * std::numbers::pi / 180, kSide);
  camera.near_plane = 0.01;
  return camera;
}

/// Networks as those that come with Stipple, before they have learned, and a latent.
class Object {
 public:
  Object() : networks_(sizes()), values_(networks_.startValues(1)) {
    latent_.token_count = kTokens;
    latent_.width = 16;
    for (size_t i = 0; i < kTokens * 16; ++i) {
      const double u = unitDouble(keyedBits(5, RandomUse::kTokenNoise, i));
      latent_.tokens.push_back(static_cast<float>(4 * u - 2));
    }
  }

  SplatCloud splats(uint64_t seed) const {
    return networks_.decode(values_, latent_.tokens, kAnchors, seed);
  }
  void match(const PreparedImage& image) const {
    Latent latent = latent_;
    matchColours(networks_, values_, kAnchors, *cpuBackends(), image, straight(), latent);
    benchmark::DoNotOptimize(latent.tokens.data());
  }

 private:
  static AutoencoderSizes sizes() {
    AutoencoderSizes sizes;
    sizes.encoder_blocks = 2;
    sizes.octree_blocks = 2;
    sizes.splat_blocks = 3;
    sizes.follows_spacing = true;
    return sizes;
  }

  DensityAutoencoder networks_;
  std::vector<float> values_;
  Latent latent_;
};

void draw(ImageRenderer& images, const SplatCloud& cloud, RenderResult& result) {
  RenderOptions options;
  options.with_depth = false;
  const SplatInstance instance{&cloud};
  images.render({&instance, 1}, straight(), options, {}, result);
}

void likeness(benchmark::State& state) {
  const SplatCloud cloud = Object().splats(1);
  const PreparedImage image = disc();
  const auto images = cpuBackends()->makeImageRenderer();
  RenderResult result;
  const auto ours = [&] {
    benchmark::DoNotOptimize(imageLikeness(*cpuBackends(), cloud, image).psnr);
  };
  const auto as_many_images = [&] {
    for (int i = 0; i < kLikenessImages; ++i) draw(*images, cloud, result);
  };
  withThreads(2, [&] { compare(state, "images", ours, as_many_images); });
}

void matching(benchmark::State& state) {
  const Object object;
  const PreparedImage image = disc();
  const auto images = cpuBackends()->makeImageRenderer();
  RenderResult result;
  const auto forward_alone = [&] {
    for (uint64_t i = 0; i < kSteps; ++i) draw(*images, object.splats(i), result);
  };
  withThreads(2, [&] {
    compare(
        state, "decoded_and_drawn", [&] { object.match(image); }, forward_alone);
  });
}

const bool registered = [] {
  benchmark::RegisterBenchmark("generate.likeness.2048", likeness)
      ->UseManualTime()
      ->Iterations(kRounds)
      ->Unit(benchmark::kMillisecond);
  benchmark::RegisterBenchmark("generate.match_colours.2048", matching)
      ->UseManualTime()
      ->Iterations(kRounds)
      ->Unit(benchmark::kMillisecond);
  return true;
}();

}  // namespace
}  // namespace stipple::bench
