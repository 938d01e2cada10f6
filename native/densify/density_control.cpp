#include <algorithm>
#include <numeric>
#include <string>
#include <utility>

#include "base/error.h"
#include "densify/control_part.h"
#include "densify/state_arrays.h"

namespace stipple {

namespace {

/// Rows of `splats` where `goes` is 0.
std::vector<uint32_t> staying(std::span<const uint8_t> goes) {
  std::vector<uint32_t> rows;
  for (uint32_t i = 0; i < goes.size(); ++i) {
    if (!goes[i]) rows.push_back(i);
  }
  return rows;
}

/// Refuses thresholds that nobody goes by.
void requireHeed(const ControlPart& part, const ControlAssembly& assembly) {
  for (const auto& other : assembly.parts) {
    const bool multiplies = other->owns() & roles(ControlRole::kMultiplication);
    if (!multiplies || other->heedsThresholds()) continue;
    fail(ErrorCode::kInvalidArgument, std::string(part.name()) + " does not go with " +
                                          other->name() + ", which decides without a threshold");
  }
}

/// Refuses parts that nobody would ask.
void requireUse(const char* name, const ControlAssembly& assembly) {
  constexpr ControlRoles kWhole = roles(ControlRole::kMultiplication, ControlRole::kChildren);
  constexpr ControlRoles kOfIt = roles(ControlRole::kScore, ControlRole::kChildOpacity);
  ControlRoles owned = 0;
  for (const auto& part : assembly.parts) owned |= part->owns();
  for (const auto& part : assembly.parts) {
    for (uint32_t bit = 0; bit < kControlRoleCount; ++bit) {
      const ControlRole role = static_cast<ControlRole>(1u << bit);
      if (part->needs() & ~owned & roles(role)) {
        fail(ErrorCode::kInvalidArgument, std::string(part->name()) + " does not go with " + name +
                                              ": nothing there decides " + wordsOf(role));
      }
    }
    if (part->owns() & roles(ControlRole::kThreshold)) requireHeed(*part, assembly);
    if ((part->owns() & kWhole) != kWhole) continue;
    for (const auto& other : assembly.parts) {
      if (other == part || !(other->owns() & kOfIt)) continue;
      const bool is_score = other->owns() & roles(ControlRole::kScore);
      fail(ErrorCode::kInvalidArgument,
           std::string(other->name()) + " does not go with " + part->name() + ", which decides " +
               wordsOf(is_score ? ControlRole::kScore : ControlRole::kChildOpacity) + " itself");
    }
  }
}

class DensityControl final : public Strategy {
 public:
  DensityControl(const char* name, ControlAssembly assembly)
      : name_(name), schedule_(assembly.schedule), parts_(std::move(assembly.parts)) {
    const ControlPart* how = owner(ControlRole::kParameterisation);
    const ControlPart* filtering = owner(ControlRole::kFilter);
    if (filtering) {
      filtered_.emplace(how ? how->parameterisation() : nullptr, *filtering->filter());
    }
  }

  const char* name() const override { return name_.c_str(); }

  void prepare(RawSplats& splats, uint64_t iterations) const override {
    for (const auto& part : parts_) part->prepare(splats, iterations);
  }
  void adjustRates(LearningRates& rates) const override {
    for (const auto& part : parts_) part->adjustRates(rates);
  }
  void adjustStretch(TimeStretch& stretch) const override {
    if (const ControlPart* part = owner(ControlRole::kTime)) part->adjustStretch(stretch);
  }

  std::vector<ExtraParameter> parameters() const override {
    const ControlPart* part = owner(ControlRole::kParameterisation);
    return part ? part->parameters() : std::vector<ExtraParameter>{};
  }
  std::vector<std::vector<float>> initialExtras(const RawSplats& splats) const override {
    const ControlPart* part = owner(ControlRole::kParameterisation);
    return part ? part->initialExtras(splats) : std::vector<std::vector<float>>{};
  }
  const Parameterisation* parameterisation() const override {
    if (filtered_) return &*filtered_;
    const ControlPart* part = owner(ControlRole::kParameterisation);
    return part ? part->parameterisation() : nullptr;
  }

  StatisticRequest requests(const FitMoment& given) const override {
    StatisticRequest request;
    for (const auto& part : parts_) part->request(at(given), request);
    return request;
  }

  std::vector<float> opacityFactors(const FitMoment& given, size_t count) const override {
    const ControlPart* part = owner(ControlRole::kDropout);
    return part ? part->opacityFactors(at(given), count) : std::vector<float>{};
  }
  bool regularises(const FitMoment& given) const override {
    const ControlPart* part = owner(ControlRole::kRegularisation);
    return part && part->regularises(at(given));
  }
  double loss(const FitMoment& given, const SplatCloud& cloud,
              const CloudGradient& gradient) override {
    ControlPart* part = owner(ControlRole::kRegularisation);
    return part ? part->loss(at(given), cloud, gradient) : 0;
  }
  double transmittanceWeight(const FitMoment& given) const override {
    const ControlPart* part = owner(ControlRole::kRegularisation);
    return part ? part->transmittanceWeight(at(given)) : 0;
  }

