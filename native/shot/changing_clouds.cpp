#include "shot/changing_clouds.h"

#include <algorithm>
#include <map>
#include <set>
#include <string>

#include "data/clouds/cloud_blend.h"
#include "data/clouds/cloud_bytes.h"

namespace stipple {

namespace {

constexpr size_t kNone = ~size_t{0};

/// The clouds of an instance at all steps; empty: its splats stay as they are.
std::vector<const SplatCloud*> stepsOf(std::span<const SplatInstance> instances,
                                       const Shutter& shutter, size_t instance) {
  std::vector<const SplatCloud*> steps;
  bool changes = false;
  for (size_t s = 0; s < shutter.step_count && !shutter.clouds.empty(); ++s) {
    const SplatCloud* given = shutter.clouds[s * instances.size() + instance].get();
    changes = changes || given;
    steps.push_back(given ? given : instances[instance].cloud);
  }
  if (!changes) steps.clear();
  return steps;
}

Vec3d rowOf(const SplatCloud& cloud, size_t row) {
  const float* at = &cloud.positions[3 * row];
  return {static_cast<double>(at[0]), static_cast<double>(at[1]), static_cast<double>(at[2])};
}

}  // namespace

ChangingClouds::ChangingClouds(std::span<const SplatInstance> instances, const Shutter& shutter)
    : own_(instances) {
  if (shutter.clouds.empty()) return;
  std::map<std::vector<const SplatCloud*>, size_t> known;
  track_of_.assign(instances.size(), kNone);
  for (size_t i = 0; i < instances.size(); ++i) {
    std::vector<const SplatCloud*> steps = stepsOf(instances, shutter, i);
    if (steps.empty()) continue;
    const auto [entry, is_new] = known.try_emplace(steps, tracks_.size());
    track_of_[i] = entry->second;
    if (is_new) tracks_.push_back({std::move(steps), i, {}});
  }
}

void ChangingClouds::validateValues() const {
  std::set<const SplatCloud*> read;
  for (const Track& track : tracks_) {
    for (size_t s = 0; s < track.steps.size(); ++s) {
      if (!read.insert(track.steps[s]).second) continue;
      const std::string name =
          "instance " + std::to_string(track.instance) + ": the cloud of step " + std::to_string(s);
      validate(*track.steps[s], name.c_str());
    }
  }
}

ChangingClouds::Place ChangingClouds::placeOf(double time, size_t step_count) {
  const double place = std::clamp(time, 0.0, 1.0) * static_cast<double>(step_count - 1);
  const size_t step = std::min(static_cast<size_t>(place), step_count - 1);
  return {step, place - static_cast<double>(step)};
}

void ChangingClouds::placeAt(double time, std::span<SplatInstance> instances) {
  if (tracks_.empty()) return;
  std::vector<const SplatCloud*> drawn(tracks_.size());
  for (size_t t = 0; t < tracks_.size(); ++t) {
    Track& track = tracks_[t];
    const auto [step, share] = placeOf(time, track.steps.size());
    drawn[t] = track.steps[step];
    if (share == 0 || track.steps[step + 1] == drawn[t]) continue;
    blendClouds(*drawn[t], *track.steps[step + 1], share, track.between);
    drawn[t] = &track.between;
  }
  for (size_t i = 0; i < instances.size(); ++i) {
    if (track_of_[i] == kNone) continue;
    instances[i].cloud = drawn[track_of_[i]];
    instances[i].values_are_checked = true;
  }
}

Vec3d ChangingClouds::positionAt(size_t instance, size_t row, double time) const {
  if (track_of_.empty() || track_of_[instance] == kNone) return rowOf(*own_[instance].cloud, row);
  const Track& track = tracks_[track_of_[instance]];
  const auto [step, share] = placeOf(time, track.steps.size());
  const Vec3d from = rowOf(*track.steps[step], row);
  if (share == 0) return from;
  return (1 - share) * from + share * rowOf(*track.steps[step + 1], row);
}

uint64_t ChangingClouds::memoryBound(std::span<const SplatInstance> instances,
                                     const Shutter& shutter) {
  const ChangingClouds changing(instances, shutter);
  uint64_t bytes = shutter.clouds.size() * 2 * sizeof(void*);
  for (const Track& track : changing.tracks_) {
    bytes += sizeof(Track) + cloudBytes(track.steps[0]->size(), track.steps[0]->sh_degree);
  }
  return bytes;
}

}  // namespace stipple
