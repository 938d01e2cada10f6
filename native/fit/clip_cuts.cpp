#include "fit/clip_cuts.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace stipple {

namespace {

constexpr size_t kAskedCameras = 4;
/// Of images along each side, that are compared.
constexpr uint32_t kCells = 16;
/// A cut changes an image by at least this much (of white) in the mean, by so many times the usual
/// change, and by so many times the next largest one.
constexpr double kLeastChange = 0.04;
constexpr double kTimesUsual = 6;
constexpr double kTimesNext = 2.5;
constexpr size_t kLeastFrames = 4;

/// Means over cells of an image, over black.
std::vector<double> cellsOf(const ViewPicture& picture) {
  std::vector<double> sums(size_t{kCells} * kCells * 3, 0.0);
  std::vector<double> counts(size_t{kCells} * kCells, 0.0);
  for (uint32_t y = 0; y < picture.height; ++y) {
    for (uint32_t x = 0; x < picture.width; ++x) {
      const size_t cell = size_t{y * kCells / picture.height} * kCells + x * kCells / picture.width;
      const size_t pixel = size_t{y} * picture.width + x;
      for (size_t c = 0; c < 3; ++c) {
        sums[cell * 3 + c] += static_cast<double>(picture.colour[pixel * 3 + c]);
      }
      counts[cell] += 1;
    }
  }
  for (size_t i = 0; i < sums.size(); ++i) sums[i] /= std::max(1.0, counts[i / 3]);
  return sums;
}

double changeOf(const std::vector<double>& one, const std::vector<double>& other) {
  double sum = 0;
  for (size_t i = 0; i < one.size(); ++i) sum += std::abs(one[i] - other[i]);
  return sum / static_cast<double>(one.size());
}

}  // namespace

std::optional<ClipCut> findCut(const ViewSource& views) {
  std::map<std::string, std::vector<std::pair<double, size_t>>> by_camera;
  for (size_t v = 0; v < views.count(); ++v) {
    if (!views.cameraName(v).empty()) {
      by_camera[views.cameraName(v)].emplace_back(views.time(v), v);
    }
  }
  // Largest change of any camera between two times.
  std::map<std::pair<double, double>, double> changes;
  size_t asked = 0;
  for (auto& [name, taken] : by_camera) {
    if (taken.size() < kLeastFrames || asked++ >= kAskedCameras) continue;
    std::sort(taken.begin(), taken.end());
    std::vector<double> before = cellsOf(views.load(taken.front().second));
    for (size_t i = 1; i < taken.size(); ++i) {
      std::vector<double> now = cellsOf(views.load(taken[i].second));
      double& change = changes[{taken[i - 1].first, taken[i].first}];
      change = std::max(change, changeOf(before, now));
      before = std::move(now);
    }
  }
  if (changes.size() < kLeastFrames - 1) return {};
  std::vector<double> sizes;
  for (const auto& [times, change] : changes) sizes.push_back(change);
  std::sort(sizes.begin(), sizes.end());
  const double largest = sizes.back(), usual = sizes[sizes.size() / 2];
  if (largest < kLeastChange || largest < kTimesUsual * usual ||
      largest < kTimesNext * sizes[sizes.size() - 2]) {
    return {};
  }
  for (const auto& [times, change] : changes) {
    if (change == largest) return ClipCut{times.first, times.second};
  }
  return {};
}

}  // namespace stipple
