#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <vector>

#include "base/parallel.h"
#include "splat/cpu/tiles/tiled_render.h"
#include "splat/random_scene.h"

// Pictures without any effect, built twice: with the library as it is, and with effects compiled
// out (native/splat/render/effects.h). Prints a hash of every picture on every instruction set of this
// machine; with --seconds N, the processor time of N pictures instead.

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::frontCamera;
using testing::randomCloud;

uint64_t hashOf(const std::vector<float>& values) {
  uint64_t hash = 0xcbf29ce484222325u;
  for (const float value : values) {
    uint32_t bits;
    std::memcpy(&bits, &value, sizeof(bits));
    hash = (hash ^ bits) * 0x100000001b3u;
  }
  return hash;
}

RenderOptions without() {
  RenderOptions options;
  options.with_depth = false;
  return options;
}

void printHashes() {
  CloudRecipe recipe;
  recipe.count = 3000;
  recipe.degree = 2;
  const SplatCloud small = randomCloud(recipe, 1);
  recipe.size_min = 1e-4;
  recipe.antialias = Antialias::kMip;
  const SplatCloud thin = randomCloud(recipe, 2);
  for (const auto& [name, kernel] : tileKernels()) {
    for (const auto& [projector_name, projector] : projectors()) {
      for (const SplatCloud* cloud : {&small, &thin}) {
        for (const bool background : {false, true}) {
          for (const CameraModel model : {CameraModel::kPerspective, CameraModel::kOrthographic}) {
            Camera camera = frontCamera(203, 151, 150, 2.5);
            camera.model = model;
            RenderOptions options = without();
            options.with_background = background;
            options.background[1] = 0.5;
            const SplatInstance instance{cloud};
            RenderWorkspace workspace;
            RenderResult result;
            renderTiledWith(kernel, projector, {&instance, 1}, camera, options, workspace, result);
            std::printf("%s %s %d %d %d %016llx\n", name, projector_name, cloud == &thin,
                        static_cast<int>(background), static_cast<int>(model),
                        static_cast<unsigned long long>(hashOf(result.colour)));
          }
        }
      }
    }
  }
}

void printSeconds(int pictures) {
  CloudRecipe recipe;
  recipe.count = 60000;
  recipe.degree = 1;
  recipe.size_max = 0.03;
  const SplatCloud cloud = randomCloud(recipe, 3);
  const SplatInstance instance{&cloud};
  const Camera camera = frontCamera(480, 360, 400, 3);
  RenderWorkspace workspace;
  RenderResult result;
  const auto draw = [&] { renderTiled({&instance, 1}, camera, without(), workspace, result); };
  withThreads(1, [&] {
    draw();  // memory is there from now on
    const std::clock_t begin = std::clock();
    for (int i = 0; i < pictures; ++i) draw();
    std::printf("%.6f\n", static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC);
  });
}

}  // namespace
}  // namespace stipple

int main(int count, char** values) {
  if (count == 3 && std::strcmp(values[1], "--seconds") == 0) {
    stipple::printSeconds(std::atoi(values[2]));
  } else {
    stipple::printHashes();
  }
  return 0;
}
