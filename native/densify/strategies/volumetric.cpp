// Based on: Gafoor, Preda, Zaharia, Volumetric densification of 3D Gaussians, arXiv 2508.05187,
// equations 5 to 7, in logarithms: no determinant cancels and no quotient overflows. Differs: the
// threshold is in units of the cameras' extent (published_unit.h), as the publication finds that it
// depends on the scale; the shrink is held between two ends; children are two, placed as adaptive
// control places them, of which the publication says nothing.

#include "densify/strategies/volumetric.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "base/error.h"
#include "densify/published_unit.h"
#include "densify/strategies.h"

namespace stipple {

namespace {

constexpr double kPi = 3.141592653589793;

double logProduct(const RawSplats& splats, size_t row) {
  const float* s = &splats.log_scales[row * 3];
  return static_cast<double>(s[0]) + static_cast<double>(s[1]) + static_cast<double>(s[2]);
}

/// A splat that is large: of the fit, or one that is about to be appended.
struct Large {
  double log_product;
  bool is_appended;
  uint32_t row;
};

class VolumeSplit final : public ControlPart {
 public:
  explicit VolumeSplit(const VolumeSplitOptions& options) : options_(options) {}

  const char* name() const override { return "volume_split"; }
  ControlRoles owns() const override { return roles(ControlRole::kSecondSplit); }

  void splitAgain(const ControlMoment& moment, const RawSplats& splats, uint64_t room,
                  std::span<uint8_t> goes, RawSplats& append) override {
    if (!(moment.extent > 0)) return;
    std::vector<Large> found = largeOnes(moment, splats, goes, append);
    const uint64_t count =
        static_cast<uint64_t>(std::count(goes.begin(), goes.end(), 0)) + append.size();
    keepLargest(found, std::min(room, options_.most_splats), count);
    replace(moment, splats, found, goes, append);
  }

 private:
  std::vector<Large> largeOnes(const ControlMoment& moment, const RawSplats& splats,
                               std::span<const uint8_t> goes, const RawSplats& append) const {
    // (4/3) pi s0 s1 s2 > volume.
    const double least =
        std::log(options_.volume * 3 / (4 * kPi)) + 3 * std::log(publishedUnit(moment));
    std::vector<Large> found;
    for (uint32_t i = 0; i < splats.size(); ++i) {
      const double log_product = logProduct(splats, i);
      if (!goes[i] && log_product > least) found.push_back({log_product, false, i});
    }
    for (uint32_t k = 0; k < append.size(); ++k) {
      const double log_product = logProduct(append, k);
      if (log_product > least) found.push_back({log_product, true, k});
    }
    return found;
  }

  /// Each brings one more; ties go to the first.
  static void keepLargest(std::vector<Large>& found, uint64_t room, uint64_t count) {
    const uint64_t most = room > count ? room - count : 0;
    if (found.size() <= most) return;
    std::stable_sort(found.begin(), found.end(),
                     [](const Large& a, const Large& b) { return a.log_product > b.log_product; });
    found.resize(static_cast<size_t>(most));
  }

  float logShrink(const float* s) const {
    const auto [least, most] = std::minmax({s[0], s[1], s[2]});
    const double elongation = static_cast<double>(most) - static_cast<double>(least);
    return static_cast<float>(std::clamp(2 * options_.exponent * elongation,
                                         std::log(options_.least_shrink),
                                         std::log(options_.largest_shrink)));
  }

  void replace(const ControlMoment& moment, const RawSplats& splats,
               const std::vector<Large>& found, std::span<uint8_t> goes, RawSplats& append) const {
    if (found.empty()) return;
    std::vector<uint8_t> appended_goes(append.size(), 0);
    std::array<std::vector<uint32_t>, 2> parents;  // of the fit, and appended ones
    for (const Large& one : found) {
      (one.is_appended ? appended_goes[one.row] : goes[one.row]) = 1;
      parents[one.is_appended ? 1 : 0].push_back(one.row);
    }
    std::vector<uint32_t> staying;
    for (uint32_t k = 0; k < appended_goes.size(); ++k) {
      if (!appended_goes[k]) staying.push_back(k);
    }
    SplatEdit gather;  // appends both kinds to what stays
    RawSplats result = append.size() > 0 ? rowsOf(append, staying) : rowsOf(splats, {});
    const EditTarget target{&result, false};
    for (size_t kind = 0; kind < 2; ++kind) {
      if (parents[kind].empty()) continue;
      gather.append = childrenOf(moment, kind == 0 ? splats : append, parents[kind],
                                 kind == 0 ? 0 : splats.size());
      applyEdit(gather, {&target, 1});
    }
    append = std::move(result);
  }

  /// In: first_key: keeps the random numbers of appended parents apart from those of the fit's.
  RawSplats childrenOf(const ControlMoment& moment, const RawSplats& from,
                       std::vector<uint32_t> parents, size_t first_key) const {
    std::sort(parents.begin(), parents.end());
    std::vector<uint32_t> twice;
    for (const uint32_t row : parents) twice.insert(twice.end(), 2, row);
    RawSplats children = rowsOf(from, twice);
    for (size_t k = 0; k < twice.size(); ++k) {
      float* scales = &children.log_scales[k * 3];
      const float shrink = logShrink(scales);
      // Children 0 and 1 of a splat belong to other parts.
      const uint64_t key = first_key + twice[k];
      placeInDistribution(moment, static_cast<uint32_t>(key), kFirstChild + k % 2, k, children);
      for (int axis = 0; axis < 3; ++axis) scales[axis] -= shrink;
    }
    return children;
  }

  /// placeInDistribution() counts two children of a row; these are of rows that no splat has.
  static constexpr uint64_t kFirstChild = uint64_t{1} << 40;

  VolumeSplitOptions options_;
};

}  // namespace

std::unique_ptr<ControlPart> makeVolumeSplit(const VolumeSplitOptions& options) {
  return std::make_unique<VolumeSplit>(options);
}

std::unique_ptr<ControlPart> volumeSplit(StrategySettings& settings) {
  VolumeSplitOptions options;
  options.volume = settings.number("volume", options.volume, 1e-30, 1e30);
  options.exponent = settings.number("exponent", options.exponent, 0.5, 1);
  if (options.exponent != 0.5 && options.exponent != 1) {
    fail(ErrorCode::kInvalidArgument,
         "exponent is " + std::to_string(options.exponent) + "; 0.5 and 1 are allowed");
  }
  options.least_shrink = settings.number("least_shrink", options.least_shrink, 1, 1000);
  options.largest_shrink =
      settings.number("largest_shrink", std::max(options.largest_shrink, options.least_shrink),
                      options.least_shrink, 1e6);
  options.most_splats = settings.count("cap", options.most_splats);
  return makeVolumeSplit(options);
}

ControlAssembly volumetricControl(const VolumetricOptions& options) {
  ControlAssembly assembly = adaptiveControl(options.adaptive);
  addPart(assembly, makeVolumeSplit(options.split));
  return assembly;
}

ControlAssembly volumetricControl(StrategySettings& settings) {
  AdaptiveOptions options;
  const double threshold = settings.number("threshold", options.pull.copy_threshold, 1e-9, 1e9);
  options.pull.copy_threshold = options.pull.split_threshold = threshold;
  ControlAssembly assembly = adaptiveControl(options);
  addPart(assembly, volumeSplit(settings));
  return assembly;
}

}  // namespace stipple
