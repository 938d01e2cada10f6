#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/random.h"
#include "data/tensor_table.h"
#include "densify/parts/splat_filter.h"
#include "densify/strategy.h"

namespace stipple {

/// When density control acts. Iterations are those of a fit of 30,000 (scaleSchedule).
struct EventSchedule {
  uint64_t first = 500;     ///< events are after this iteration
  uint64_t last = 15000;    ///< and before this one
  uint64_t interval = 100;  ///< iterations from one event to the next
  /// Steps from one event to the next at least, however short the fit: new splats must have taken
  /// their places, and views been seen, before statistics say where more are needed; else the count
  /// doubles with every event.
  uint64_t least_interval = 100;
};

/// Where a fit stands, as density control sees it.
struct ControlMoment : FitMoment {
  bool is_event = false;     ///< splats multiply and go in this iteration
  bool is_learning = false;  ///< events are still to come: statistics are worth gathering
  bool takes_steps = true;   ///< else what is lowered now does not come back
  double progress = 0;       ///< from the first event's window to its end, 0..1
  uint64_t event = 0;        ///< number of this event or the next one, from 0
  uint64_t event_count = 0;  ///< of the whole fit
  uint64_t interval = 100;   ///< iterations from one event to the next
  uint64_t until_event = 0;  ///< iterations to the next one; UINT64_MAX: there is none any more
  /// [N] where candidates are asked for: share of the threshold at which each splat multiplies,
  /// above 0; empty: 1.
  std::span<const float> threshold_shares = {};

  /// Whether this is what iteration `published` of a fit of 30,000 is here.
  bool isAt(uint64_t published) const { return iteration == scaleSchedule(published, iterations); }
  bool isAfter(uint64_t published) const {
    return iteration > scaleSchedule(published, iterations);
  }
};

/// Standalone events are spread over the window of the schedule; the last one has progress 1.
ControlMoment controlMoment(const FitMoment& moment, const EventSchedule& schedule);

/// Where the fit stands at the event that comes next, or this one.
ControlMoment momentOfEvent(const ControlMoment& moment, const EventSchedule& schedule);

/// Whether what this iteration's view tells counts for the next event: since the one before, and
/// within as many iterations as show every view at least once (train/loop/view_order.h).
bool isWindowOfViews(const ControlMoment& moment);

/// What a part of density control decides. No decision has two owners.
enum class ControlRole : uint32_t {
  kMultiplication = 1u << 0,     ///< which splats multiply
  kScore = 1u << 1,              ///< which of them go first where there is no room for all
  kChildren = 1u << 2,           ///< where their children are, and how large
  kChildOpacity = 1u << 3,       ///< how opaque they are
  kGrowth = 1u << 4,             ///< how many splats there may be
  kRemoval = 1u << 5,            ///< which splats go at an event
  kRecovery = 1u << 6,           ///< which splats go when opacities have come back from a reset
  kOpacity = 1u << 7,            ///< opacities that are lowered now and then
  kSteps = 1u << 8,              ///< in which iterations Adam steps
  kNoise = 1u << 9,              ///< what is added to numbers after a step
  kRegularisation = 1u << 10,    ///< what is added to the loss
  kParameterisation = 1u << 11,  ///< how raw numbers become splats
  kFilter = 1u << 12,            ///< what is done to splats after that, before they are drawn
  kSecondSplit = 1u << 13,       ///< which splats are split after that, children too
  kThreshold = 1u << 14,         ///< how little of a pull is enough to multiply, splat by splat
  kTime = 1u << 15,              ///< how time is stretched, of splats that move
  kDropout = 1u << 16,           ///< which splats the image of an iteration leaves out
};
/// Roles are bits 0 to this, without a gap.
constexpr uint32_t kControlRoleCount = 17;
using ControlRoles = uint32_t;
constexpr ControlRoles roles(ControlRole role) {
  return static_cast<ControlRoles>(role);
}
template <typename... More>
constexpr ControlRoles roles(ControlRole role, More... more) {
  return static_cast<ControlRoles>(role) | roles(more...);
}
/// In words, for messages: "the opacity of children".
const char* wordsOf(ControlRole role);

/// A splat that may multiply.
struct Candidate {
  uint32_t row = 0;
  float strength = 0;     ///< the greatest go first where nothing owns kScore
  bool replaces = false;  ///< two children instead of it, else a copy beside it
};

/// One decision, or several that belong together, of density control. A strategy is a list of parts
/// with a preset of their settings, and users add further ones; every class that decides something
/// is a part, and strategies.h has the one table of both. Hooks that have a role are called of its
/// owner alone, the others of all parts.
/// Determinism: answers depend on the calls and on FitMoment::seed alone, not on threads.
class ControlPart : public FitHooks<ControlMoment> {
 public:
  virtual ControlRoles owns() const = 0;
  /// Roles that other parts must own, or this one has nothing to do.
  virtual ControlRoles needs() const { return 0; }

  /// kFilter.
  virtual const SplatFilter* filter() const { return nullptr; }
  /// Every iteration: adds what it wants to `request`; pictures in it have one owner.
  virtual void request(const ControlMoment&, StatisticRequest&) const {}

