// Based on: Park, Ryu, Kim, DropGaussian: Structural Regularization for Sparse-view Gaussian
// Splatting, CVPR 2025, equations 5 to 7. Differs: the share goes by the number of views, where the
// paper has 0.2 for all.

#include "densify/parts/splat_dropout.h"

#include <algorithm>

#include "base/parallel.h"
#include "base/random.h"
#include "densify/strategies.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 14;

class SplatDropout final : public ControlPart {
 public:
  explicit SplatDropout(const SplatDropoutOptions& options) : options_(options) {}

  const char* name() const override { return "splat_dropout"; }
  ControlRoles owns() const override { return roles(ControlRole::kDropout); }

  std::vector<float> opacityFactors(const ControlMoment& moment, size_t count) const override {
    const double done = static_cast<double>(moment.iteration) /
                        static_cast<double>(std::max<uint64_t>(moment.iterations, 1));
    const double views = static_cast<double>(std::max<uint64_t>(moment.view_count, 1));
    const double last = std::min(options_.rate, options_.views / views);
    const double share = last * std::clamp(done, 0.0, 1.0);
    if (!(share > 0)) return {};
    std::vector<float> factors(count);
    const float more = static_cast<float>(1 / (1 - share));
    const uint64_t key = keyedBits(moment.seed, RandomUse::kDropout, moment.iteration);
    parallelFor(count, kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        factors[i] = unitDouble(mixBits(key ^ i)) < share ? 0.0f : more;
      }
    });
    return factors;
  }

 private:
  SplatDropoutOptions options_;
};

}  // namespace

std::unique_ptr<ControlPart> splatDropout(StrategySettings& settings) {
  SplatDropoutOptions options;
  options.rate = settings.number("rate", options.rate, 0, 0.9);
  options.views = settings.number("views", options.views, 0, 1e6);
  return makeSplatDropout(options);
}

std::unique_ptr<ControlPart> makeSplatDropout(const SplatDropoutOptions& options) {
  return std::make_unique<SplatDropout>(options);
}

}  // namespace stipple
