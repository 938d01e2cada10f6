// Based on: Lu, Yu, Xu, Xiangli, Wang, Lin, Dai, Scaffold-GS: Structured 3D Gaussians for
// View-Adaptive Rendering, CVPR 2024, section 3.4, by its released program.
#include "densify/anchors/anchor_growth.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/error.h"
#include "base/random.h"

namespace stipple {

namespace {

/// Beyond it, whole numbers in doubles are not exact: such a cell has no neighbours.
constexpr double kFarthestCell = 0x1p52;
/// Of the image's size, beyond its border: splats there reach into it.
constexpr double kBorder = 0.15;

using Cell = std::array<int64_t, 3>;

Cell cellOf(const float* place, double side) {
  Cell cell;
  for (size_t axis = 0; axis < 3; ++axis) {
    cell[axis] = std::llround(
        std::clamp(static_cast<double>(place[axis]) / side, -kFarthestCell, kFarthestCell));
  }
  return cell;
}

/// A slot that asks for an anchor in its cell.
struct Asking {
  Cell cell;
  float pull;
  uint32_t anchor;
};

/// An anchor to be, with what it is judged by where there is no room for all.
struct Found {
  GrownAnchor anchor;
  float pull;
};

template <class T>
void takeRows(std::vector<T>& values, size_t stride, const std::vector<uint32_t>& rows) {
  std::vector<T> taken(rows.size() * stride);
  for (size_t i = 0; i < rows.size(); ++i) {
    std::copy_n(&values[rows[i] * stride], stride, &taken[i * stride]);
  }
  values.swap(taken);
}

/// Slots whose mean pull is above the threshold of a depth and who win their throw.
std::vector<Asking> askingSlots(const AnchorGround& ground, const AnchorStatistics& statistics,
                                const AnchorGrowthOptions& options, uint32_t depth, double side) {
  const double least = options.least_drawn * static_cast<double>(ground.window);
  const double threshold = options.threshold * std::exp2(depth);
  const double share = 1 - std::exp2(-static_cast<double>(depth + 1));
  std::vector<Asking> asking;
  for (size_t slot = 0; slot < statistics.drawn.size(); ++slot) {
    if (statistics.drawn[slot] == 0 || !(statistics.drawn[slot] > least)) continue;
    const auto anchor = static_cast<uint32_t>(slot / ground.gaussians);
    const double weight =
        ground.weights.empty() ? 1.0 : static_cast<double>(ground.weights[anchor]);
    const double pull = weight * static_cast<double>(statistics.gradient_sums[slot]) /
                        static_cast<double>(statistics.drawn[slot]);
    if (!(pull >= threshold)) continue;
    const uint64_t bits = keyedBits(mixBits(ground.seed ^ depth), RandomUse::kDensifyChoice,
                                    (ground.iteration << 32) ^ slot);
    if (unitDouble(bits) >= share) continue;
    asking.push_back({cellOf(&ground.centres[slot * 3], side), static_cast<float>(pull), anchor});
  }
  return asking;
}

std::vector<Cell> takenCells(const AnchorGround& ground, const std::vector<Found>& found,
                             double side) {
  std::vector<Cell> taken;
  taken.reserve(ground.positions.size() / 3 + found.size());
  for (size_t i = 0; i < ground.positions.size(); i += 3) {
    taken.push_back(cellOf(&ground.positions[i], side));
  }
  for (const Found& one : found) taken.push_back(cellOf(one.anchor.position.data(), side));
  std::sort(taken.begin(), taken.end());
  return taken;
}

Found anchorOf(std::span<const Asking> askers, double side) {
  Found found;
  found.pull = 0;
  found.anchor.length = static_cast<float>(side);
  for (size_t axis = 0; axis < 3; ++axis) {
    found.anchor.position[axis] =
        static_cast<float>(static_cast<double>(askers.front().cell[axis]) * side);
  }
  for (const Asking& one : askers) {
    found.pull = std::max(found.pull, one.pull);
    // Askers of a cell are in the order of their anchors.
    if (found.anchor.sources.empty() || found.anchor.sources.back() != one.anchor) {
      found.anchor.sources.push_back(one.anchor);
    }
  }
  return found;
}

}  // namespace

void AnchorStatistics::resize(size_t anchors, size_t gaussians) {
  gradient_sums.resize(anchors * gaussians, 0.0f);
  drawn.resize(anchors * gaussians, 0);
  opacity_sums.resize(anchors, 0.0f);
  seen.resize(anchors, 0);
}

void AnchorStatistics::add(const ViewStatistics& view, std::span<const uint32_t> slots,
                           std::span<const float> opacities, std::span<const uint8_t> in_view) {
  const size_t gaussians = drawn.size() / std::max<size_t>(1, seen.size());
  if (view.visible.size() != slots.size() || in_view.size() != seen.size() || gaussians == 0) {
    fail(ErrorCode::kInternal, "statistics of anchors are of another number of splats");
  }
  const std::span<const float> gradients = view.of(Statistic::kScreenGradients);
  const float half_width = 0.5f * static_cast<float>(view.width);
  const float half_height = 0.5f * static_cast<float>(view.height);
  for (size_t n = 0; n < slots.size(); ++n) {
    const size_t anchor = slots[n] / gaussians;
    if (in_view[anchor]) opacity_sums[anchor] += opacities[n];
    if (!view.visible[n]) continue;
    gradient_sums[slots[n]] +=
        std::hypot(gradients[n * 2] * half_width, gradients[n * 2 + 1] * half_height);
    ++drawn[slots[n]];
  }
  for (size_t a = 0; a < seen.size(); ++a) seen[a] += in_view[a];
}

void AnchorStatistics::keep(const std::vector<uint32_t>& rows, size_t gaussians) {
  takeRows(gradient_sums, gaussians, rows);
  takeRows(drawn, gaussians, rows);
  takeRows(opacity_sums, 1, rows);
  takeRows(seen, 1, rows);
}

bool isInView(const Camera& camera, const float* place) {
  const Vec3d at =
      (camera.world_to_camera * Vec4d(static_cast<double>(place[0]), static_cast<double>(place[1]),
                                      static_cast<double>(place[2]), 1.0))
          .head<3>();
  if (!hasImagePlane(camera)) return true;
  if (!(at.z() > camera.near_plane && at.z() < camera.far_plane)) return false;
  const double depth = camera.model == CameraModel::kPerspective ? at.z() : 1.0;
  const double x = camera.fx * at.x() / depth + camera.cx;
  const double y = camera.fy * at.y() / depth + camera.cy;
  const double width = camera.width, height = camera.height;
  return x > -kBorder * width && x < (1 + kBorder) * width && y > -kBorder * height &&
         y < (1 + kBorder) * height;
}

std::vector<GrownAnchor> grownAnchors(const AnchorGround& ground,
                                      const AnchorStatistics& statistics,
                                      const AnchorGrowthOptions& options) {
  std::vector<Found> found;
  for (uint32_t depth = 0; depth < options.depths; ++depth) {
    const double side = ground.voxel * options.largest_cell /
                        std::pow(options.division, static_cast<double>(depth));
    std::vector<Asking> asking = askingSlots(ground, statistics, options, depth, side);
    std::stable_sort(asking.begin(), asking.end(),
                     [](const Asking& a, const Asking& b) { return a.cell < b.cell; });
    const std::vector<Cell> taken = takenCells(ground, found, side);
    for (size_t begin = 0; begin < asking.size();) {
      size_t end = begin + 1;
      while (end < asking.size() && asking[end].cell == asking[begin].cell) ++end;
      if (!std::binary_search(taken.begin(), taken.end(), asking[begin].cell)) {
        found.push_back(anchorOf({&asking[begin], end - begin}, side));
      }
      begin = end;
    }
  }
  if (found.size() > ground.most_new) {
    std::stable_sort(found.begin(), found.end(),
                     [](const Found& a, const Found& b) { return a.pull > b.pull; });
    found.erase(found.begin() + static_cast<std::ptrdiff_t>(ground.most_new), found.end());
  }
  std::vector<GrownAnchor> grown;
  grown.reserve(found.size());
  for (Found& one : found) grown.push_back(std::move(one.anchor));
  return grown;
}

std::vector<uint32_t> lastingAnchors(uint64_t window, AnchorStatistics& statistics,
                                     const AnchorGrowthOptions& options) {
  const double least = options.least_seen * static_cast<double>(window);
  std::vector<uint32_t> rows;
  for (size_t a = 0; a < statistics.anchorCount(); ++a) {
    const double seen = static_cast<double>(statistics.seen[a]);
    const bool is_judged = seen > least;
    const bool is_faint =
        is_judged && static_cast<double>(statistics.opacity_sums[a]) < options.least_opacity * seen;
    if (!is_faint) rows.push_back(static_cast<uint32_t>(a));
    if (!is_judged) continue;
    statistics.seen[a] = 0;
    statistics.opacity_sums[a] = 0;
  }
  return rows;
}

}  // namespace stipple
