// Cuts of the tree of moving splats against all of them, over the times of their clip: beside the
// same number of splats that contribute most, and a tree of its own for every time.
//   moving_budgets ASSET [TIMES]
// TIMES: at which merges are judged, of splats that all count as seen (default: as everywhere, with
// what views see of them, and so have the trees of each time).
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <functional>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "base/stopwatch.h"
#include "decode/tree/hierarchy_decoder.h"
#include "decode/tree/moving_decoder.h"
#include "io/assets/motion_asset.h"
#include "model/moving_budgets.h"
#include "splat/render/render.h"
#include "train/loop/view_rig.h"
#include "train/loop/visibility.h"

namespace stipple {
namespace {

constexpr uint32_t kViewSize = 400;
constexpr size_t kViewCount = 4;
constexpr size_t kTimes = 9;
constexpr size_t kPlayedFrames = 24;  ///< one view of each, for what flickers

using Picture = std::vector<float>;
using CloudAt = std::function<SplatCloud(double seconds)>;

MotionCloud readMoving(const std::string& path) {
  MotionAsset asset = readMotionAsset(path);
  MotionCloud moving;
  moving.splats = std::move(asset.splats);
  moving.waves = std::move(asset.waves);
  moving.phases = std::move(asset.phases);
  moving.spins = std::move(asset.spins);
  moving.lifespans = std::move(asset.lifespans);
  moving.centres = std::move(asset.centres);
  moving.clip = {asset.begin, asset.frames_per_second, asset.frame_count, asset.window_frames,
                 asset.window_share};
  return moving;
}

Picture draw(const SplatCloud& cloud, const Camera& camera) {
  RenderOptions options;
  options.with_depth = false;
  const SplatInstance instance{&cloud};
  Picture picture = renderTiled({&instance, 1}, camera, options).colour;
  for (float& value : picture) value = std::clamp(value, 0.0f, 1.0f);
  return picture;
}

class Judge {
 public:
  explicit Judge(const MotionCloud& moving) : clip_(moving.clip) {
    ViewRigOptions rig;
    rig.rig = ViewRig::kAround;
    rig.count = kViewCount;
    rig.size = kViewSize;
    rig.seed = 1234567;
    views_ = viewsOfCloud(*cpuBackends(), splatsAt(moving, 0.5 * (clip_.begin + clip_.end())), rig);
    const CloudAt full = [&](double seconds) { return splatsAt(moving, seconds); };
    for (size_t i = 0; i < kTimes; ++i) {
      const SplatCloud cloud = full(timeOf(i, kTimes));
      for (const Camera& view : views_) wanted_.push_back(draw(cloud, view));
    }
    flicker_ = flickerOf(full);
  }

  /// PSNR over all times and views, the worst time's, and flicker over that of all splats.
  void print(const char* what, uint64_t budget, const CloudAt& cloud_at) const {
    double all = 0, most = 0;
    for (size_t i = 0; i < kTimes; ++i) {
      const SplatCloud cloud = cloud_at(timeOf(i, kTimes));
      double squared = 0;
      for (size_t v = 0; v < views_.size(); ++v) {
        const Picture seen = draw(cloud, views_[v]);
        const Picture& wanted = wanted_[i * views_.size() + v];
        double sum = 0;
        for (size_t k = 0; k < seen.size(); k += 4) {
          for (size_t c = 0; c < 3; ++c) {
            const double d = static_cast<double>(seen[k + c] - wanted[k + c]);
            sum += d * d;
          }
        }
        squared += sum / static_cast<double>(seen.size() / 4 * 3) / static_cast<double>(kViewCount);
      }
      all += squared / kTimes;
      most = std::max(most, squared);
    }
    std::printf("%-28s %8llu %7.2f %7.2f %8.3f\n", what, static_cast<unsigned long long>(budget),
                -10 * std::log10(all), -10 * std::log10(most), flickerOf(cloud_at) / flicker_);
    std::fflush(stdout);
  }

 private:
  double timeOf(size_t i, size_t count) const {
    return clip_.begin +
           (clip_.end() - clip_.begin) * static_cast<double>(i) / static_cast<double>(count - 1);
  }

  /// Mean absolute second difference of consecutive frames in the middle of the clip.
  double flickerOf(const CloudAt& cloud_at) const {
    std::vector<Picture> frames;
    double sum = 0;
    size_t count = 0;
    for (size_t i = 0; i < std::min<size_t>(kPlayedFrames, clip_.frame_count); ++i) {
      frames.push_back(draw(
          cloud_at(clip_.begin + static_cast<double>(i) / clip_.frames_per_second), views_[0]));
      if (i < 2) continue;
      for (size_t k = 0; k < frames[0].size(); ++k) {
        const float second = frames[i][k] - 2 * frames[i - 1][k] + frames[i - 2][k];
        sum += static_cast<double>(std::abs(second));
      }
      count += frames[0].size();
    }
    return count == 0 ? 1 : sum / static_cast<double>(count);
  }

