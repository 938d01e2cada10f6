// Based on: Deng, Diao, Li, Yu, Xu, Improving Densification in 3D Gaussian Splatting for
// High-Fidelity Rendering, arXiv 2508.12313, section 3.3. Differs: an exact number of splats goes,
// not those below a quantile, below which ties leave none or take all.

#include "densify/parts/recovery_pruning.h"

#include <algorithm>

#include "base/random.h"

namespace stipple {

namespace {

class RecoveryPruning final : public ControlPart {
 public:
  explicit RecoveryPruning(const RecoveryPruningOptions& options) : options_(options) {}

  const char* name() const override { return "recovery_pruning"; }
  ControlRoles owns() const override { return roles(ControlRole::kRecovery); }
  ControlRoles needs() const override { return roles(ControlRole::kOpacity); }

  bool removesAt(const ControlMoment& moment) const override {
    return recoversWithin(moment.iteration, moment.iteration + 1, moment.iterations, options_);
  }

  void remove(const ControlMoment& moment, const RawSplats& splats, const RawSplats& appended,
              std::span<uint8_t> goes, std::span<uint8_t> appended_goes) override {
    struct One {
      float logit;
      uint64_t die;  ///< among equals: rows lie in the order of the scene, and none shall empty
      size_t place;
    };
    std::vector<One> staying;
    const uint64_t seed = mixBits(moment.seed) ^ moment.iteration;
    const auto take = [&](const RawSplats& from, std::span<const uint8_t> going, size_t first) {
      for (size_t i = 0; i < going.size(); ++i) {
        if (going[i]) continue;
        const uint64_t die = keyedBits(seed, RandomUse::kRemovalChoice, first + i);
        staying.push_back({from.logits[i], die, first + i});
      }
    };
    take(splats, goes, 0);
    take(appended, appended_goes, goes.size());
    const size_t count = static_cast<size_t>(options_.share * static_cast<double>(staying.size()));
    if (count == 0) return;
    std::nth_element(staying.begin(), staying.begin() + static_cast<ptrdiff_t>(count - 1),
                     staying.end(), [](const One& a, const One& b) {
                       return a.logit < b.logit || (a.logit == b.logit && a.die < b.die);
                     });
    for (size_t k = 0; k < count; ++k) {
      const size_t place = staying[k].place;
      (place < goes.size() ? goes[place] : appended_goes[place - goes.size()]) = 1;
    }
  }

 private:
  RecoveryPruningOptions options_;
};

}  // namespace

bool recoversWithin(uint64_t begin, uint64_t end, uint64_t iterations,
                    const RecoveryPruningOptions& options) {
  const uint64_t reset = scaleSchedule(options.reset_interval, iterations);
  if (reset < options.least_reset_interval) return false;
  const uint64_t delay = std::max(options.least_delay, scaleSchedule(options.delay, iterations));
  for (uint64_t k = 1; k <= options.times; ++k) {
    if (k * reset + delay >= begin && k * reset + delay < end) return true;
  }
  return false;
}

std::unique_ptr<ControlPart> makeRecoveryPruning(const RecoveryPruningOptions& options) {
  return std::make_unique<RecoveryPruning>(options);
}

}  // namespace stipple
