#include "train/anchors/relay_work.h"

#include <string>
#include <utility>

#include "base/error.h"
#include "train/anchors/scaffold_steps.h"
#include "train/networks/trainer_tensors.h"
#include "train/optimiser/adam.h"

namespace stipple {

namespace {

/// A window has a few hundred steps, where the publication has tens of thousands. Higher rates move
/// what stands still in a room by more than a pixel in each step (docs/methods/relay.md).
constexpr LearningRate kHeadRate = {1e-3, 1e-4};
constexpr LearningRate kPlaneRate = {1e-2, 1e-3};
constexpr LearningRate kBlendRate = {2e-2, 2e-3};
constexpr uint64_t kMostAnchors = uint64_t{1} << 28;

/// Calls visit(values, whether of a plane) for what of a deformation learns.
template <class Deformation, class Visit>
void forEachArray(Deformation& deformation, const Visit& visit) {
  for (auto& plane : deformation.planes.planes()) visit(plane.values, true);
  if (!deformation.isThere()) return;
  for (auto& layer : deformation.heads.layers()) {
    visit(layer.weights, false);
    visit(layer.biases, false);
  }
}

Moments zerosLike(const std::vector<float>& values) {
  return {std::vector<float>(values.size()), std::vector<float>(values.size())};
}

std::string numbered(const char* stem, size_t number) {
  return stem + std::to_string(number);
}

void putMoments(const char* stem, const std::vector<Moments>& moments, TensorTable& table) {
  for (size_t i = 0; i < moments.size(); ++i) {
    putValues("adam.first." + numbered(stem, i), moments[i].first, table);
    putValues("adam.second." + numbered(stem, i), moments[i].second, table);
  }
}

/// In: sizes, those of the arrays.
void takeMoments(const char* stem, const TensorTable& table, std::vector<Moments>& moments) {
  for (size_t i = 0; i < moments.size(); ++i) {
    const size_t count = moments[i].first.size();
    moments[i].first = takeValues<float>(table, "adam.first." + numbered(stem, i), count, count);
    moments[i].second = takeValues<float>(table, "adam.second." + numbered(stem, i), count, count);
  }
}

}  // namespace

uint64_t RelayWork::bytes() const {
  uint64_t floats = 0;
  for (const auto& blend : blends) floats += blend.size();
  return state.scaffold->bytes() + (deformation.isThere() ? deformation.bytes() : 0) +
         floats * sizeof(float);
}

RelayWork workOn(ScaffoldState state, AnchorDeformation deformation) {
  RelayWork work;
  work.state = std::move(state);
  work.deformation = std::move(deformation);
  forEachArray(work.deformation, [&](const std::vector<float>& values, bool) {
    work.deformation_moments.push_back(zerosLike(values));
  });
  return work;
}

RelayWork blendWorkOf(const KeyFrame& before, const KeyFrame& behind, const RelayWork& like) {
  RelayWork work;
  work.state = startState(makeScaffold(shapeOf(*like.state.scaffold)));
  work.blends = {before.blend, behind.blend};
  for (const auto& blend : work.blends) work.blend_moments.push_back(zerosLike(blend));
  return work;
}

KeyFrame keyFrameOf(const RelayWork& work) {
  KeyFrame frame;
  frame.scaffold = *work.state.scaffold;
  frame.deformation = work.deformation;
  for (size_t a = 0; a < frame.scaffold.size(); ++a) {
    frame.blend.insert(frame.blend.end(), {0.0f, kStartingDecay, 0.0f, kStartingDecay});
  }
  return frame;
}

void learnDeformation(const FitMoment& moment, const DeformationGradients& gradients,
                      RelayWork& work) {
  std::vector<const std::vector<float>*> by;
  for (const auto& plane : gradients.planes) by.push_back(&plane);
  for (const LinearLayer& layer : gradients.heads) {
    by.push_back(&layer.weights);
    by.push_back(&layer.biases);
  }
  std::vector<AdamGroup> groups;
  size_t next = 0;
  forEachArray(work.deformation, [&](std::vector<float>& values, bool is_plane) {
    Moments& both = work.deformation_moments[next];
    groups.push_back({values.data(), by[next]->data(), both.first.data(), both.second.data(),
                      values.size(), 1, rateAt(is_plane ? kPlaneRate : kHeadRate, moment)});
    ++next;
  });
  adamStep(groups, ++work.deformation_steps);
}

void learnBlend(const FitMoment& moment, const std::array<std::vector<float>, 2>& by_blend,
                RelayWork& work) {
  std::vector<AdamGroup> groups;
  for (size_t i = 0; i < work.blends.size(); ++i) {
    if (work.blends[i].empty()) continue;
    groups.push_back({work.blends[i].data(), by_blend[i].data(), work.blend_moments[i].first.data(),
                      work.blend_moments[i].second.data(), work.blends[i].size(), 1,
                      rateAt(kBlendRate, moment)});
  }
  adamStep(groups, ++work.blend_steps);
}

TensorTable tensorsOf(const RelayWork& work) {
  TensorTable table = tensorsOf(work.state);
  KeyFrame frame;
  frame.deformation = work.deformation;
  frame.scaffold = makeScaffold(shapeOf(*work.state.scaffold));
  for (auto& [name, tensor] : tensorsOfKeyFrame(frame, "deformation.")) {
    table[name] = std::move(tensor);
  }
  putMoments("deformation.", work.deformation_moments, table);
  for (size_t i = 0; i < work.blends.size(); ++i) {
    putValues(numbered("blend.", i), work.blends[i], table);
  }
  putMoments("blend.", work.blend_moments, table);
  putValues("work.steps", std::vector<uint64_t>{work.deformation_steps, work.blend_steps}, table);
  return table;
}

RelayWork workOf(const TensorTable& table, const RelayWork& like) {
  RelayWork work;
  work.state = scaffoldStateOf(table, like.state);
  // A key frame without anchors has no numbers that blend them.
  TensorTable others = table;
  others["deformation.blend"] = {{0}, std::vector<float>()};
  work.deformation =
      keyFrameOfTensors(others, "deformation.", shapeOf(*like.state.scaffold)).deformation;
  forEachArray(work.deformation, [&](const std::vector<float>& values, bool) {
    work.deformation_moments.push_back(zerosLike(values));
  });
  takeMoments("deformation.", table, work.deformation_moments);
  if (table.contains("blend.0")) {
    for (size_t i = 0; i < 2; ++i) {
      work.blends.push_back(
          takeValues<float>(table, numbered("blend.", i), 0, kMostAnchors * kBlendNumbers));
      work.blend_moments.push_back(zerosLike(work.blends.back()));
    }
    takeMoments("blend.", table, work.blend_moments);
  }
  const auto steps = takeValues<uint64_t>(table, "work.steps", 2, 2);
  work.deformation_steps = steps[0];
  work.blend_steps = steps[1];
  return work;
}

}  // namespace stipple
