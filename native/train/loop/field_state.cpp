#include "train/loop/field_state.h"

#include <utility>

#include "base/error.h"

namespace stipple {

namespace {

Moments zeros(size_t count) {
  return {std::vector<float>(count), std::vector<float>(count)};
}

const Tensor& tensorNamed(const TensorTable& table, const std::string& name) {
  const auto at = table.find(name);
  if (at == table.end()) {
    fail(ErrorCode::kFormat, "the state of the fit has no tensor " + name + "; it is needed");
  }
  return at->second;
}

template <class T>
std::vector<T> valuesOf(const TensorTable& table, const std::string& name) {
  const auto* values = std::get_if<std::vector<T>>(&tensorNamed(table, name).values);
  if (values == nullptr) {
    fail(ErrorCode::kFormat, "tensor " + name + " of the state of the fit has another type");
  }
  return *values;
}

/// In: count: what is needed.
std::vector<float> floatsOf(const TensorTable& table, const std::string& name, size_t count) {
  std::vector<float> values = valuesOf<float>(table, name);
  if (values.size() != count) {
    fail(ErrorCode::kFormat, "tensor " + name + " of the state of the fit has " +
                                 std::to_string(values.size()) + " values; " +
                                 std::to_string(count) + " are needed");
  }
  requireFinite(values.data(), values.size(), 1, name.c_str());
  return values;
}

template <class T>
void put(TensorTable& table, const std::string& name, const std::vector<T>& values,
         size_t row_length = 1) {
  Tensor tensor;
  tensor.shape = {values.size() / row_length};
  if (row_length > 1) tensor.shape.push_back(row_length);
  tensor.values = values;
  table[name] = std::move(tensor);
}

std::string numbered(const char* stem, size_t number, const char* what) {
  return std::string(stem) + std::to_string(number) + "." + what;
}

/// Calls visit(name, row length, array, moments) for every array that is trained, and of the
/// density too, where logits cannot be written in place. `State` may be const.
template <class State, class Visit>
void forEachFieldArray(State& state, const Visit& visit) {
  auto& field = *state.field;
  for (size_t l = 0; l < state.features.size(); ++l) {
    auto& level = field.features.levels()[l];
    visit("field.features.level" + std::to_string(level.level), field.features.channels(),
          level.values, state.features[l]);
  }
  for (size_t l = 0; l < state.details.size(); ++l) {
    auto& level = field.details.levels()[l];
    visit("field.details.level" + std::to_string(level.level), field.details.channels(),
          level.values, state.details[l]);
  }
  for (size_t l = 0; l < state.weights.size(); ++l) {
    auto& layer = field.network.layers()[l];
    visit(numbered("field.network.layer", l, "weights"), layer.outputs, layer.weights,
          state.weights[l]);
    visit(numbered("field.network.layer", l, "biases"), size_t{1}, layer.biases, state.biases[l]);
  }
}

}  // namespace

FieldState startState(LearnedDensity density, FieldParameters field) {
  FieldState state{std::move(density),
                   std::make_shared<FieldParameters>(std::move(field)),
                   {},
                   {},
                   {},
                   {},
                   {},
                   0,
                   0,
                   {}};
  for (const LearnedLevel& level : state.density.levels()) {
    state.logits.push_back(zeros(level.logits.size()));
  }
  for (const FeatureLevel& level : state.field->features.levels()) {
    state.features.push_back(zeros(level.values.size()));
  }
  for (const FeatureLevel& level : state.field->details.levels()) {
    state.details.push_back(zeros(level.values.size()));
  }
  for (const LinearLayer& layer : state.field->network.layers()) {
    state.weights.push_back(zeros(layer.weights.size()));
    state.biases.push_back(zeros(layer.biases.size()));
  }
  return state;
}

void insertMoments(FieldState& state, const std::vector<std::vector<uint32_t>>& rows) {
  for (size_t l = 0; l < rows.size(); ++l) {
    if (rows[l].empty()) continue;
    insertZeroRows(state.logits[l].first, 8, rows[l]);
    insertZeroRows(state.logits[l].second, 8, rows[l]);
  }
}

TensorTable tensorsOf(const FieldState& state) {
  TensorTable table;
  const RootCube& root = state.density.root();
  put(table, "octree.root",
      std::vector<double>{root.origin[0], root.origin[1], root.origin[2], root.side});
  for (size_t l = 0; l < state.density.levels().size(); ++l) {
    const LearnedLevel& level = state.density.levels()[l];
    put(table, numbered("octree.level", l, "cells"), level.cells);
    put(table, numbered("octree.level", l, "logits"), level.logits, 8);
    put(table, numbered("octree.level", l, "prior"), level.prior, 8);
    put(table, numbered("adam.first.octree.level", l, "logits"), state.logits[l].first, 8);
    put(table, numbered("adam.second.octree.level", l, "logits"), state.logits[l].second, 8);
  }
  forEachFieldArray(state, [&](const std::string& name, size_t length,
                               const std::vector<float>& values, const Moments& moments) {
    put(table, name, values, length);
    put(table, "adam.first." + name, moments.first, length);
    put(table, "adam.second." + name, moments.second, length);
  });
  put(table, "field.steps", std::vector<uint64_t>{state.density_steps, state.field_steps,
                            static_cast<uint64_t>(state.density.settledLevel())});
  std::vector<uint64_t> draws;
  for (const auto& [cell, count] : state.draws) {
    draws.insert(draws.end(), {static_cast<uint64_t>(cell.first), cell.second, count});
  }
  put(table, "octree.draws", draws, 3);
  return table;
}

FieldState stateOf(const TensorTable& table, const FieldState& like) {
  const std::vector<double> root = valuesOf<double>(table, "octree.root");
  if (root.size() != 4) {
    fail(ErrorCode::kFormat, "tensor octree.root of the state of the fit has " +
                                 std::to_string(root.size()) + " values; 4 are needed");
  }
  std::vector<LearnedLevel> levels(like.density.levels().size());
  std::vector<Moments> logits(levels.size());
  for (size_t l = 0; l < levels.size(); ++l) {
    levels[l].cells = valuesOf<uint64_t>(table, numbered("octree.level", l, "cells"));
    const size_t count = levels[l].cells.size() * 8;
    levels[l].logits = floatsOf(table, numbered("octree.level", l, "logits"), count);
    levels[l].prior = floatsOf(table, numbered("octree.level", l, "prior"), count);
    logits[l].first = floatsOf(table, numbered("adam.first.octree.level", l, "logits"), count);
    logits[l].second = floatsOf(table, numbered("adam.second.octree.level", l, "logits"), count);
  }
  const std::vector<uint64_t> steps = valuesOf<uint64_t>(table, "field.steps");
  // Without the third: of a version that settled on the deepest level.
  const uint64_t settled = steps.size() > 2 ? std::min<uint64_t>(steps[2], kMaxLeafLevel + 1) : 0;
  FieldState state = startState(LearnedDensity({{root[0], root[1], root[2]}, root[3]},
                                               std::move(levels), static_cast<int>(settled)),
                                *like.field);
  state.field->root = state.density.root();
  state.logits = std::move(logits);
  forEachFieldArray(
      state, [&](const std::string& name, size_t, std::vector<float>& values, Moments& moments) {
        values = floatsOf(table, name, values.size());
        moments.first = floatsOf(table, "adam.first." + name, values.size());
        moments.second = floatsOf(table, "adam.second." + name, values.size());
      });
  const std::vector<uint64_t> draws = valuesOf<uint64_t>(table, "octree.draws");
  if (steps.size() < 2 || steps.size() > 3 || draws.size() % 3 != 0) {
    fail(ErrorCode::kFormat, "the state of the fit has " + std::to_string(steps.size()) +
                                 " counts of steps and " + std::to_string(draws.size()) +
                                 " numbers of draws; 3 and whole triples are needed");
  }
  state.density_steps = steps[0];
  state.field_steps = steps[1];
  for (size_t i = 0; i < draws.size(); i += 3) {
    state.draws[{static_cast<int>(draws[i]), draws[i + 1]}] = draws[i + 2];
  }
  return state;
}

}  // namespace stipple
