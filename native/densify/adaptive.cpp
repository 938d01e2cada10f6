// Based on: Kerbl, Kopanas, Leimkuehler, Drettakis, 3D Gaussian Splatting for Real-Time Radiance
// Field Rendering, SIGGRAPH 2023, section 5.2, with the constants of its published fits. Differs:
// there is a hard cap of the count; large splats are judged by their size in the world alone, as
// the published program does in effect; short fits leave resets out; the last splat stays.

#include "densify/adaptive.h"

#include <algorithm>
#include <cmath>

#include "base/random.h"
#include "densify/gradient_window.h"
#include "math/quaternion.h"

namespace stipple {

namespace {

/// Three independent numbers of the standard normal distribution, for one child of a splat.
Vec3d childOffset(const FitMoment& moment, size_t row, uint64_t child) {
  const uint64_t seed = mixBits(moment.seed) ^ moment.iteration;
  const auto uniform = [&](uint64_t k) {
    return unitDouble(keyedBits(seed, RandomUse::kSplitOffset, (row * 2 + child) * 6 + k));
  };
  return {normalOf(uniform(0), uniform(1)), normalOf(uniform(2), uniform(3)),
          normalOf(uniform(4), uniform(5))};
}

float largestLogScale(const RawSplats& splats, size_t row) {
  const float* s = &splats.log_scales[row * 3];
  return std::max(s[0], std::max(s[1], s[2]));
}

enum class Fate : uint8_t { kStay, kCopy, kSplit, kGo };

class Adaptive final : public Strategy {
 public:
  explicit Adaptive(const AdaptiveOptions& options) : options_(options) {}

  const char* name() const override { return "adaptive"; }

  StatisticRequest requests(const FitMoment& moment) const override {
    StatisticRequest request;
    request.screen_gradients = isLearning(moment);
    return request;
  }

  void observe(const FitMoment& moment, const ViewStatistics& view) override {
    if (isLearning(moment)) window_.add(view);
  }

  std::optional<SplatEdit> edit(const FitMoment& moment, const SplatStore& store) override {
    if (!isLearning(moment) || store.splats.size() == 0) return {};
    const uint64_t interval =
        std::max(options_.least_interval, scaleSchedule(options_.interval, moment.iterations));
    const bool multiplies =
        moment.iteration > scaleSchedule(options_.first, moment.iterations) &&
        moment.iteration % interval == 0;
    const bool resets = resetIsDue(moment);
    if (!multiplies && !resets) return {};
    SplatEdit edit;
    if (multiplies) {
      multiply(moment, store.splats, edit);
      window_.reset(edit.countAfter(store.splats.size()));
    }
    if (resets) lowerOpacities(store.splats, edit);
    return edit;
  }

  TensorTable state() const override {
    TensorTable table;
    window_.put(table);
    return table;
  }
  void restore(const TensorTable& table) override { window_.take(table); }

 private:
  bool isLearning(const FitMoment& moment) const {
    return moment.iteration < scaleSchedule(options_.last, moment.iterations);
  }

  bool resetIsDue(const FitMoment& moment) const {
    const uint64_t interval = scaleSchedule(options_.reset_interval, moment.iterations);
    return interval >= options_.least_reset_steps && moment.iteration % interval == 0;
  }

  /// Scales in units of the extent are compared as logarithms; without an extent nothing is large.
  float logShare(const FitMoment& moment, double share) const {
    return moment.extent > 0 ? static_cast<float>(std::log(share * moment.extent)) : 88.0f;
  }

  void multiply(const FitMoment& moment, const RawSplats& splats, SplatEdit& edit) {
    if (window_.size() == 0) window_.reset(splats.size());
    const std::vector<Fate> fates = chooseFates(moment, splats);
    std::vector<uint32_t> stay, copied, split;
    for (uint32_t i = 0; i < splats.size(); ++i) {
      if (fates[i] == Fate::kStay || fates[i] == Fate::kCopy) stay.push_back(i);
      if (fates[i] == Fate::kCopy) copied.push_back(i);
      if (fates[i] == Fate::kSplit) split.push_back(i);
    }
    if (stay.size() < splats.size()) edit.keep = std::move(stay);
    // Copies, then the first child of every split splat, then the second.
    std::vector<uint32_t> parents = copied;
    for (int child = 0; child < 2; ++child) {
      parents.insert(parents.end(), split.begin(), split.end());
    }
    edit.append = rowsOf(splats, parents);
    for (size_t k = 0; k < 2 * split.size(); ++k) {
      const uint32_t parent = split[k % split.size()];
      placeChild(moment, splats, parent, k / split.size(), copied.size() + k, edit.append);
    }
  }

