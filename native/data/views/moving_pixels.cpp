#include "data/views/moving_pixels.h"

#include <algorithm>
#include <map>
#include <string>

#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kRowsPerTask = 16;

/// Of one colour, over the pixel and those around it that are inside. In: picture [H,W,3].
float meanAround(const std::vector<float>& picture, uint32_t width, uint32_t height, uint32_t x,
                 uint32_t y, size_t colour) {
  float sum = 0;
  float count = 0;
  for (uint32_t v = y > 0 ? y - 1 : 0; v <= std::min(y + 1, height - 1); ++v) {
    for (uint32_t u = x > 0 ? x - 1 : 0; u <= std::min(x + 1, width - 1); ++u) {
      sum += picture[(size_t{v} * width + u) * 3 + colour];
      count += 1;
    }
  }
  return sum / count;
}

}  // namespace

MovingPixels::MovingPixels(uint32_t width, uint32_t height)
    : width_(width),
      height_(height),
      least_(size_t{width} * height * 3),
      most_(size_t{width} * height * 3) {}

void MovingPixels::add(const std::vector<float>& picture) {
  parallelFor(height_, kRowsPerTask, [&](size_t begin, size_t end) {
    for (size_t y = begin; y < end; ++y) {
      for (uint32_t x = 0; x < width_; ++x) {
        for (size_t colour = 0; colour < 3; ++colour) {
          const float mean =
              meanAround(picture, width_, height_, x, static_cast<uint32_t>(y), colour);
          const size_t at = (y * width_ + x) * 3 + colour;
          least_[at] = count_ == 0 ? mean : std::min(least_[at], mean);
          most_[at] = count_ == 0 ? mean : std::max(most_[at], mean);
        }
      }
    }
  });
  ++count_;
}

std::vector<bool> MovingPixels::found() const {
  std::vector<bool> moves(size_t{width_} * height_);
  for (size_t i = 0; i < moves.size(); ++i) {
    for (size_t at = i * 3; at < i * 3 + 3; ++at) {
      if (most_[at] - least_[at] > kMovingDifference) moves[i] = true;
    }
  }
  return moves;
}

StillCameras::StillCameras(const ViewSource& views) : camera_of_(views.count()) {
  std::map<std::string, size_t> by_name;
  for (size_t view = 0; view < views.count(); ++view) {
    const std::string name = views.cameraName(view);
    const auto found = by_name.find(name);
    const bool is_new = name.empty() || found == by_name.end();
    if (is_new) {
      by_name[name] = cameras_.size();
      cameras_.emplace_back();
    }
    camera_of_[view] = is_new ? cameras_.size() - 1 : found->second;
    cameras_[camera_of_[view]].push_back(view);
  }
  for (std::vector<size_t>& camera : cameras_) {
    const Camera& first = views.camera(camera.front());
    bool is_still = camera.size() > 1;
    for (const size_t view : camera) {
      const Camera& other = views.camera(view);
      is_still = is_still && other.world_to_camera == first.world_to_camera &&
                 other.width == first.width && other.height == first.height &&
                 other.fx == first.fx && other.fy == first.fy && other.cx == first.cx &&
                 other.cy == first.cy;
    }
    if (!is_still) camera.clear();
    std::stable_sort(camera.begin(), camera.end(),
                     [&](size_t a, size_t b) { return views.time(a) < views.time(b); });
  }
}

std::vector<size_t> StillCameras::around(size_t view) const {
  const std::vector<size_t>& camera = cameras_[camera_of_[view]];
  const auto at =
      static_cast<size_t>(std::find(camera.begin(), camera.end(), view) - camera.begin());
  if (at == camera.size()) return {};
  const size_t count = std::min(camera.size(), kMovingFrames);
  const size_t before = std::min(at, kMovingFrames / 2);
  const size_t begin = std::min(at - before, camera.size() - count);
  return {camera.begin() + static_cast<ptrdiff_t>(begin),
          camera.begin() + static_cast<ptrdiff_t>(begin + count)};
}

}  // namespace stipple
