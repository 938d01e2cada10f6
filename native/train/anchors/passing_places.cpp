#include "train/anchors/passing_places.h"

#include <algorithm>
#include <memory>

#include "decode/anchors/scaffold_decoder.h"
#include "train/anchors/scaffold_steps.h"
#include "train/prior/point_lives.h"
#include "train/prior/start_splats.h"

namespace stipple {

namespace {

/// They are asked about at 48 times: more would cost memory and tell little.
constexpr uint64_t kMostPlaces = 100000;

}  // namespace

std::vector<float> PassingPlaces::between(double from, double to) const {
  std::vector<float> places;
  for (size_t i = 0; i < size(); ++i) {
    if (spans[i * 2] > to || spans[i * 2 + 1] < from) continue;
    places.insert(places.end(), &positions[i * 3], &positions[i * 3] + 3);
  }
  return places;
}

PassingPlaces passingPlaces(const ViewSource& views, std::span<const size_t> training,
                            uint64_t seed, Progress* progress) {
  PassingPlaces passing;
  if (views.points().times.empty()) return passing;
  StartOptions options;
  options.max_count = kMostPlaces;
  options.with_lives = true;
  options.sh_degree = 0;
  options.seed = seed;
  const StartSplats start = startSplats(views, training, options, progress);
  for (size_t i = 0; i < start.times.size(); ++i) {
    const double before = static_cast<double>(start.lives[i * 2]);
    const double behind = static_cast<double>(start.lives[i * 2 + 1]);
    const bool is_known = before >= 0 && behind >= 0;
    const double whole = static_cast<double>(kWholeLife);
    if (!is_known || (before >= whole && behind >= whole)) continue;
    passing.positions.insert(passing.positions.end(), &start.splats.positions[i * 3],
                             &start.splats.positions[i * 3] + 3);
    passing.spans.push_back(start.times[i] - before);
    passing.spans.push_back(start.times[i] + behind);
  }
  return passing;
}

std::vector<uint32_t> allButFaintest(const ScaffoldParameters& scaffold, size_t dropped) {
  ScaffoldTape tape;
  SplatCloud cloud;
  // The scaffold outlives the decoder: nothing owns it here.
  const std::shared_ptr<const ScaffoldParameters> shared(std::shared_ptr<void>(), &scaffold);
  ScaffoldDecoder(shared).forward(scaffold, scaffold.size(), tape, cloud);
  std::vector<double> opacities(scaffold.size(), 0.0);
  for (size_t n = 0; n < tape.slots.size(); ++n) {
    opacities[tape.slots[n] / scaffold.gaussians] += static_cast<double>(cloud.opacities[n]);
  }
  std::vector<uint32_t> rows = orderOfWorth(opacities);
  rows.resize(rows.size() - std::min(dropped, rows.size()));
  std::sort(rows.begin(), rows.end());
  return rows;
}

}  // namespace stipple
