#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "density/contribution_normalisation.h"
#include "math/morton.h"
#include "network_golden/stages.h"
#include "train/networks/trained_octree.h"
#include "train/optimiser/weight_optimiser.h"

namespace stipple {
namespace {

// Goldens are in double, stored as float32. A run of theirs in float32 is off by 4e-6 of the
// largest number of a tensor; each of ours has fewer bits in its sums here and there.
constexpr double kShareOfLargest = 3e-5;
// The encoding of levels has seven frequencies of 128 whose last bit is another one in the golden,
// and their angles reach 1,600: numbers of order one are 5.4e-5 apart there, and so is what they
// are multiplied by.
constexpr double kShareOfEncoding = 1e-4;
// One formula of the optimiser after the other, twenty steps of float32.
constexpr double kShareOfSteps = 2e-6;

/// `share` of the largest of the expected numbers, wherever it is.
StageTolerance shareOfLargest(std::span<const float> expected, double share) {
  double largest = 0;
  for (const float value : expected) {
    largest = std::max(largest, std::abs(static_cast<double>(value)));
  }
  return {share * largest, 0};
}

void compareShare(const std::string& stage, std::span<const float> seen,
                  std::span<const float> expected, double share, StageReport& report) {
  report.compare(stage, seen, expected, shareOfLargest(expected, share));
}

std::vector<float> narrowed(std::span<const double> values) {
  return {values.begin(), values.end()};
}

NetworkShape shapeOf(const GoldenFile& file) {
  NetworkShape shape;
  shape.heads = file.config().at("heads").get<size_t>();
  shape.head_width = file.config().at("C").get<size_t>() / shape.heads;
  shape.latent_width = file.config().at("latent_channels").get<size_t>();
  shape.block_count = file.config().at("blocks").get<size_t>();
  return shape;
}

/// Rows of eight numbers of one level, which lie in the library's order of cells, in the file's.
std::vector<float> inOrderOf(const GoldenFile& file, const std::string& stem,
                             const OctreeLevel& level, std::span<const float> rows) {
  std::vector<float> made;
  const std::vector<int64_t> parents = file.integers(stem + ".parents");
  for (size_t i = 0; i < parents.size() / 3; ++i) {
    const uint64_t cell = mortonEncode(static_cast<uint32_t>(parents[i * 3]),
                                       static_cast<uint32_t>(parents[i * 3 + 1]),
                                       static_cast<uint32_t>(parents[i * 3 + 2]));
    const auto at = std::lower_bound(level.cells.begin(), level.cells.end(), cell);
    const auto row = static_cast<size_t>(at - level.cells.begin());
    made.insert(made.end(), rows.begin() + static_cast<long>(row * 8),
                rows.begin() + static_cast<long>(row * 8 + 8));
  }
  return made;
}

void compareGradients(const GoldenFile& file, const ParameterLayout& layout,
                      std::span<const float> gradients, StageReport& report) {
  for (const Parameter& parameter : layout.parameters()) {
    const std::string name = "grad.weights." + parameter.name;
    const bool is_encoded = parameter.name == "octree.l_embedder.mlp.0.weight";
    compareShare(name, gradients.subspan(parameter.first, parameter.count), file.floats(name),
                 is_encoded ? kShareOfEncoding : kShareOfLargest, report);
  }
}

/// The density gradient: from what anchors do to a loss to the weights and the latent.
void densityStages(const GoldenFile& file, StageReport& report) {
  if (!file.has("input.reward")) return;
  const int leaf_level = file.config().at("level").get<int>();
  ParameterLayout layout;
  const TrainedOctree octree(layout, "octree.", shapeOf(file));
  const std::vector<float> values = layout.read(file.weights());
  std::vector<float> gradients(layout.size(), 0.0f);
  const std::vector<float> latent = file.floats("input.latent"),
                           reward = file.floats("input.reward");
  const std::vector<int64_t> leaves = file.integers("input.leaf");
  const std::vector<uint64_t> shape = file.shape("input.latent");
  const size_t batch = shape.at(0), tokens = shape.at(1), anchors = reward.size() / batch;
  std::vector<float> latent_gradient(latent.size(), 0.0f), all_g, all_log_q;
  double surrogate = 0;
  for (size_t b = 0; b < batch; ++b) {
    std::vector<double> g(reward.begin() + static_cast<long>(b * anchors),
                          reward.begin() + static_cast<long>((b + 1) * anchors));
    normaliseContributions({.counts_neutral = true}, g);
    const std::vector<float> of_sample = narrowed(g);
    all_g.insert(all_g.end(), of_sample.begin(), of_sample.end());
    std::vector<uint64_t> codes;
    for (size_t i = b * anchors; i < (b + 1) * anchors; ++i) {
      codes.push_back(mortonEncode(static_cast<uint32_t>(leaves[i * 3]),
                                   static_cast<uint32_t>(leaves[i * 3 + 1]),
                                   static_cast<uint32_t>(leaves[i * 3 + 2])));
    }
    const std::vector<OctreeLevel> levels = levelsAbove(codes, leaf_level, g);
    TrainedOctree::Tape tape;
    const float* sample = &latent[b * tokens * shape.at(2)];
    const std::vector<float> logits = octree.forward(values, tokens, sample, levels, tape);
    std::vector<float> by_logits(logits.size());
    surrogate += weighLogProbabilities(levels, logits, 1.0, by_logits);
    octree.backward(values, tokens, sample, levels, tape, by_logits, gradients,
                    &latent_gradient[b * tokens * shape.at(2)]);
    size_t row = 0;
    for (const OctreeLevel& level : levels) {
      const std::string stem =
          "expect.s" + std::to_string(b) + ".level" + std::to_string(level.level + 1);
      const auto part = [&](std::span<const float> rows) {
        return inOrderOf(file, stem, level, rows.subspan(row * 8, level.cells.size() * 8));
      };
      compareShare(stem + ".logits", part(logits), file.floats(stem + ".logits"), kShareOfLargest,
                   report);
      compareShare("grad." + stem + ".logits", part(by_logits),
                   file.floats("grad." + stem + ".logits"), kShareOfLargest, report);
      row += level.cells.size();
    }
  }
  compareShare("g", all_g, file.floats("expect.g"), 1e-6, report);
  const std::vector<float> whole = {static_cast<float>(surrogate)};
  compareShare("surrogate", whole, file.floats("expect.surrogate"), kShareOfLargest, report);
  compareShare("grad.input.latent", latent_gradient, file.floats("grad.input.latent"),
               kShareOfLargest, report);
  compareGradients(file, layout, gradients, report);
}

WeightOptimiserOptions optionsOf(const nlohmann::json& run) {
  WeightOptimiserOptions options;
  options.learning_rate = run.at("lr").get<double>();
  options.beta1 = run.at("betas").at(0).get<double>();
  options.beta2 = run.at("betas").at(1).get<double>();
  options.epsilon = run.at("eps").get<double>();
  options.weight_decay = run.at("weight_decay").get<double>();
  options.warm_up = run.at("warmup").get<uint64_t>();
  options.total_steps = run.at("total_steps").get<uint64_t>();
  options.least_share = run.at("min_lr_ratio").get<double>();
  options.most_norm = run.at("max_norm").get<double>();
  options.mean_decay = run.at("ema").get<double>();
  options.clip_buffer = run.value("clip_buffer", uint64_t{0});
  options.clip_percentile = run.value("clip_percentile", 95.0);
  return options;
}

void optimiserRun(const GoldenFile& file, const std::string& name, const nlohmann::json& run,
                  StageReport& report) {
  const std::vector<std::string> letters = {"a", "b", "c"};
  std::vector<float> values;
  std::vector<size_t> counts;
  for (const std::string& letter : letters) {
    const std::vector<float> given = file.floats("input.param." + letter);
    values.insert(values.end(), given.begin(), given.end());
    counts.push_back(given.size());
  }
  const std::vector<float> start = values;
  WeightOptimiser optimiser(optionsOf(run), values);
  std::map<std::string, std::vector<float>> seen;
  const auto steps = file.config().at("steps").get<size_t>();
  for (size_t step = 0; step < steps; ++step) {
    std::vector<float> gradient;
    for (size_t i = 0; i < letters.size(); ++i) {
      const std::vector<float> all = file.floats("input.gradient." + letters[i]);
      gradient.insert(gradient.end(), all.begin() + static_cast<long>(step * counts[i]),
                      all.begin() + static_cast<long>((step + 1) * counts[i]));
    }
    const WeightStep done = optimiser.step(gradient, values);
    seen["lr"].push_back(static_cast<float>(done.learning_rate));
    seen["grad_norm"].push_back(static_cast<float>(done.gradient_norm));
    seen["max_norm"].push_back(static_cast<float>(done.most_norm));
    seen["clip_scale"].push_back(static_cast<float>(done.clip_scale));
    size_t first = 0;
    for (size_t i = 0; i < letters.size(); first += counts[i++]) {
      for (size_t k = first; k < first + counts[i]; ++k) {
        const double mean = optimiser.state().mean[k], from = static_cast<double>(start[k]);
        seen["param." + letters[i]].push_back(values[k]);
        seen["ema." + letters[i]].push_back(static_cast<float>(mean));
        seen["ema_delta." + letters[i]].push_back(static_cast<float>(mean - from));
      }
    }
  }
  size_t first = 0;
  for (size_t i = 0; i < letters.size(); first += counts[i++]) {
    const auto last = [&](const std::vector<float>& all) {
      return std::vector<float>(all.begin() + static_cast<long>(first),
                                all.begin() + static_cast<long>(first + counts[i]));
    };
    seen["m." + letters[i]] = last(optimiser.state().first);
    seen["v." + letters[i]] = last(optimiser.state().second);
  }
  for (const auto& [what, numbers] : seen) {
    const std::string stage = "expect." + name + "." + what;
    // A weight of order one keeps 6e-8 of itself, and the mean moves by 1e-4 of what it moved.
    const double share = what.starts_with("ema_delta") ? 1e-4 : kShareOfSteps;
    compareShare(stage, numbers, file.floats(stage), share, report);
  }
}

void optimiserStages(const GoldenFile& file, StageReport& report) {
  if (!file.has("input.schedule.step")) return;
  const nlohmann::json& schedule = file.config().at("schedule");
  for (const auto& [kind, least] : schedule.at("min_lr_ratio").items()) {
    WeightOptimiserOptions options;
    options.warm_up = schedule.at("warmup").get<uint64_t>();
    options.total_steps = schedule.at("total_steps").get<uint64_t>();
    options.least_share = least.get<double>();
    std::vector<float> shares;
    for (const int64_t step : file.integers("input.schedule.step")) {
      shares.push_back(static_cast<float>(rateShare(options, static_cast<uint64_t>(step))));
    }
    compareShare("schedule." + kind, shares, file.floats("expect.schedule." + kind), 1e-6, report);
  }
  for (const auto& [name, run] : file.config().at("runs").items()) {
    optimiserRun(file, name, run, report);
  }
}

}  // namespace

void trainingStages(const GoldenFile& file, StageReport& report) {
  densityStages(file, report);
  optimiserStages(file, report);
}

}  // namespace stipple