  void observe(const FitMoment& given, const ViewStatistics& view) override {
    for (const auto& part : parts_) part->observe(at(given), view);
  }

  bool stepGate(const FitMoment& given) const override {
    const ControlPart* part = owner(ControlRole::kSteps);
    return !part || part->stepGate(at(given));
  }

  std::optional<SplatEdit> afterStep(const FitMoment& given, const SplatStore& store) override {
    ControlPart* part = owner(ControlRole::kNoise);
    return part ? part->afterStep(at(given), store) : std::optional<SplatEdit>{};
  }

  bool lowersOpacitiesAt(const FitMoment& given) const override {
    const ControlPart* part = owner(ControlRole::kOpacity);
    return part && part->lowersAt(at(given));
  }
  uint64_t foggyStepsAfter(const FitMoment& given) const override {
    const ControlPart* part = owner(ControlRole::kOpacity);
    return part ? part->foggySteps(at(given)) : 0;
  }

  bool wantsSweep(const FitMoment& given) const override {
    return std::any_of(parts_.begin(), parts_.end(),
                       [&](const auto& part) { return part->wantsSweep(at(given)); });
  }
  void sweep(const FitMoment& given, ViewEvaluator& views) override {
    const ControlMoment moment = at(given);
    for (const auto& part : parts_) {
      if (part->wantsSweep(moment)) part->sweep(moment, views);
    }
  }

  std::optional<SplatEdit> edit(const FitMoment& given, const SplatStore& store) override {
    const ControlMoment moment = at(given);
    const size_t count = store.size();
    if (count == 0) return {};
    followAges(count, moment);
    SplatEdit edit;
    if (moment.is_event || removesNow(moment)) {
      std::vector<uint8_t> goes(count, 0);
      if (moment.is_event) {
        multiply(moment, store, goes, edit);
        if (ControlPart* part = owner(ControlRole::kSecondSplit)) {
          part->splitAgain(moment, store.splats(), limit(moment, count), goes, edit.append);
        }
      }
      removeSplats(moment, store.splats(), goes, edit);
    }
    ControlPart* lowering = owner(ControlRole::kOpacity);
    if (lowering && moment.takes_steps && lowering->lowersAt(moment)) {
      lowering->lowerOpacities(moment, store.splats(), edit);
    }
    if (!moment.is_event && edit.writes.empty() && !edit.keep && edit.append.size() == 0) return {};
    for (const auto& part : parts_) part->edited(moment, edit, count);
    followEdit(edit, 1, static_cast<float>(clock(moment)), births_);
    scores_ = scoresOf(births_.size());
    return edit;
  }

  SplatQuantities seen(size_t splat_count) const override {
    SplatQuantities quantities;
    if (births_.size() == splat_count) quantities.age = ages();
    if (scores_.size() == splat_count) quantities.score = scores_;
    return quantities;
  }

  TensorTable state() const override {
    TensorTable table;
    table["births"] = {{births_.size()}, births_};
    table["clock"] = {{1}, std::vector<uint64_t>{clock_}};
    table["scores"] = {{scores_.size()}, scores_};
    for (const auto& part : parts_) {
      TensorTable own;
      part->put(own);
      for (auto& [key, tensor] : own) {
        table[std::string(part->name()) + "." + key] = std::move(tensor);
      }
    }
    return table;
  }

  void restore(const TensorTable& table) override {
    std::vector<float> births = stateArray<float>(table, "births");
    for (const auto& part : parts_) {
      const std::string prefix = std::string(part->name()) + ".";
      TensorTable own;
      for (const auto& [key, tensor] : table) {
        if (key.starts_with(prefix)) own[key.substr(prefix.size())] = tensor;
      }
      part->take(own);
    }
    births_ = std::move(births);
    // Only for looking at: a state without them goes on all the same.
    clock_ = table.contains("clock") ? stateArray<uint64_t>(table, "clock").at(0) : 0;
    scores_ = table.contains("scores") ? stateArray<float>(table, "scores") : std::vector<float>{};
  }

 private:
  ControlMoment at(const FitMoment& moment) const { return controlMoment(moment, schedule_); }

  ControlPart* owner(ControlRole role) const {
    for (const auto& part : parts_) {
      if (part->owns() & roles(role)) return part.get();
    }
    return nullptr;
  }

