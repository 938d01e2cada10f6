// Times whole steps of a fit on a data set of make_scene.py: forward, loss, backward, Adam.
//
//   training_step FOLDER STEPS
//
// Prints seconds per step as they pass, and processor seconds of all threads.

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <exception>
#include <string>
#include <vector>

#include "io/image_file.h"
#include "io/splats/splat_file.h"
#include "io/views/camera_file.h"
#include "train/backend/render_backend.h"

namespace stipple {
namespace {

constexpr int kWarmUp = 3;

double processorSeconds() {
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

double seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

std::vector<float> colours(const Image& image) {
  std::vector<float> rgb;
  rgb.reserve(image.pixelCount() * 3);
  for (size_t i = 0; i < image.pixelCount(); ++i) {
    for (size_t c = 0; c < 3; ++c) rgb.push_back(image.pixels[i * image.channels + c]);
  }
  return rgb;
}

struct Pass {
  const char* name;
  double spent = 0;  ///< seconds
};

void run(const std::string& folder, int steps) {
  const std::vector<CameraView> views = readCameraFile(folder + "/transforms.json");
  const auto backend = makeCpuBackend();
  backend->upload(readSplatFile(folder + "/start.ply"));
  for (const CameraView& view : views) {
    const Image image = readImageFile(folder + "/" + view.image_path);
    backend->addTarget(image.width, image.height, colours(image));
  }
  RenderOptions options;
  options.with_background = true;
  options.with_depth = false;
  // As fits begin: harmonics above the constant one join after a thousand steps, but are carried.
  options.sh_degree_limit = 0;
  StepOptions step;
  step.learning_rates = {1.6e-4, 1e-3, 5e-3, 5e-2, 2.5e-3, 1.25e-4};
  Pass passes[] = {{"forward"}, {"loss"}, {"backward"}, {"Adam"}};
  double began = 0, processor = 0, first_loss = 0, last_loss = 0;
  for (int i = 0; i < kWarmUp + steps; ++i) {
    if (i == kWarmUp) {
      for (Pass& pass : passes) pass.spent = 0;
      began = seconds();
      processor = processorSeconds();
    }
    const size_t view = static_cast<size_t>(i) * 5 % views.size();
    const double t0 = seconds();
    backend->forward(views[view].camera, options);
    const double t1 = seconds();
    last_loss = backend->loss(static_cast<uint32_t>(view), {}).loss;
    if (i == 0) first_loss = last_loss;
    const double t2 = seconds();
    backend->backward({});
    const double t3 = seconds();
    backend->step(step);
    const double t4 = seconds();
    passes[0].spent += t1 - t0;
    passes[1].spent += t2 - t1;
    passes[2].spent += t3 - t2;
    passes[3].spent += t4 - t3;
  }
  const double count = steps;
  std::printf("%.6f %.6f\n", (seconds() - began) / count, (processorSeconds() - processor) / count);
  for (const Pass& pass : passes)
    std::fprintf(stderr, "%s %.2f ms, ", pass.name, 1e3 * pass.spent / count);
  std::fprintf(stderr, "loss %.4f to %.4f\n", first_loss, last_loss);
}

}  // namespace
}  // namespace stipple

int main(int argc, char** argv) {
  const int steps = argc == 3 ? std::atoi(argv[2]) : 0;
  if (steps < 1) {
    std::fputs("usage: training_step FOLDER STEPS\n", stderr);
    return 2;
  }
  try {
    stipple::run(argv[1], steps);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "training_step: %s\n", error.what());
    return 1;
  }
  return 0;
}
