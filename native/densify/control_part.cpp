#include "densify/control_part.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "base/error.h"

namespace stipple {

namespace {

/// A standalone event stands where an event of a whole fit would.
ControlMoment standaloneMoment(const FitMoment& moment, const EventSchedule& schedule) {
  const StandaloneEvent& given = *moment.standalone;
  ControlMoment at;
  static_cast<FitMoment&>(at) = moment;
  at.iterations = FitMoment{}.iterations;
  at.iteration =
      schedule.first + (schedule.last - schedule.first) * (given.index + 1) / (given.count + 1);
  at.is_event = given.is_now;
  at.is_learning = true;
  at.takes_steps = false;
  at.progress = static_cast<double>(given.index + 1) / static_cast<double>(given.count);
  at.event = given.index;
  at.event_count = given.count;
  at.until_event = given.is_now ? 0 : given.looks_left;
  return at;
}

}  // namespace

ControlMoment controlMoment(const FitMoment& moment, const EventSchedule& schedule) {
  if (moment.standalone) return standaloneMoment(moment, schedule);
  ControlMoment at;
  static_cast<FitMoment&>(at) = moment;
  const uint64_t first = scaleSchedule(schedule.first, moment.iterations);
  const uint64_t last = scaleSchedule(schedule.last, moment.iterations);
  const uint64_t interval =
      std::max(schedule.least_interval, scaleSchedule(schedule.interval, moment.iterations));
  at.is_learning = moment.iteration < last;
  at.is_event = at.is_learning && moment.iteration > first && moment.iteration % interval == 0;
  const uint64_t before = first / interval;  // multiples of the interval up to the first event
  const uint64_t passed = moment.iteration == 0 ? 0 : (moment.iteration - 1) / interval;
  at.event = passed > before ? passed - before : 0;
  at.event_count = last > first ? (last - 1) / interval - before : 0;
  at.interval = interval;
  const uint64_t next = (before + at.event + 1) * interval;
  at.until_event = next < last ? next - moment.iteration : UINT64_MAX;
  at.progress = last > first && moment.iteration > first
                    ? std::min(1.0, static_cast<double>(moment.iteration - first) /
                                        static_cast<double>(last - first))
                    : 0.0;
  return at;
}

double ViewErrors::differenceAt(size_t pixel) const {
  double sum = 0;
  for (size_t c = 0; c < 3; ++c) {
    sum += std::abs(static_cast<double>(picture[pixel * 4 + c]) -
                    static_cast<double>(target[pixel * 3 + c]));
  }
  return sum / 3 * (weights.empty() ? 1.0 : static_cast<double>(weights[pixel]));
}

ControlMoment momentOfEvent(const ControlMoment& moment, const EventSchedule& schedule) {
  if (moment.standalone || moment.until_event == UINT64_MAX) return moment;
  FitMoment event = moment;
  event.iteration += moment.until_event;
  return controlMoment(event, schedule);
}

bool isWindowOfViews(const ControlMoment& moment) {
  if (moment.until_event == UINT64_MAX) return false;
  if (moment.standalone || moment.view_count == 0) return true;
  const uint64_t round = uint64_t{2} * moment.view_count - 1;
  return moment.until_event < std::min(moment.interval, round);
}

const char* wordsOf(ControlRole role) {
  switch (role) {
    case ControlRole::kMultiplication:
      return "which splats multiply";
    case ControlRole::kScore:
      return "which splats multiply first";
    case ControlRole::kChildren:
      return "where children are";
    case ControlRole::kChildOpacity:
      return "the opacity of children";
    case ControlRole::kGrowth:
      return "how many splats there may be";
    case ControlRole::kRemoval:
      return "which splats go";
    case ControlRole::kRecovery:
      return "which splats go after a reset";
    case ControlRole::kOpacity:
      return "when opacities are lowered";
    case ControlRole::kSteps:
      return "when a step is taken";
    case ControlRole::kNoise:
      return "what is added after a step";
    case ControlRole::kRegularisation:
      return "what is added to the loss";
    case ControlRole::kParameterisation:
      return "how numbers become splats";
    case ControlRole::kFilter:
      return "how splats are filtered";
    case ControlRole::kSecondSplit:
      return "which splats are split once more";
    case ControlRole::kThreshold:
      return "how strong a pull must be";
    case ControlRole::kTime:
      return "how time is stretched";
    case ControlRole::kDropout:
      return "which splats an image leaves out";
  }
  return "";
}

void requireApart(const ControlPart& added, const ControlPart& there) {
  const ControlRoles shared = there.owns() & added.owns();
  if (shared == 0) return;
  const ControlRole role = static_cast<ControlRole>(shared & (~shared + 1));
  fail(ErrorCode::kInvalidArgument, std::string(added.name()) + " does not go with " +
                                        there.name() + ": both decide " + wordsOf(role));
}

ControlAssembly assemblyOf(std::unique_ptr<ControlPart> part) {
  ControlAssembly assembly;
  assembly.parts.push_back(std::move(part));
  return assembly;
}

void addPart(ControlAssembly& assembly, std::unique_ptr<ControlPart> part) {
  const ControlRoles added = part->owns();
  std::erase_if(assembly.parts, [&](const std::unique_ptr<ControlPart>& there) {
    return there->owns() != 0 && (there->owns() & ~added) == 0;
  });
  for (const std::unique_ptr<ControlPart>& there : assembly.parts) {
    requireApart(*part, *there);
  }
  assembly.parts.push_back(std::move(part));
}

void followEdit(const SplatEdit& edit, size_t row_length, float fresh, std::vector<float>& values) {
  if (edit.keep) {
    std::vector<float> kept(edit.keep->size() * row_length);
    for (size_t k = 0; k < edit.keep->size(); ++k) {
      const size_t row = (*edit.keep)[k];
      std::copy_n(&values[row * row_length], row_length, &kept[k * row_length]);
    }
    values = std::move(kept);
  }
  values.resize(values.size() + edit.append.size() * row_length, fresh);
}

std::vector<uint32_t> drawWithoutReplacement(const FitMoment& moment, RandomUse use,
                                             std::span<const uint32_t> rows,
                                             std::span<const double> weights, size_t count) {
  struct Key {
    double value;
    uint32_t row;
  };
  std::vector<Key> keys;
  keys.reserve(rows.size());
  const uint64_t seed = mixBits(moment.seed) ^ moment.iteration;
  for (size_t k = 0; k < rows.size(); ++k) {
    if (!(weights[k] > 0)) continue;
    const double exponential = -std::log1p(-unitDouble(keyedBits(seed, use, rows[k])));
    keys.push_back({exponential / weights[k], rows[k]});
  }
  const size_t drawn = std::min(count, keys.size());
  const auto smaller = [](const Key& a, const Key& b) {
    return a.value < b.value || (a.value == b.value && a.row < b.row);
  };
  std::partial_sort(keys.begin(), keys.begin() + static_cast<ptrdiff_t>(drawn), keys.end(),
                    smaller);
  std::vector<uint32_t> chosen(drawn);
  for (size_t k = 0; k < drawn; ++k) chosen[k] = keys[k].row;
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

std::vector<uint32_t> drawWithReplacement(const FitMoment& moment, RandomUse use, uint64_t first,
                                          std::span<const double> weights, size_t count) {
  std::vector<double> sums(weights.size());
  double sum = 0;
  uint32_t last = 0;  // of a positive weight: where rounding leads past the end
  for (size_t i = 0; i < weights.size(); ++i) {
    if (weights[i] > 0) {
      sum += weights[i];
      last = static_cast<uint32_t>(i);
    }
    sums[i] = sum;
  }
  if (!(sum > 0)) return {};
  const uint64_t seed = mixBits(moment.seed) ^ moment.iteration;
  std::vector<uint32_t> drawn(count);
  for (size_t k = 0; k < count; ++k) {
    const double place = sum * unitDouble(keyedBits(seed, use, first + k));
    const auto found = std::upper_bound(sums.begin(), sums.end(), place);
    drawn[k] = found == sums.end() ? last : static_cast<uint32_t>(found - sums.begin());
  }
  return drawn;
}

}  // namespace stipple