  bool removesNow(const ControlMoment& moment) const {
    const ControlPart* removal = owner(ControlRole::kRemoval);
    const ControlPart* recovery = moment.takes_steps ? owner(ControlRole::kRecovery) : nullptr;
    return (removal && removal->removesAt(moment)) || (recovery && recovery->removesAt(moment));
  }

  /// What ages are counted in: iterations; without a fit, events.
  static uint64_t clock(const ControlMoment& moment) {
    return moment.standalone ? moment.standalone->index + 1 : moment.iteration;
  }
  /// Births are counted from the first call of a fit; splats of a finished cloud were there before.
  void followAges(size_t count, const ControlMoment& moment) {
    clock_ = clock(moment);
    if (births_.size() == count) return;
    births_.assign(count, moment.standalone ? 0.0f : static_cast<float>(clock_));
  }
  /// What the owner of scores tells, else the first part that tells any.
  std::vector<float> scoresOf(size_t count) const {
    std::vector<float> values;
    if (const ControlPart* part = owner(ControlRole::kScore)) values = part->scores();
    for (const auto& part : parts_) {
      if (values.size() == count) break;
      values = part->scores();
    }
    return values.size() == count ? values : std::vector<float>{};
  }
  std::vector<float> ages() const {
    std::vector<float> values(births_.size());
    for (size_t i = 0; i < values.size(); ++i) {
      values[i] = static_cast<float>(clock_) - births_[i];
    }
    return values;
  }

  /// Splats that there may be after this event.
  uint64_t limit(const ControlMoment& moment, size_t count) const {
    ControlPart* growth = owner(ControlRole::kGrowth);
    const uint64_t room = growth ? growth->limit(moment, count) : UINT64_MAX;
    return moment.max_splats > 0 ? std::min(room, moment.max_splats) : room;
  }

  void multiply(const ControlMoment& moment, const SplatStore& store, std::vector<uint8_t>& goes,
                SplatEdit& edit) {
    ControlPart* part = owner(ControlRole::kMultiplication);
    if (!part) return;
    const RawSplats& splats = store.splats();
    const uint64_t room = limit(moment, store.size());
    if (part->owns() & roles(ControlRole::kChildren)) {
      part->multiply(moment, store, room, edit);
      if (edit.keep) {
        std::fill(goes.begin(), goes.end(), uint8_t{1});
        for (const uint32_t row : *edit.keep) goes[row] = 0;
      }
      return;
    }
    ControlPart* children = owner(ControlRole::kChildren);
    ControlMoment judged = moment;
    std::vector<float> shares;
    if (ControlPart* threshold = owner(ControlRole::kThreshold)) {
      shares = threshold->thresholdShares(moment, splats.size());
      judged.threshold_shares = shares;
    }
    std::vector<Candidate> chosen = part->candidates(judged, splats);
    dropHopeless(moment, splats, *children, goes, chosen);
    chooseFirst(moment, splats, goes, room, chosen);
    edit.append = children->children(moment, splats, chosen);
    setChildOpacities(splats, chosen, *children, edit);
    for (const Candidate& one : chosen) {
      if (one.replaces) goes[one.row] = 1;
    }
  }

  /// Candidates that are about to go multiply only where a child would stay.
  void dropHopeless(const ControlMoment& moment, const RawSplats& splats, ControlPart& children,
                    std::vector<uint8_t>& goes, std::vector<Candidate>& candidates) {
    ControlPart* removal = owner(ControlRole::kRemoval);
    if (!removal || !removal->removesAt(moment)) return;
    const RawSplats none = rowsOf(splats, {});
    removal->remove(moment, splats, none, goes, {});
    std::erase_if(candidates, [&](Candidate& one) {
      if (!goes[one.row]) return false;
      const RawSplats born = children.children(moment, splats, {&one, 1});
      if (!one.replaces) return true;
      std::vector<uint8_t> unseen(splats.size(), 0), born_goes(born.size(), 0);
      const RawSplats parent = rowsOf(splats, {one.row});
      removal->remove(moment, parent, born, std::span(unseen).first(1), born_goes);
      return std::find(born_goes.begin(), born_goes.end(), 0) == born_goes.end();
    });
  }

  /// Leaves the candidates that there is room for, by row.
  void chooseFirst(const ControlMoment& moment, const RawSplats& splats,
                   const std::vector<uint8_t>& goes, uint64_t room,
                   std::vector<Candidate>& candidates) {
    uint64_t count = static_cast<uint64_t>(std::count(goes.begin(), goes.end(), 0));
    std::vector<size_t> order = preferred(moment, splats, room, count, candidates);
    std::vector<Candidate> chosen;
    for (const size_t k : order) {
      const uint64_t added = goes[candidates[k].row] ? 2 : 1;
      if (count + added > room) continue;
      count += added;
      chosen.push_back(candidates[k]);
    }
    std::sort(chosen.begin(), chosen.end(),
              [](const Candidate& a, const Candidate& b) { return a.row < b.row; });
    candidates = std::move(chosen);
  }

