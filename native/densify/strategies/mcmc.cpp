// Based on: Kheradmand, Rebain, Sharma, Sun, Tseng, Isack, Kar, Tagliasacchi, Yi, 3D Gaussian
// Splatting as Markov Chain Monte Carlo, NeurIPS 2024, with the constants of its published fits.
// The gate of the noise falls with opacity, as in its program; the sign of its equation 8 is a
// misprint. Differs: lengths count in units of the cameras' extent (published_unit.h); noise that
// could not move a splat by a millionth of its size is left out; events of short fits bring as many
// splats as those that they stand for, and their splats begin less small.

#include "densify/strategies/mcmc.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/parallel.h"
#include "base/random.h"
#include "densify/parts/relocation.h"
#include "densify/published_unit.h"
#include "densify/strategies.h"
#include "math/covariance.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 12;
constexpr double kPublishedIterations = 30000;

class OpacityRelocation final : public ControlPart {
 public:
  explicit OpacityRelocation(const McmcOptions& options) : options_(options) {}

  const char* name() const override { return "opacity_relocation"; }
  ControlRoles owns() const override {
    return roles(ControlRole::kMultiplication, ControlRole::kScore, ControlRole::kChildren,
                 ControlRole::kChildOpacity, ControlRole::kRecovery);
  }

  void prepare(RawSplats& splats, uint64_t iterations) const override {
    // Splats grow back at a rate that no schedule changes: 460 steps for a tenth of their size at
    // best. So the way back is as long a part of a short fit as of a published one.
    const double share = std::min(1.0, static_cast<double>(iterations) / kPublishedIterations);
    const float log_change = static_cast<float>(share * std::log(options_.start_scale));
    for (float& log_scale : splats.log_scales) log_scale += log_change;
    std::fill(splats.logits.begin(), splats.logits.end(),
              rawOpacity(static_cast<float>(options_.start_opacity)));
  }

  bool removesAt(const ControlMoment&) const override { return false; }

  void multiply(const ControlMoment& moment, const SplatStore& store, uint64_t room,
                SplatEdit& edit) override {
    const size_t count = store.size();
    RelocatedSplats splats(store.splats());
    splats.moveDead(moment, options_.dead_opacity);
    if (room != UINT64_MAX && room > count) {
      splats.appendCopies(moment, static_cast<size_t>(room - count), edit.append);
    }
    splats.write(edit);
    draws_.assign(splats.drawCounts().begin(), splats.drawCounts().end());
  }

  void edited(const ControlMoment&, const SplatEdit& edit, size_t count_before) override {
    if (draws_.size() == count_before) followEdit(edit, 1, 0.0f, draws_);
  }

  /// How often it was drawn at the last event.
  std::vector<float> scores() const override { return draws_; }

 private:
  McmcOptions options_;
  std::vector<float> draws_;  ///< [N]
};

class SteadyGrowth final : public ControlPart {
 public:
  SteadyGrowth(const EventSchedule& schedule, double growth, uint64_t most_splats)
      : schedule_(schedule), growth_(growth), most_splats_(most_splats) {}

  const char* name() const override { return "steady_growth"; }
  ControlRoles owns() const override { return roles(ControlRole::kGrowth); }

  uint64_t limit(const ControlMoment& moment, uint64_t count) override {
    const uint64_t interval =
        std::max(schedule_.least_interval, scaleSchedule(schedule_.interval, moment.iterations));
    const double published = static_cast<double>(interval) * kPublishedIterations /
                             static_cast<double>(std::max<uint64_t>(1, moment.iterations));
    const double stood_for = std::max(1.0, published / static_cast<double>(schedule_.interval));
    const double wanted = std::floor(static_cast<double>(count) * std::pow(1 + growth_, stood_for));
    // A fit of few splats would never grow by whole ones.
    const double target = std::max(wanted, static_cast<double>(count + 1));
    return target < static_cast<double>(most_splats_) ? static_cast<uint64_t>(target)
                                                      : most_splats_;
  }

 private:
  EventSchedule schedule_;
  double growth_;
  uint64_t most_splats_;
};

/// Three independent numbers of the standard normal distribution.
Vec3d trembling(uint64_t seed, size_t row) {
  const auto uniform = [&](uint64_t k) {
    return unitDouble(keyedBits(seed, RandomUse::kSplatNoise, row * 6 + k));
  };
  return {normalOf(uniform(0), uniform(1)), normalOf(uniform(2), uniform(3)),
          normalOf(uniform(4), uniform(5))};
}

