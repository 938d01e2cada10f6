#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include "network_golden/compare_share.h"
#include "network_golden/stages.h"
#include "train/networks/trained_flow.h"

namespace stipple {
namespace {

// A run of this golden in float32 is off by 1.1e-5 of the largest number of a tensor.
constexpr double kShareOfLargest = 5e-5;

Latent latentOf(const GoldenFile& file, const std::string& name, size_t b) {
  Latent latent;
  const std::vector<uint64_t> shape = file.shape(name + ".latent");
  const std::vector<float> tokens = file.floats(name + ".latent");
  const std::vector<float> camera = file.floats(name + ".camera");
  latent.token_count = shape.at(1);
  latent.width = static_cast<uint32_t>(shape.at(2));
  const auto count = static_cast<ptrdiff_t>(latent.token_count * latent.width);
  const auto first = static_cast<ptrdiff_t>(b) * count;
  latent.tokens.assign(tokens.begin() + first, tokens.begin() + first + count);
  std::copy_n(camera.begin() + static_cast<ptrdiff_t>(b * kCameraWidth), kCameraWidth,
              latent.camera.begin());
  return latent;
}

FlowSizes sizesOf(const GoldenFile& file) {
  const auto number = [&](const char* name) { return file.config().at(name).get<size_t>(); };
  FlowSizes sizes;
  sizes.block.channels = number("C");
  sizes.block.heads = number("heads");
  sizes.block.head_width = number("head_dim");
  sizes.block.mlp_width = file.shape("weights.blocks.0.mlp.mlp.0.weight").at(0);
  sizes.block.rotary_width = file.shape("weights.repo_layers.0.gate_map.weight").at(0);
  sizes.block_count = number("blocks");
  sizes.noise_refiner_count = sizes.context_refiner_count = number("refiners");
  sizes.token_width = number("latent_channels");
  sizes.structure_width = number("cond");
  sizes.colour_width = number("cond2");
  sizes.time_width = file.shape("weights.t_embedder.mlp.0.weight").at(1);
  return sizes;
}

/// Features of sample b, zeros where nothing is known of its image.
ImageCondition conditionOf(const GoldenFile& file, size_t b, bool is_known) {
  ImageCondition condition;
  condition.rows = file.shape("input.feature1").at(1);
  const auto part = [&](const char* name, std::vector<float>& numbers, uint32_t& width) {
    const std::vector<float> all = file.floats(name);
    width = static_cast<uint32_t>(file.shape(name).at(2));
    const auto count = static_cast<ptrdiff_t>(condition.rows * width);
    const auto first = static_cast<ptrdiff_t>(b) * count;
    numbers.assign(all.begin() + first, all.begin() + first + count);
    if (!is_known) std::fill(numbers.begin(), numbers.end(), 0.0f);
  };
  part("input.feature1", condition.structure, condition.structure_width);
  part("input.feature2", condition.colour, condition.colour_width);
  return condition;
}

}  // namespace

void flowTrainingStages(const GoldenFile& file, StageReport& report) {
  if (!file.has("input.uncond")) return;
  ParameterLayout layout;
  const TrainedFlow flow(layout, sizesOf(file));
  const std::vector<float> values = layout.read(file.weights());
  std::vector<float> gradients(layout.size(), 0.0f);
  const std::vector<float> times = file.floats("input.t");
  const std::vector<int64_t> unknown = file.integers("input.uncond");
  std::map<std::string, std::vector<float>> seen;
  const auto keep = [&](const std::string& name, std::span<const float> numbers) {
    seen[name].insert(seen[name].end(), numbers.begin(), numbers.end());
  };
  const auto keepLatent = [&](const std::string& name, const Latent& latent) {
    keep(name + ".latent", latent.tokens);
    keep(name + ".camera", latent.camera);
  };
  double loss = 0;
  const auto batch = static_cast<double>(times.size());
  for (size_t b = 0; b < times.size(); ++b) {
    const auto time = static_cast<double>(times[b]);
    const FlowExample example =
        flowExample(latentOf(file, "input.x0", b), latentOf(file, "input.noise", b), time);
    ImageCondition condition = conditionOf(file, b, unknown[b] == 0);
    TrainedFlow::Tape tape;
    const Latent velocity = flow.forward(values, example.state, time, condition, tape);
    Latent by;
    const auto count = static_cast<double>(velocity.tokens.size() + kCameraWidth);
    loss += flowLoss(velocity, example.velocity, batch * count, by);
    TrainedFlow::InputGradients inputs =
        flow.backward(values, example.state, condition, tape, by, gradients);
    if (unknown[b] != 0) {
      std::fill(inputs.structure.begin(), inputs.structure.end(), 0.0f);
      std::fill(inputs.colour.begin(), inputs.colour.end(), 0.0f);
    }
    keepLatent("expect.x_t", example.state);
    keepLatent("expect.target", example.velocity);
    keepLatent("expect.velocity", velocity);
    keepLatent("grad.expect.velocity", by);
    keep("grad.expect.x_t.latent", inputs.tokens);
    keep("grad.expect.x_t.camera", inputs.camera);
    keep("grad.input.feature1", inputs.structure);
    keep("grad.input.feature2", inputs.colour);
    keep("expect.t_embedding", tape.encoding);
  }
  const std::vector<float> whole = {static_cast<float>(loss)};
  compareShare("expect.loss", whole, file.floats("expect.loss"), kShareOfLargest, report);
  for (const auto& [name, numbers] : seen) {
    compareShare(name, numbers, file.floats(name), kShareOfLargest, report);
  }
  for (const Parameter& parameter : layout.parameters()) {
    const std::string name = "grad.weights." + parameter.name;
    compareShare(name, std::span(gradients).subspan(parameter.first, parameter.count),
                 file.floats(name), kShareOfLargest, report);
  }
}

}  // namespace stipple