  /// Candidates in the order in which they get room.
  std::vector<size_t> preferred(const ControlMoment& moment, const RawSplats& splats, uint64_t room,
                                uint64_t count, const std::vector<Candidate>& candidates) {
    std::vector<size_t> order(candidates.size());
    std::iota(order.begin(), order.end(), size_t{0});
    if (room == UINT64_MAX) return order;
    if (ControlPart* part = owner(ControlRole::kScore)) {
      const std::vector<double> weights = part->score(moment, splats, candidates);
      const size_t most = static_cast<size_t>(
          std::min<uint64_t>(candidates.size(), room > count ? room - count : 0));
      return drawn(moment, candidates, weights, most, part->drawsByKind());
    }
    std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
      return candidates[a].strength > candidates[b].strength;
    });
    return order;
  }

  /// Places of candidates, by their weights.
  static std::vector<size_t> drawn(const ControlMoment& moment,
                                   const std::vector<Candidate>& candidates,
                                   const std::vector<double>& weights, size_t most, bool by_kind) {
    std::vector<size_t> places;
    for (const bool replaces : {false, true}) {
      std::vector<uint32_t> rows;
      std::vector<double> own;
      for (size_t k = 0; k < candidates.size(); ++k) {
        if (by_kind && candidates[k].replaces != replaces) continue;
        rows.push_back(static_cast<uint32_t>(k));
        own.push_back(weights[k]);
      }
      if (rows.empty()) continue;
      for (const uint32_t row : drawWithoutReplacement(moment, RandomUse::kDensifyChoice, rows, own,
                                                       most * rows.size() / candidates.size())) {
        places.push_back(row);
      }
      if (!by_kind) break;
    }
    return places;
  }

  void setChildOpacities(const RawSplats& splats, const std::vector<Candidate>& chosen,
                         const ControlPart& children, SplatEdit& edit) const {
    const ControlPart* part = owner(ControlRole::kChildOpacity);
    if (!part || part == &children) return;
    const size_t copied = static_cast<size_t>(
        std::count_if(chosen.begin(), chosen.end(), [](const auto& one) { return !one.replaces; }));
    const size_t changed = part->changesCopiesAlone() ? copied : edit.append.size();
    for (size_t k = 0; k < changed; ++k) {
      edit.append.logits[k] = part->childLogit(edit.append.logits[k]);
    }
    RowWrite write;
    write.array = RawArray::kLogits;
    for (const Candidate& one : chosen) {
      if (one.replaces) continue;
      write.rows.push_back(one.row);
      write.values.push_back(part->childLogit(splats.logits[one.row]));
    }
    if (!write.rows.empty()) edit.writes.push_back(std::move(write));
  }

  void removeSplats(const ControlMoment& moment, const RawSplats& splats,
                    std::vector<uint8_t>& goes, SplatEdit& edit) {
    std::vector<uint8_t> appended_goes(edit.append.size(), 0);
    for (const ControlRole role : {ControlRole::kRemoval, ControlRole::kRecovery}) {
      if (role == ControlRole::kRecovery && !moment.takes_steps) continue;
      ControlPart* part = owner(role);
      if (part && part->removesAt(moment)) {
        part->remove(moment, splats, edit.append, goes, appended_goes);
      }
    }
    std::vector<uint32_t> appended = staying(appended_goes);
    if (appended.size() < appended_goes.size()) edit.append = rowsOf(edit.append, appended);
    std::vector<uint32_t> stay = staying(goes);
    if (stay.empty() && edit.append.size() == 0) {
      // Without any splat a fit could never grow again.
      const auto best = std::max_element(splats.logits.begin(), splats.logits.end());
      stay.push_back(static_cast<uint32_t>(best - splats.logits.begin()));
    }
    if (stay.size() < splats.size()) edit.keep = std::move(stay);
  }

  std::string name_;
  EventSchedule schedule_;
  std::vector<std::unique_ptr<ControlPart>> parts_;
  std::optional<FilteredParameterisation> filtered_;  ///< where a part filters
  std::vector<float> births_;                         ///< [N] when each splat was made
  uint64_t clock_ = 0;                                ///< of the last call
  std::vector<float> scores_;                         ///< [N] of the last event
};

}  // namespace

std::unique_ptr<Strategy> makeDensityControl(const char* name, ControlAssembly assembly) {
  requireUse(name, assembly);
  return std::make_unique<DensityControl>(name, std::move(assembly));
}

}  // namespace stipple
