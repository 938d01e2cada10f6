#include "train/anchors/handed_on.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "decode/anchors/scaffold.h"

namespace stipple {

namespace {

std::array<float, 3> placeOf(const ScaffoldParameters& scaffold, size_t anchor) {
  const float* place = &scaffold.positions[anchor * 3];
  return {place[0], place[1], place[2]};
}

void addRow(const std::vector<float>& from, size_t row, size_t width, std::vector<float>& to) {
  const float* values = &from[row * width];
  to.insert(to.end(), values, values + width);
}

}  // namespace

ScaffoldState handedOn(ScaffoldState finished, const ScaffoldParameters& anchors) {
  std::map<std::array<float, 3>, uint32_t> rows;
  for (size_t a = 0; a < finished.scaffold->size(); ++a) {
    rows.emplace(placeOf(*finished.scaffold, a), static_cast<uint32_t>(a));
  }
  std::vector<uint32_t> kept;
  std::vector<size_t> lost;
  for (size_t a = 0; a < anchors.size(); ++a) {
    const auto found = rows.find(placeOf(anchors, a));
    if (found == rows.end()) {
      lost.push_back(a);
    } else {
      kept.push_back(found->second);
      rows.erase(found);
    }
  }
  ScaffoldState state = std::move(finished);
  state.levels.clear();
  state.keep(kept);
  for (const size_t a : lost) {
    addRow(anchors.positions, a, 3, state.scaffold->positions);
    addRow(anchors.features, a, kScaffoldFeatures, state.scaffold->features);
    addRow(anchors.log_scales, a, kScaffoldScales, state.scaffold->log_scales);
    addRow(anchors.offsets, a, size_t{anchors.gaussians} * 3, state.scaffold->offsets);
  }
  state.statistics = {};
  state.follow();
  return state;
}

}  // namespace stipple
