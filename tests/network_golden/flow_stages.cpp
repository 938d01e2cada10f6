// From a condition to a latent: places of tokens, noise, single calls of the flow network,
// sampling.

#include <string>
#include <vector>

#include "base/error.h"
#include "base/progress.h"
#include "generate/flow_network.h"
#include "generate/flow_sampler.h"
#include "generate/image_condition.h"
#include "generate/seeded_noise.h"
#include "generate/sobol_points.h"
#include "network_golden/stages.h"

namespace stipple {
namespace {

// Velocities are up to 4.4; the same network in float64 differs from what was recorded in float32
// by up to 2.6e-5 in a call.
constexpr StageTolerance kCallTolerance = {5e-5, 0.0};
constexpr StageTolerance kSampleTolerance = {2e-4, 0.0};
// PyTorch's vectorised logarithm and cosine are a few ulp off, of numbers up to 5.8.
constexpr StageTolerance kNoiseTolerance = {2e-6, 0.0};
// 1000 t in float32, computed by the one and the other way.
constexpr StageTolerance kTimeTolerance = {0.0, 1.2e-7};

Latent latentOf(const GoldenFile& file, const std::string& name) {
  Latent latent;
  const std::vector<uint64_t> shape = file.shape(name + ".latent");
  latent.token_count = shape.at(1);
  latent.width = static_cast<uint32_t>(shape.at(2));
  latent.tokens = file.floats(name + ".latent");
  const std::vector<float> camera = file.floats(name + ".camera");
  for (size_t i = 0; i < kCameraWidth; ++i) latent.camera[i] = camera.at(i);
  return latent;
}

void compareLatents(const std::string& stage, const Latent& seen, const GoldenFile& file,
                    StageTolerance tolerance, StageReport& report) {
  const Latent expected = latentOf(file, "expect." + stage);
  report.compare(stage + ".latent", seen.tokens, expected.tokens, tolerance);
  report.compare(stage + ".camera", seen.camera, expected.camera, tolerance);
}

ImageCondition conditionOf(const GoldenFile& file, const std::string& structure,
                           const std::string& colour) {
  ImageCondition condition;
  condition.rows = file.shape(structure).at(1);
  condition.structure_width = static_cast<uint32_t>(file.shape(structure).at(2));
  condition.colour_width = static_cast<uint32_t>(file.shape(colour).at(2));
  condition.structure = file.floats(structure);
  condition.colour = file.floats(colour);
  return condition;
}

FlowSettings settingsOf(const GoldenFile& file) {
  return {.steps = file.config().at("steps").get<uint32_t>(),
          .guidance = file.config().at("guidance").get<double>(),
          .shift = file.config().at("shift").get<double>()};
}

Latent sampled(const NetworkRun& run, const FlowNetwork& network, const FlowContext& context,
               const Latent& noise, const FlowSettings& settings) {
  GenerationNoise numbers;
  numbers.tokens = noise.tokens;
  numbers.camera.assign(noise.camera.begin(), noise.camera.end());
  SamplerState state = startSampling(network, noise.token_count, numbers, settings);
  sampleLatent(run, network, context, state);
  return state.latent;
}

/// A file with one call and one run of the sampler.
void callStages(const GoldenFile& file, StageReport& report) {
  if (!file.has("expect.velocity.latent")) return;
  const FlowNetwork network(file.weights());
  const Latent noise = latentOf(file, "input");
  report.compare("sobol", sobolPoints(noise.token_count), file.floats("input.sobol"), {0.0, 0.0});
  const FlowContext context =
      network.context(file.run(), conditionOf(file, "input.feature1", "input.feature2"));
  Latent velocity;
  network.velocity(file.run(), noise, file.config().at("velocity_t").get<double>(), context,
                   velocity);
  compareLatents("velocity", velocity, file, kCallTolerance, report);
  compareLatents("sample", sampled(file.run(), network, context, noise, settingsOf(file)), file,
                 kSampleTolerance, report);
}

/// Noise that PyTorch drew on a CPU.
void noiseStages(const GoldenFile& file, StageReport& report) {
  const NoiseSizes sizes = {.colour = file.floats("input.vae_noise").size(),
                            .tokens = file.floats("input.latent").size()};
  const GenerationNoise noise = drawNoise(
      sizes, {NoiseSource::kTorchCpu, file.config().at("torch_cpu_seed").get<uint64_t>()});
  report.compare("noise.vae", noise.colour, file.floats("input.vae_noise"), kNoiseTolerance);
  report.compare("noise.latent", noise.tokens, file.floats("input.latent"), kNoiseTolerance);
  report.compare("noise.camera", noise.camera, file.floats("input.camera"), kNoiseTolerance);
}

/// Every step from the recorded state before it, with and without the image, then all of them.
void stepStages(const GoldenFile& file, StageReport& report) {
  if (!file.has("expect.step0.cond.latent")) return;
  noiseStages(file, report);
  const FlowNetwork network(file.weights("flow."));
  const FlowSettings settings = settingsOf(file);
  const Latent noise = latentOf(file, "input");
  report.compare("sobol", sobolPoints(noise.token_count), file.floats("expect.sobol"), {0.0, 0.0});
  const std::vector<double> times = flowTimes(settings);
  std::vector<float> model_times;
  for (size_t i = 0; i + 1 < times.size(); ++i) {
    model_times.push_back(static_cast<float>(1000.0 * times[i]));
  }
  report.compare("model_times", model_times, file.floats("expect.model_times"), kTimeTolerance);

  const FlowContext context =
      network.context(file.run(), conditionOf(file, "expect.feature1", "expect.feature2"));
  const FlowContext nothing = network.emptyContext(file.run(), context.rows);
  for (uint32_t step = 0; step < settings.steps; ++step) {
    const std::string name = "step" + std::to_string(step);
    const Latent before =
        step == 0 ? noise : latentOf(file, "expect.step" + std::to_string(step - 1) + ".x");
    Latent velocity;
    network.velocity(file.run(), before, times[step], context, velocity);
    compareLatents(name + ".cond", velocity, file, kCallTolerance, report);
    network.velocity(file.run(), before, times[step], nothing, velocity);
    compareLatents(name + ".uncond", velocity, file, kCallTolerance, report);
    SamplerState state;
    state.settings = settings;
    state.step = step;
    state.latent = before;
    // Sampling goes on to the end; what it has after one step is what cancelling then leaves.
    Progress progress;
    NetworkRun run = file.run();
    run.progress = &progress;
    const FlowListener listener = {[&](const FlowPreview&) { progress.cancel(); }, 1};
    try {
      sampleLatent(run, network, context, state, listener);
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kCancelled) throw;
    }
    compareLatents(name + ".x", state.latent, file, kCallTolerance, report);
  }
  compareLatents("sample", sampled(file.run(), network, context, noise, settings), file,
                 kSampleTolerance, report);
}

}  // namespace

void flowStages(const GoldenFile& file, StageReport& report) {
  if (file.has("input.uncond")) return;  // of training
  callStages(file, report);
  stepStages(file, report);
}

}  // namespace stipple