  /// What becomes of each splat. Faint splats and huge ones go; of the others, those that the views
  /// pull at multiply, as far as there is room, the strongest pull first.
  std::vector<Fate> chooseFates(const FitMoment& moment, const RawSplats& splats) const {
    const float least_logit = rawOpacity(static_cast<float>(options_.least_opacity));
    const float small = logShare(moment, options_.small_share);
    const bool judges_size =
        moment.iteration > scaleSchedule(options_.reset_interval, moment.iterations);
    const float huge = judges_size ? logShare(moment, options_.largest_share) : 88.0f;
    const float shrink = static_cast<float>(std::log(options_.split_shrink));
    const float threshold = static_cast<float>(options_.gradient_threshold);

    std::vector<Fate> fates(splats.size(), Fate::kStay);
    std::vector<uint32_t> candidates;
    size_t count = 0;  // that stay if none multiplies
    for (uint32_t i = 0; i < splats.size(); ++i) {
      const float size = largestLogScale(splats, i);
      const bool is_faint = splats.logits[i] < least_logit;
      if (is_faint || size > huge) fates[i] = Fate::kGo;
      if (fates[i] != Fate::kGo) ++count;
      // A huge splat may live on in children that are not.
      const bool has_a_future = !is_faint && size - shrink <= huge;
      if (has_a_future && window_.average(i) >= threshold) candidates.push_back(i);
    }
    if (moment.max_splats > 0) {
      std::stable_sort(candidates.begin(), candidates.end(), [&](uint32_t a, uint32_t b) {
        return window_.average(a) > window_.average(b);
      });
    }
    for (const uint32_t i : candidates) {
      const size_t added = fates[i] == Fate::kGo ? 2 : 1;
      if (moment.max_splats > 0 && count + added > moment.max_splats) continue;
      fates[i] = largestLogScale(splats, i) > small ? Fate::kSplit : Fate::kCopy;
      count += added;
    }
    if (count == 0) {
      // Without any splat a fit could never grow again.
      const auto best = std::max_element(splats.logits.begin(), splats.logits.end());
      fates[static_cast<size_t>(best - splats.logits.begin())] = Fate::kStay;
    }
    return fates;
  }

  /// A child stands at a random place of its parent's distribution, and is smaller.
  void placeChild(const FitMoment& moment, const RawSplats& splats, uint32_t parent, uint64_t child,
                  size_t row, RawSplats& children) const {
    const Mat3d turn = rotationFromQuaternion<double>(&splats.rotations[parent * size_t{4}]);
    Vec3d offset = childOffset(moment, parent, child);
    const float shrink = static_cast<float>(std::log(options_.split_shrink));
    for (int axis = 0; axis < 3; ++axis) {
      float& log_scale = children.log_scales[row * 3 + static_cast<size_t>(axis)];
      offset[axis] *= static_cast<double>(activatedScale(log_scale));
      log_scale -= shrink;
    }
    const Vec3d moved = turn * offset;
    for (int axis = 0; axis < 3; ++axis) {
      float& position = children.positions[row * 3 + static_cast<size_t>(axis)];
      const float place = static_cast<float>(static_cast<double>(position) + moved[axis]);
      if (std::isfinite(place)) position = place;
    }
  }

  void lowerOpacities(const RawSplats& splats, SplatEdit& edit) const {
    const float highest = rawOpacity(static_cast<float>(options_.reset_opacity));
    RowWrite write;
    write.array = RawArray::kLogits;
    write.clear_moments = true;
    write.rows.resize(splats.size());
    write.values.resize(splats.size());
    for (uint32_t i = 0; i < splats.size(); ++i) {
      write.rows[i] = i;
      write.values[i] = std::min(splats.logits[i], highest);
    }
    edit.writes.push_back(std::move(write));
    for (float& logit : edit.append.logits) logit = std::min(logit, highest);
  }

  AdaptiveOptions options_;
  GradientWindow window_{Statistic::kScreenGradients};
};

}  // namespace

std::unique_ptr<Strategy> makeAdaptive(const AdaptiveOptions& options) {
  return std::make_unique<Adaptive>(options);
}

}  // namespace stipple
