#include "train/anchors/scaffold_state.h"

#include <string>
#include <utility>

#include "base/error.h"
#include "decode/anchors/scaffold_tensors.h"
#include "decode/tree/tree_shape.h"
#include "train/networks/trainer_tensors.h"

namespace stipple {

namespace {

constexpr uint64_t kMostAnchors = uint64_t{1} << 28;

/// Arrays with a row for each anchor come first: positions, features, scales, offsets.
constexpr size_t kAnchorArrays = 4;

/// Calls visit(name, values, row length, moments, whether rows are anchors) for what learns.
template <class State, class Visit>
void forEachLearned(State& state, const Visit& visit) {
  size_t index = 0;
  forEachScaffoldArray(*state.scaffold, [&](const std::string& name, auto& values, size_t width) {
    if (index > 0) visit(name, values, width, state.moments[index - 1], index < kAnchorArrays);
    ++index;
  });
}

}  // namespace

void ScaffoldState::follow() {
  forEachLearned(
      *this, [](const std::string&, const std::vector<float>& values, size_t, Moments& both, bool) {
        both.first.resize(values.size(), 0.0f);
        both.second.resize(values.size(), 0.0f);
      });
  statistics.resize(scaffold->size(), scaffold->gaussians);
}

void ScaffoldState::keep(const std::vector<uint32_t>& rows) {
  keepAnchors(*scaffold, rows);
  forEachLearned(*this, [&](const std::string&, const std::vector<float>&, size_t width,
                            Moments& both, bool is_of_anchors) {
    if (!is_of_anchors) return;
    gatherRows(both.first, width, rows);
    gatherRows(both.second, width, rows);
  });
  statistics.keep(rows, scaffold->gaussians);
  if (levels.empty()) return;
  std::vector<uint8_t> kept;
  for (const uint32_t row : rows) kept.push_back(levels[row]);
  levels.swap(kept);
}

ScaffoldShape shapeOf(const ScaffoldParameters& scaffold) {
  return {scaffold.gaussians, scaffold.sh_degree, scaffold.colour_space, scaffold.antialias, 0};
}

ScaffoldState startState(ScaffoldParameters scaffold) {
  ScaffoldState state;
  state.scaffold = std::make_shared<ScaffoldParameters>(std::move(scaffold));
  size_t arrays = 0;
  forEachScaffoldArray(*state.scaffold,
                       [&](const std::string&, const std::vector<float>&, size_t) { ++arrays; });
  state.moments.resize(arrays - 1);
  state.follow();
  return state;
}

TensorTable tensorsOf(const ScaffoldState& state) {
  TensorTable table = tensorsOfScaffold(*state.scaffold);
  forEachLearned(state, [&](const std::string& name, const std::vector<float>&, size_t,
                            const Moments& both, bool) {
    putValues("adam.first." + name, both.first, table);
    putValues("adam.second." + name, both.second, table);
  });
  putValues("window.gradient_sums", state.statistics.gradient_sums, table);
  putValues("window.drawn", state.statistics.drawn, table);
  putValues("window.opacity_sums", state.statistics.opacity_sums, table);
  putValues("window.seen", state.statistics.seen, table);
  if (!state.levels.empty()) putValues("window.levels", state.levels, table);
  putValues("window.coarsening", std::vector<double>{state.scaffold->coarsening}, table);
  putValues("scaffold.steps", std::vector<uint64_t>{state.steps}, table);
  return table;
}

ScaffoldState scaffoldStateOf(const TensorTable& table, const ScaffoldState& like) {
  ScaffoldState state = startState(scaffoldOfTensors(table, shapeOf(*like.scaffold)));
  const size_t anchors = state.scaffold->size();
  if (anchors > kMostAnchors) {
    fail(ErrorCode::kFormat, "the checkpoint has " + std::to_string(anchors) + " anchors");
  }
  forEachLearned(state, [&](const std::string& name, const std::vector<float>& values, size_t,
                            Moments& both, bool) {
    const size_t count = values.size();
    both.first = takeValues<float>(table, "adam.first." + name, count, count);
    both.second = takeValues<float>(table, "adam.second." + name, count, count);
  });
  const size_t slots = anchors * state.scaffold->gaussians;
  state.statistics.gradient_sums = takeValues<float>(table, "window.gradient_sums", slots, slots);
  state.statistics.drawn = takeValues<uint32_t>(table, "window.drawn", slots, slots);
  state.statistics.opacity_sums = takeValues<float>(table, "window.opacity_sums", anchors, anchors);
  state.statistics.seen = takeValues<uint32_t>(table, "window.seen", anchors, anchors);
  if (table.contains("window.levels")) {
    state.levels = takeValues<uint8_t>(table, "window.levels", anchors, anchors);
    for (const uint8_t level : state.levels) {
      if (level > 2) fail(ErrorCode::kFormat, "the checkpoint has an anchor of level above 2");
    }
  }
  if (table.contains("window.coarsening")) {
    const double value = takeValues<double>(table, "window.coarsening", 1, 1).front();
    if (!(value >= 0 && value <= 1)) {
      fail(ErrorCode::kFormat, "the checkpoint has a coarsening outside 0 to 1");
    }
    state.scaffold->coarsening = value;
  }
  state.steps = takeValues<uint64_t>(table, "scaffold.steps", 1, 1).front();
  return state;
}

}  // namespace stipple
