// The whole way, from the bytes of an image and a seed to splats, each step from what the library
// itself made before.

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "decode/latent/latent_decoder.h"
#include "decode/latent/latent_density.h"
#include "decode/latent/latent_networks.h"
#include "density/anchor_sampling.h"
#include "generate/dino_encoder.h"
#include "generate/flow_network.h"
#include "generate/flow_sampler.h"
#include "generate/image_condition.h"
#include "generate/image_preparation.h"
#include "generate/seeded_noise.h"
#include "generate/vae_encoder.h"
#include "network_golden/recorded_splats.h"
#include "network_golden/stages.h"

namespace stipple {
namespace {

// A relative difference of 1e-5 in the features moves a latent by 1.2e-4; no leaf changes before
// 1e-3 in the latent.
constexpr StageTolerance kWholeTolerance = {1e-3, 0.0};

Latent latentStages(const GoldenFile& file, StageReport& report) {
  const nlohmann::json& dino = file.config().at("dino");
  const DinoEncoder structure(file.weights("dino."), {dino.at("hidden_size").get<size_t>() /
                                                      dino.at("num_heads").get<size_t>()});
  const VaeEncoder colour(file.weights("vae."));
  const FlowNetwork network(file.weights("flow."));
  const FlowSettings settings = {.steps = file.config().at("steps").get<uint32_t>(),
                                 .guidance = file.config().at("guidance").get<double>(),
                                 .shift = file.config().at("shift").get<double>()};
  const std::vector<uint64_t> shape = file.shape("input.image_rgba");
  const ByteImage picture = {static_cast<uint32_t>(shape.at(1)), static_cast<uint32_t>(shape.at(0)),
                             static_cast<uint32_t>(shape.at(2)), file.bytes("input.image_rgba")};
  const PreparedImage image =
      prepareImage(picture, nullptr,
                   {.canvas_size = file.config().at("canvas_size").get<uint32_t>(),
                    .erode_radius = file.config().at("erode_radius").get<uint32_t>()});
  const uint64_t token_count = file.config().at("flow").at("q_token_length").get<uint64_t>();
  const GenerationNoise noise =
      drawNoise({.colour = colour.noiseCount(image.size, image.size),
                 .tokens = token_count * network.sizes().token_width},
                {NoiseSource::kTorchCpu, file.config().at("torch_cpu_seed").get<uint64_t>()});
  const ImageCondition condition = encodeImage(file.run(), structure, colour, image, noise.colour);
  SamplerState state = startSampling(network, token_count, noise, settings);
  sampleLatent(file.run(), network, network.context(file.run(), condition), state);
  report.compare("whole.latent", state.latent.tokens, file.floats("expect.sample.latent"),
                 kWholeTolerance);
  report.compare("whole.camera", state.latent.camera, file.floats("expect.sample.camera"),
                 kWholeTolerance);
  return state.latent;
}

AnchorSet drawnAnchors(const GoldenFile& file, const LatentNetworks& networks,
                       std::shared_ptr<const Latent> latent, StageReport& report) {
  const LatentDensity density(networks.octree, latent, file.run(),
                              file.config().at("level").get<int>());
  RecordedUniformSource source(recordedUniforms(file));
  AnchorSet anchors =
      sampleAnchors(density, {.count = file.config().at("num_points").get<uint64_t>()}, source);
  report.compareExactly("whole.leaves",
                        std::vector<int64_t>(anchors.leaves.begin(), anchors.leaves.end()),
                        recordedLeaves(file));
  return anchors;
}

void splatStages(const GoldenFile& file, Latent whole, StageReport& report) {
  if (!file.hasUnder("weights.decoder.") || !file.has("expect.gaussians.position")) return;
  const LatentNetworks networks = readLatentNetworks(file.weights("decoder."));
  const auto latent = std::make_shared<const Latent>(std::move(whole));
  const AnchorSet anchors = report.judgement() == StageJudgement::kErrors
                                ? recordedAnchors(file)
                                : drawnAnchors(file, networks, latent, report);
  DecodeRequest request;
  request.anchors = &anchors;
  request.gaussians_per_anchor = networks.gaussians->gaussians();
  compareSplats("whole.", file,
                LatentDecoder(networks.gaussians, latent, file.run()).decode(request),
                kWholeTolerance, report);
}

}  // namespace

void wholeStages(const GoldenFile& file, StageReport& report) {
  if (!file.has("input.image_rgba") || !file.hasUnder("weights.flow.")) return;
  splatStages(file, latentStages(file, report), report);
}

}  // namespace stipple
