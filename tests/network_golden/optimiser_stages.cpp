#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "network_golden/compare_share.h"
#include "network_golden/stages.h"
#include "train/optimiser/weight_optimiser.h"

namespace stipple {
namespace {

// One formula of the optimiser after the other, twenty steps of float32.
constexpr double kShareOfSteps = 2e-6;

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

}  // namespace

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

}  // namespace stipple
