#include "io/views/series_choice.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace stipple {

namespace {

/// Cameras in an order in which neighbours of the set are far apart: steps of the golden ratio,
/// made coprime to the count, so that all come before any comes again.
std::vector<size_t> turnsOf(size_t camera_count) {
  size_t step = std::max<size_t>(
      1, static_cast<size_t>(std::lround(0.6180339887498949 * static_cast<double>(camera_count))));
  while (std::gcd(step, camera_count) != 1) ++step;
  std::vector<size_t> turns(camera_count);
  for (size_t i = 0; i < camera_count; ++i) turns[i] = i * step % camera_count;
  return turns;
}

}  // namespace

std::vector<size_t> evenChoice(const std::vector<SeriesPlace>& places, uint64_t most) {
  std::vector<size_t> order(places.size());
  std::iota(order.begin(), order.end(), size_t{0});
  if (places.size() <= most) return order;
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return places[a].frame < places[b].frame; });
  size_t camera_count = 0;
  for (const SeriesPlace& place : places) camera_count = std::max(camera_count, place.camera + 1);
  // Cameras that wait for their turn, the next one first.
  std::vector<size_t> waiting = turnsOf(camera_count);
  std::vector<std::vector<size_t>> of_camera(camera_count);
  std::vector<size_t> chosen;
  for (size_t begin = 0; begin < order.size();) {
    size_t end = begin;
    while (end < order.size() && places[order[end]].frame == places[order[begin]].frame) {
      of_camera[places[order[end]].camera].push_back(order[end]);
      ++end;
    }
    // By images so far, so that frames of few images lose their share only.
    const uint64_t wanted = end * most / order.size();
    for (size_t i = 0; chosen.size() < wanted;) {
      const size_t camera = waiting[i];
      if (of_camera[camera].empty()) {
        i = (i + 1) % camera_count;
        continue;
      }
      chosen.push_back(of_camera[camera].front());
      of_camera[camera].erase(of_camera[camera].begin());
      // The next one moves up to where this one was.
      waiting.erase(waiting.begin() + static_cast<ptrdiff_t>(i));
      waiting.push_back(camera);
    }
    for (size_t k = begin; k < end; ++k) of_camera[places[order[k]].camera].clear();
    begin = end;
  }
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

}  // namespace stipple