  MotionClip clip_;
  std::vector<Camera> views_;
  std::vector<Picture> wanted_;  ///< [times, views]
  double flicker_ = 1;
};

/// Rows by what they contribute to images of the whole clip, the most first.
std::vector<uint32_t> byContribution(const MotionCloud& moving) {
  std::vector<double> contributions(moving.size(), 0.0);
  for (size_t i = 0; i < kTimes; ++i) {
    const double seconds = moving.clip.begin + (moving.clip.end() - moving.clip.begin) *
                                                   static_cast<double>(i) / (kTimes - 1);
    const SplatCloud cloud = splatsAt(moving, seconds);
    ViewRigOptions rig;
    rig.size = kViewSize;
    const std::vector<float> seen =
        splatVisibility(*cpuBackends(), cloud, viewsForVisibility(*cpuBackends(), cloud, rig));
    for (size_t k = 0; k < cloud.size(); ++k) {
      const auto* s = &cloud.scales[3 * k];
      const double area = std::sqrt(static_cast<double>(
          s[0] * s[0] * s[1] * s[1] + s[0] * s[0] * s[2] * s[2] + s[1] * s[1] * s[2] * s[2]));
      contributions[k] +=
          static_cast<double>(seen[k]) * area * static_cast<double>(cloud.opacities[k]);
    }
  }
  std::vector<uint32_t> rows(moving.size());
  std::iota(rows.begin(), rows.end(), 0u);
  std::stable_sort(rows.begin(), rows.end(),
                   [&](uint32_t a, uint32_t b) { return contributions[a] > contributions[b]; });
  return rows;
}

SplatCloud rowsOf(const SplatCloud& cloud, const std::vector<uint32_t>& rows, size_t count) {
  SplatCloud out;
  out.sh_degree = cloud.sh_degree;
  out.colour_space = cloud.colour_space;
  out.antialias = cloud.antialias;
  out.frame = cloud.frame;
  out.resize(count);
  const auto take = [&](const std::vector<float>& from, std::vector<float>& to, size_t stride) {
    for (size_t i = 0; i < count; ++i) {
      std::copy_n(&from[rows[i] * stride], stride, &to[i * stride]);
    }
  };
  take(cloud.positions, out.positions, 3);
  take(cloud.rotations, out.rotations, 4);
  take(cloud.scales, out.scales, 3);
  take(cloud.opacities, out.opacities, 1);
  take(cloud.sh, out.sh, cloud.shStride());
  return out;
}

void compare(const char* path, size_t times) {
  const MotionCloud moving = readMoving(path);
  const Judge judge(moving);
  MovingTreeOptions options;
  if (times > 0) options.times = times;
  Stopwatch watch;
  auto tree = std::make_shared<const MovingTree>(
      times > 0 ? buildMovingTree(moving, {}, options)
                : movingTreesByViews(cpuBackends()).treeOf(moving, nullptr));
  const double seconds = watch.seconds();
  const SplatCloud still = splatsAt(moving, moving.clip.begin);
  watch = Stopwatch();
  buildMergeTree(still, {}, {});
  std::printf("%zu splats, %u frames; tree %.2f s, of one time %.2f s\n", moving.size(),
              moving.clip.frame_count, seconds, watch.seconds());
  std::printf("%-28s %8s %7s %7s %8s\n", "", "splats", "all", "worst", "flicker");
  const MovingDecoder decoder(moving, tree);
  const std::vector<uint32_t> order = byContribution(moving);
  for (const uint64_t part : {2, 4, 8, 16}) {
    const uint64_t budget = std::max<uint64_t>(moving.size() / part, 1);
    DecodeRequest request;
    request.budget = budget;
    judge.print("moving tree", budget, [&](double at) {
      request.time = at;
      return decoder.decode(request);
    });
    if (times > 0) continue;
    judge.print("those that contribute most", budget,
                [&](double at) { return rowsOf(splatsAt(moving, at), order, budget); });
    judge.print("a tree for each time", budget, [&](double at) {
      const auto leaves = std::make_shared<const SplatCloud>(splatsAt(moving, at));
      const HierarchyDecoder each(
          leaves, std::make_shared<const MergeTree>(buildMergeTree(
                      *leaves,
                      splatVisibility(*cpuBackends(), *leaves,
                                      viewsForVisibility(*cpuBackends(), *leaves, {})),
                      {})));
      return each.decode(request);
    });
  }
}

}  // namespace
}  // namespace stipple

int main(int argc, char** argv) {
  try {
    if (argc < 2 || argc > 3) {
      std::fprintf(stderr, "usage: moving_budgets ASSET [TIMES]\n");
      return 2;
    }
    stipple::compare(argv[1], argc == 3 ? std::strtoul(argv[2], nullptr, 10) : 0);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "moving_budgets: %s\n", error.what());
    return 1;
  }
}