  // ---- at an event -------------------------------------------------------------------------------
  /// kMultiplication without kChildren: who may multiply, rising rows, each once.
  virtual std::vector<Candidate> candidates(const ControlMoment&, const RawSplats&) { return {}; }
  /// The same: whether it goes by ControlMoment::threshold_shares.
  virtual bool heedsThresholds() const { return false; }
  /// kThreshold: those shares, [N] > 0.
  virtual std::vector<float> thresholdShares(const ControlMoment&, size_t count) {
    return std::vector<float>(count, 1.0f);
  }
  /// kScore: how much each candidate is worth, >= 0. As many as there is room for are drawn without
  /// replacement, by these weights; those of weight 0 are not.
  virtual std::vector<double> score(const ControlMoment&, const RawSplats&,
                                    std::span<const Candidate>) {
    return {};
  }
  /// kScore: copies and replacements get room in proportion to their numbers, before either is
  /// drawn.
  virtual bool drawsByKind() const { return false; }
  /// kChildren: what all of these become. Out: rows that are appended, copies first, in the order
  /// of their candidates; the rest in an order of the part's. The parents of those that are
  /// replaced go. A part that changes copies to replacements, or the other way round, says so in
  /// the candidates.
  virtual RawSplats children(const ControlMoment&, const RawSplats&, std::span<Candidate>) {
    return {};
  }
  /// kChildOpacity without kChildren: new logits of a parent and of its copy, or of two children
  /// that replace it.
  virtual float childLogit(float parent_logit) const { return parent_logit; }
  /// kChildOpacity: children that replace their parent keep its opacity.
  virtual bool changesCopiesAlone() const { return false; }
  /// kGrowth: how many splats there may be after this event, beside the hard cap.
  virtual uint64_t limit(const ControlMoment&, uint64_t /*count*/) { return UINT64_MAX; }
  /// kMultiplication with kChildren: the whole of it. In: room: splats that there may be at most.
  /// Out: writes and appended rows; keep where it removes. kRemoval applies to the result.
  virtual void multiply(const ControlMoment&, const SplatStore&, uint64_t /*room*/, SplatEdit&) {}

  /// kSecondSplit: splits what there is after multiplication. In: room: splats that there may be at
  /// most. Out: goes [N], 1 where a splat is replaced; appended rows, in any order.
  virtual void splitAgain(const ControlMoment&, const RawSplats& /*splats*/, uint64_t /*room*/,
                          std::span<uint8_t> /*goes*/, RawSplats& /*append*/) {}

  /// kRemoval, at an event, and kRecovery: whether it acts now.
  virtual bool removesAt(const ControlMoment& moment) const { return moment.is_event; }
  /// kRemoval and kRecovery. Out: goes [N] of splats, and [M] of the rows that are about to be
  /// appended; 1 where a splat goes, else left alone.
  virtual void remove(const ControlMoment&, const RawSplats& /*splats*/,
                      const RawSplats& /*appended*/, std::span<uint8_t> /*goes*/,
                      std::span<uint8_t> /*appended_goes*/) {}

  // ---- any iteration, after an event -------------------------------------------------------------
  /// kOpacity: whether it acts now.
  virtual bool lowersAt(const ControlMoment& moment) const { return moment.is_event; }
  /// kOpacity: adds writes of logits, and changes those of appended rows.
  virtual void lowerOpacities(const ControlMoment&, const RawSplats&, SplatEdit&) {}
  /// kOpacity: steps for which splats look like fog after it has acted now; 0: they do not.
  virtual uint64_t foggySteps(const ControlMoment&) const { return 0; }

  // ---- its own numbers ---------------------------------------------------------------------------
  /// After every edit: arrays per splat follow, and windows begin anew.
  virtual void edited(const ControlMoment&, const SplatEdit&, size_t /*count_before*/) {}
  /// [N] how much each splat asked to multiply at the last event, for looking at; empty where it
  /// does not tell.
  virtual std::vector<float> scores() const { return {}; }
  virtual void put(TensorTable&) const {}
  virtual void take(const TensorTable&) {}
};

/// Density control that is made of parts.
struct ControlAssembly {
  EventSchedule schedule;
  std::vector<std::unique_ptr<ControlPart>> parts;
};
/// Errors: kInvalidArgument where nobody owns what a part needs, or a part would never be asked:
/// the scores and opacities of children where multiplication is the whole of it.
std::unique_ptr<Strategy> makeDensityControl(const char* name, ControlAssembly assembly);

/// An assembly of one part: what a user adds to a strategy.
ControlAssembly assemblyOf(std::unique_ptr<ControlPart> part);

/// Puts a part into an assembly, in place of one whose roles it covers. Errors: kInvalidArgument
/// where a part there owns one of its roles and others beside; the message names both and the role.
void addPart(ControlAssembly& assembly, std::unique_ptr<ControlPart> part);

/// Errors: kInvalidArgument where both own one role; the message names both and the role.
void requireApart(const ControlPart& added, const ControlPart& there);

/// Array values [N, row_length] that follow an edit: rows of `keep`, then `fresh` for new ones.
void followEdit(const SplatEdit& edit, size_t row_length, float fresh, std::vector<float>& values);

/// The first `count` of a draw without replacement by weights, in rising order: keys E / w, E of
/// the exponential distribution, keyed by (seed, use, iteration, row). Weights of 0 are not drawn.
/// Source: Efraimidis, Spirakis, Weighted random sampling with a reservoir, IPL 2006.
std::vector<uint32_t> drawWithoutReplacement(const FitMoment& moment, RandomUse use,
                                             std::span<const uint32_t> rows,
                                             std::span<const double> weights, size_t count);

/// `count` draws with replacement by weights, in the order of drawing: indices of weights, none of
/// weight 0. Keyed by (seed, use, iteration, first + number of the draw). No draws where every
/// weight is 0.
std::vector<uint32_t> drawWithReplacement(const FitMoment& moment, RandomUse use, uint64_t first,
                                          std::span<const double> weights, size_t count);

}  // namespace stipple
