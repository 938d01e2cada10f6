#include "model/moving_budgets.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "train/loop/view_rig.h"
#include "train/loop/visibility.h"

namespace stipple {

namespace {

/// Times at which splats are looked at, the middles of equal parts of the clip.
constexpr uint32_t kLooks = 4;
/// Opacities below this count as it: a splat that nobody sees at any time has a visibility, too.
constexpr double kLeastWeight = 1e-6;

/// The mean over the clip, by how much of a splat there is at each time.
std::vector<float> visibilityOverTime(const BackendFactory& backends, const MotionCloud& moving,
                                      Progress* progress) {
  const size_t count = moving.size();
  const uint32_t looks = std::min(kLooks, moving.clip.frame_count);
  std::vector<double> seen(count, 0.0), shown(count, 0.0);
  for (uint32_t look = 0; look < looks; ++look) {
    const double part = (look + 0.5) / looks;
    const SplatCloud cloud =
        splatsAt(moving, moving.clip.begin + part * (moving.clip.end() - moving.clip.begin));
    const std::vector<Camera> views = viewsForVisibility(backends, cloud, ViewRigOptions());
    const std::vector<float> now = splatVisibility(backends, cloud, views, progress);
    for (size_t i = 0; i < count; ++i) {
      const double weight = static_cast<double>(cloud.opacities[i]) + kLeastWeight;
      seen[i] += weight * static_cast<double>(now[i]);
      shown[i] += weight;
    }
  }
  std::vector<float> visibility(count);
  for (size_t i = 0; i < count; ++i) {
    visibility[i] = static_cast<float>(std::clamp(seen[i] / shown[i], 0.0, 1.0));
  }
  return visibility;
}

}  // namespace

MovingTreeSource movingTreesByViews(std::shared_ptr<const BackendFactory> backends) {
  if (!backends) return {};
  MovingTreeSource source;
  source.build = [backends](const MotionCloud& moving, Progress* progress) {
    const std::vector<float> visibility = visibilityOverTime(*backends, moving, progress);
    return buildMovingTree(moving, visibility, {}, progress);
  };
  source.memory_bound = [backends](const MotionCloud& moving) {
    // The images are over when the tree begins; the cloud of a time and two sums are beside them.
    const uint64_t looks =
        visibilityMemoryBound(*backends, moving.splats, ViewRigOptions().size) +
        moving.size() * (sizeof(float) * (12 + moving.splats.shStride()) + 2 * sizeof(double));
    const uint64_t tree = movingTreeMemoryBound(moving.size(), moving.splats.sh_degree) +
                          moving.size() * sizeof(float);
    return std::max(looks, tree);
  };
  return source;
}

}  // namespace stipple
