// Based on: Kheradmand, Rebain, Sharma, Sun, Tseng, Isack, Kar, Tagliasacchi, Yi, 3D Gaussian
// Splatting as Markov Chain Monte Carlo, NeurIPS 2024, section 3.4, with means as in its program.
// Differs: scales count in units of the cameras' extent (published_unit.h).

#include "densify/parts/size_regulariser.h"

#include <functional>

#include "base/parallel.h"
#include "densify/published_unit.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 14;

/// Mean of `values`; adds the derivative of weight times the mean to `gradient`.
double addMean(std::span<const float> values, double weight, std::span<float> gradient) {
  if (values.empty()) return 0;
  const double count = static_cast<double>(values.size());
  const float slope = static_cast<float>(weight / count);
  std::vector<double> sums(rangeCount(values.size(), kGrain), 0.0);
  const auto add_range = [&](size_t begin, size_t end) {
    double sum = 0;
    for (size_t i = begin; i < end; ++i) {
      sum += static_cast<double>(values[i]);
      gradient[i] += slope;
    }
    sums[begin / kGrain] = sum;
  };
  // By reference: a std::function of a large capture allocates.
  parallelFor(values.size(), kGrain, std::cref(add_range));
  double total = 0;
  for (const double sum : sums) total += sum;
  return weight * total / count;
}

class SizeRegulariser final : public ControlPart {
 public:
  explicit SizeRegulariser(const SizeRegulariserOptions& options) : options_(options) {}

  const char* name() const override { return "size_regulariser"; }
  ControlRoles owns() const override { return roles(ControlRole::kRegularisation); }

  bool regularises(const ControlMoment&) const override { return true; }
  double loss(const ControlMoment& moment, const SplatCloud& cloud,
              const CloudGradient& gradient) override {
    const double per_metre = options_.scale_weight / publishedUnit(moment);
    return addMean(cloud.opacities, options_.opacity_weight, gradient.opacities) +
           addMean(cloud.scales, per_metre, gradient.scales);
  }

 private:
  SizeRegulariserOptions options_;
};

}  // namespace

std::unique_ptr<ControlPart> makeSizeRegulariser(const SizeRegulariserOptions& options) {
  return std::make_unique<SizeRegulariser>(options);
}

}  // namespace stipple