class PositionNoise final : public ControlPart {
 public:
  explicit PositionNoise(double noise) : noise_(noise) {}

  const char* name() const override { return "position_noise"; }
  ControlRoles owns() const override { return roles(ControlRole::kNoise); }

  std::optional<SplatEdit> afterStep(const ControlMoment& moment,
                                     const SplatStore& store) override {
    const double unit = publishedUnit(moment);
    // Covariance times rate is a length to the third power: both in published units.
    const double strength = noise_ * moment.position_rate / (unit * unit);
    if (!(strength > 0)) return {};
    const RawSplats& splats = store.splats();
    const uint64_t seed = mixBits(moment.seed) ^ moment.iteration;
    const size_t ranges = rangeCount(splats.size(), kGrain);
    std::vector<RowWrite> writes(ranges);
    parallelFor(splats.size(), kGrain, [&](size_t begin, size_t end) {
      RowWrite& write = writes[begin / kGrain];
      for (size_t i = begin; i < end; ++i) tremble(splats, i, strength, seed, write);
    });
    RowWrite all;
    all.array = RawArray::kPositions;
    for (const RowWrite& write : writes) {
      all.rows.insert(all.rows.end(), write.rows.begin(), write.rows.end());
      all.values.insert(all.values.end(), write.values.begin(), write.values.end());
    }
    if (all.rows.empty()) return {};
    SplatEdit edit;
    edit.writes.push_back(std::move(all));
    return edit;
  }

 private:
  /// 1 / (1 + exp(100 (o - 0.005))): half for a splat that is about to count as dead.
  static double gate(float logit) {
    constexpr double kSharpness = 100, kMiddle = 0.005;
    const double opacity = static_cast<double>(activatedOpacity(logit));
    return 1 / (1 + std::exp(kSharpness * (opacity - kMiddle)));
  }

  static void tremble(const RawSplats& splats, size_t row, double strength, uint64_t seed,
                      RowWrite& write) {
    const float* logs = &splats.log_scales[row * 3];
    const float scales[3] = {activatedScale(logs[0]), activatedScale(logs[1]),
                             activatedScale(logs[2])};
    const double largest = static_cast<double>(std::max(scales[0], std::max(scales[1], scales[2])));
    const double gated = strength * gate(splats.logits[row]);
    constexpr double kNotice = 1e-6;  // of its own size
    if (!(largest * gated > kNotice)) return;
    const Mat3d axes = scaledAxes<double>(&splats.rotations[row * 4], scales);
    const Vec3d move = gated * (axes * (axes.transpose() * trembling(seed, row)));
    float place[3];
    for (int axis = 0; axis < 3; ++axis) {
      constexpr double kFar = 1e30;  // metres; what goes further stays
      const double moved =
          static_cast<double>(splats.positions[row * 3 + static_cast<size_t>(axis)]) + move[axis];
      if (!(std::abs(moved) < kFar)) return;
      place[axis] = static_cast<float>(moved);
    }
    write.rows.push_back(static_cast<uint32_t>(row));
    write.values.insert(write.values.end(), place, place + 3);
  }

  double noise_;
};

}  // namespace

std::unique_ptr<ControlPart> makeSteadyGrowth(const EventSchedule& schedule, double growth,
                                              uint64_t most_splats) {
  return std::make_unique<SteadyGrowth>(schedule, growth, most_splats);
}

std::unique_ptr<ControlPart> makePositionNoise(double noise) {
  return std::make_unique<PositionNoise>(noise);
}

ControlAssembly mcmcControl(const McmcOptions& options) {
  ControlAssembly assembly;
  assembly.schedule = options.schedule;
  addPart(assembly, std::make_unique<OpacityRelocation>(options));
  addPart(assembly, makeSteadyGrowth(options.schedule, options.growth, options.most_splats));
  addPart(assembly, makePositionNoise(options.noise));
  addPart(assembly, makeSizeRegulariser(options.regulariser));
  return assembly;
}

ControlAssembly mcmcControl(StrategySettings& settings) {
  McmcOptions options;
  options.most_splats = std::max<uint64_t>(1, settings.count("cap", options.most_splats));
  options.growth = settings.number("growth", options.growth, 0, 10);
  options.noise = settings.number("noise", options.noise, 0, 1e12);
  options.regulariser.opacity_weight =
      settings.number("opacity_weight", options.regulariser.opacity_weight, 0, 1e3);
  options.regulariser.scale_weight =
      settings.number("scale_weight", options.regulariser.scale_weight, 0, 1e3);
  return mcmcControl(options);
}

}  // namespace stipple
