#include "splat/render/ray_render.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "splat/cpu/rays/affine_splats.h"
#include "splat/render/object_order.h"
#include "splat/render/pixel_passes.h"
#include "splat/render/ray_splats.h"
#include "splat/render/scene.h"

namespace stipple {

namespace {

constexpr uint32_t kTileSide = 16;              ///< pixels
constexpr uint32_t kBlockSide = kRayBlockSide;  ///< pixels, whole tiles

struct Rectangle {
  uint32_t x0, y0, x1, y1;  ///< pixels; the ends are outside
};

/// A cone of up to all directions, or a cylinder, around the rays of a rectangle's pixels.
class Beam {
 public:
  Beam(const View<double>& view, const CameraRays& rays, const Rectangle& area) {
    if (view.is_wide) {
      aroundPixels(rays, area);
    } else {
      aroundCorners(rays, area);
    }
    // Slack for rounding; beyond a half turn there is nothing.
    angle_ = std::min(std::numbers::pi, angle_ * (1 + 1e-9));
    sine_ = std::sin(angle_);
    cosine_ = std::cos(angle_);
  }

  bool touches(const Vec3d& centre, double radius) const {
    if (is_empty_) return false;
    const Vec3d offset = centre - origin_;
    const double reach = radius + radius_;
    if (offset.squaredNorm() <= reach * reach) return true;
    const double along = offset.dot(axis_);
    const double across = (offset - along * axis_).norm();
    // Distance times the sine of the angle beyond the cone: that from its surface, where it is
    // nearest; below 0 inside.
    if (across * cosine_ - along * sine_ > reach) return false;
    // At more than a right angle beyond it, its tip is nearest.
    const double angle = std::atan2(across, along);
    return angle - angle_ < 0.5 * std::numbers::pi + 1e-9;
  }

 private:
  /// The rectangle is convex on the picture plane, so its corners are the farthest.
  void aroundCorners(const CameraRays& rays, const Rectangle& area) {
    const double x[2] = {area.x0 + 0.5, area.x1 - 0.5}, y[2] = {area.y0 + 0.5, area.y1 - 0.5};
    PixelRay middle, ray;
    rays.through(0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]), middle);
    origin_ = middle.origin;
    axis_ = middle.direction.normalized();
    is_empty_ = false;
    for (int corner = 0; corner < 4; ++corner) {
      rays.through(x[corner & 1], y[corner >> 1], ray);
      take(ray);
    }
  }

  /// A rectangle of directions may turn around a pole or the whole sphere: every pixel is asked.
  void aroundPixels(const CameraRays& rays, const Rectangle& area) {
    PixelRay ray;
    Vec3d sum = Vec3d::Zero();
    const auto for_each = [&](const auto& body) {
      for (uint32_t y = area.y0; y < area.y1; ++y) {
        for (uint32_t x = area.x0; x < area.x1; ++x) {
          if (rays.through(x + 0.5, y + 0.5, ray)) body();
        }
      }
    };
    for_each([&] {
      sum += ray.direction;
      is_empty_ = false;
    });
    const double length = sum.norm();
    origin_ = Vec3d::Zero();
    axis_ = length > 1e-9 ? Vec3d(sum / length) : Vec3d(0, 0, 1);
    for_each([&] { take(ray); });
  }

  void take(const PixelRay& ray) {
    radius_ = std::max(radius_, (ray.origin - origin_).norm());
    const double across = crossProduct(axis_, ray.direction).norm();
    angle_ = std::max(angle_, std::atan2(across, axis_.dot(ray.direction)));
  }

  Vec3d origin_, axis_;
  bool is_empty_ = true;
  double radius_ = 0;  ///< of the cylinder
  double angle_ = 0, sine_ = 0, cosine_ = 1;
};

/// A splat that shows at a pixel.
struct Hit {
  double place;
  double alpha;
  uint32_t splat;
};

/// Memory of one thread.
struct Scratch {
  std::vector<Hit> hits;
  PixelPasses passes;
};

/// A box in the picture.
class Window {
 public:
  Window(const View<double>&, const CameraRays&, const Rectangle& area)
      : x_{area.x0 + 0.5, area.x1 - 0.5}, y_{area.y0 + 0.5, area.y1 - 0.5} {}

  bool touches(double x, double y, double half_x, double half_y) const {
    return x + half_x >= x_[0] && x - half_x <= x_[1] && y + half_y >= y_[0] && y - half_y <= y_[1];
  }

 private:
  double x_[2], y_[2];
};

/// How splats are met along rays.
struct AlongRays {
  using Splat = RaySplat;
  using Area = Beam;
  using Line = PixelRay;

  static bool touches(const Beam& beam, const RaySplat& splat) {
    return beam.touches(splat.centre, splat.radius);
  }
  /// Returns false where the picture shows nothing.
  static bool lineThrough(const CameraRays& rays, double x, double y, PixelRay& ray) {
    return rays.through(x, y, ray);
  }
  /// Returns false where the splat is not between the near and the far plane.
  static bool meet(const View<double>& view, const RaySplat& splat, const PixelRay& ray,
                   double& place, double& opacity, double& half_distance) {
    const RayResponse response = respond(splat, ray.origin, ray.direction);
    if (!(response.place >= view.near_plane && response.place <= view.far_plane)) return false;
    place = response.place;
    opacity = splat.opacity;
    half_distance = 0.5 * response.squared_distance;
    return true;
  }
  static double centreDepth(const View<double>& view, const RaySplat& splat) {
    return depthOf(view, splat.centre);
  }
};

/// How they are met where each is an ellipse in the picture.
struct InPicture {
  using Splat = AffineSplat;
  using Area = Window;
  using Line = std::array<double, 2>;

  static bool touches(const Window& window, const AffineSplat& splat) {
    const Footprint<double>& f = splat.footprint;
    return window.touches(f.mean_x, f.mean_y, splat.half_x, splat.half_y);
  }
  static bool lineThrough(const CameraRays&, double x, double y, Line& pixel) {
    pixel = {x, y};
    return true;
  }
  static bool meet(const View<double>&, const AffineSplat& splat, const Line& pixel, double& place,
                   double& opacity, double& half_distance) {
    const Footprint<double>& f = splat.footprint;
    const double dx = pixel[0] - f.mean_x, dy = pixel[1] - f.mean_y;
    place = splat.depthAt(dx, dy);
    opacity = f.opacity;
    half_distance = halfSquaredDistance(f, dx, dy);
    return true;
  }
  static double centreDepth(const View<double>&, const AffineSplat& splat) { return splat.depth; }
};

template <typename Meeting>
class RayPicture {
  using Splat = typename Meeting::Splat;
  using Area = typename Meeting::Area;

 public:
  RayPicture(const PlacedScene& scene, const Camera& camera, std::vector<Splat> splats,
             const RenderOptions& options, const RayOptions& rays, RenderResult& result)
      : view_(scene.view),
        camera_rays_(camera, options.lens),
        splats_(std::move(splats)),
        pass_values_(passValues(scene, splats_, options)),
        options_(options),
        rays_(rays),
        result_(result) {}

  /// Blocks [begin, end) of a list.
  void drawBlocks(std::span<const PixelArea> blocks) {
    parallelFor(blocks.size(), 1, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) drawBlock(blocks[i].x0, blocks[i].y0);
    });
  }

 private:
  Rectangle cut(uint32_t x0, uint32_t y0, uint32_t side) const {
    return {x0, y0, std::min(x0 + side, result_.width), std::min(y0 + side, result_.height)};
  }

  void drawBlock(uint32_t x0, uint32_t y0) {
    const Rectangle block = cut(x0, y0, kBlockSide);
    const Area around(view_, camera_rays_, block);
    std::vector<uint32_t> near_block, near_tile;
    for (uint32_t i = 0; i < splats_.size(); ++i) {
      if (Meeting::touches(around, splats_[i])) near_block.push_back(i);
    }
    Scratch scratch;
    for (uint32_t y = block.y0; y < block.y1; y += kTileSide) {
      for (uint32_t x = block.x0; x < block.x1; x += kTileSide) {
        const Rectangle tile = cut(x, y, kTileSide);
        const Area narrow(view_, camera_rays_, tile);
        near_tile.clear();
        for (const uint32_t i : near_block) {
          if (Meeting::touches(narrow, splats_[i])) near_tile.push_back(i);
        }
        for (uint32_t py = tile.y0; py < tile.y1; ++py) {
          for (uint32_t px = tile.x0; px < tile.x1; ++px) drawPixel(px, py, near_tile, scratch);
        }
      }
    }
  }

  void drawPixel(uint32_t x, uint32_t y, const std::vector<uint32_t>& near_tile, Scratch& scratch) {
    std::vector<Hit>& hits = scratch.hits;
    PixelPasses& passes = scratch.passes;
    passes.clear();
    const size_t i = static_cast<size_t>(y) * result_.width + x;
    typename Meeting::Line line;
    if (!Meeting::lineThrough(camera_rays_, x + 0.5, y + 0.5, line)) {
      // Nothing comes from there, not the background either.
      RenderOptions nothing = options_;
      nothing.with_background = false;
      DoublePixel(nothing, i).write(nothing, i, result_);
      passes.write(options_, i, 0, result_);
      return;
    }
    findHits(line, near_tile, hits);
    if (rays_.order == RayOrder::kResponse) {
      std::sort(hits.begin(), hits.end(), [](const Hit& a, const Hit& b) {
        return a.place < b.place || (a.place == b.place && a.splat < b.splat);
      });
    }
    DoublePixel pixel(options_, i, rays_.limits.ends_early);
    for (const Hit& hit : hits) {
      const Splat& splat = splats_[hit.splat];
      if (!pixel.add(hit.alpha, splat.colour, hit.place, splat.is_holdout)) break;
      if (!splat.is_holdout) pass_values_.add(pixel.weight(), hit.splat, passes);
    }
    pixel.write(options_, i, result_);
    passes.write(options_, i, pixel.ownSurfaceWeight(), result_);
  }

  void findHits(const typename Meeting::Line& line, const std::vector<uint32_t>& near_tile,
                std::vector<Hit>& hits) const {
    hits.clear();
    for (const uint32_t i : near_tile) {
      const Splat& splat = splats_[i];
      double place, opacity, half_distance;
      if (!Meeting::meet(view_, splat, line, place, opacity, half_distance)) continue;
      const double full = opacity * std::exp(-half_distance);
      if (full < rays_.limits.least_alpha) continue;
      const double depth =
          rays_.order == RayOrder::kCentre ? Meeting::centreDepth(view_, splat) : place;
      hits.push_back({depth, std::min(full, rays_.limits.most_alpha), i});
    }
  }

  const View<double>& view_;
  const CameraRays camera_rays_;
  std::vector<Splat> splats_;
  const PassValues pass_values_;
  const RenderOptions& options_;
  const RayOptions& rays_;
  RenderResult& result_;
};

std::vector<PixelArea> blocksOf(const RenderResult& result, std::span<const PixelArea> areas) {
  if (!areas.empty()) return {areas.begin(), areas.end()};
  std::vector<PixelArea> blocks;
  for (uint32_t y = 0; y < result.height; y += kBlockSide) {
    for (uint32_t x = 0; x < result.width; x += kBlockSide) {
      blocks.push_back({x, y, kBlockSide, kBlockSide});
    }
  }
  return blocks;
}

template <typename Meeting>
void drawAll(const PlacedScene& scene, const Camera& camera,
             std::vector<typename Meeting::Splat> splats, const RenderOptions& options,
             const RayOptions& rays, RenderResult& result, Progress* progress) {
  result.visible_count = splats.size();
  RayPicture<Meeting> picture(scene, camera, std::move(splats), options, rays, result);
  const std::vector<PixelArea> blocks = blocksOf(result, rays.areas);
  // So that a cancel is heard ten times a second, and no thread waits long for the others.
  const size_t at_once = 4 * threadLimit();
  for (size_t first = 0; first < blocks.size(); first += at_once) {
    const double done = static_cast<double>(first) / static_cast<double>(blocks.size());
    advance(progress, rays.progress_begin + done * (rays.progress_end - rays.progress_begin),
            "Following rays");
    picture.drawBlocks({blocks.data() + first, std::min(at_once, blocks.size() - first)});
  }
}

}  // namespace

void requireOrder(const PlacedScene& scene, const RayOptions& rays) {
  if (!scene.objects_apart || rays.order == RayOrder::kCentre) return;
  fail(ErrorCode::kUnsupported,
       "objects are drawn one after the other, and splats in the order of every pixel; without "
       "global ordering only the order of their centres is allowed");
}

RayOptions unlimitedRays() {
  RayOptions rays;
  rays.limits.least_alpha = 1e-9;
  rays.limits.most_alpha = 1;
  rays.limits.ends_early = false;
  return rays;
}

RenderMemory rayMemory(std::span<const SplatInstance> instances, const Camera& camera,
                       const RenderOptions& options) {
  uint64_t splats = 0;
  for (const SplatInstance& instance : instances) {
    splats += instance.cloud ? instance.cloud->size() : 0;
  }
  return rayMemory(splats, instances.size(), camera, options);
}

RenderMemory rayMemory(uint64_t splats, size_t instance_count, const Camera& camera,
                       const RenderOptions& options) {
  RenderMemory memory;
  // Made range by range, gathered (which may double its room), sorted; and the order.
  memory.splat_bytes =
      splats * (4 * std::max(sizeof(RaySplat), sizeof(AffineSplat)) + 2 * sizeof(uint32_t));
  if (options.object_order == ObjectOrder::kApart) {
    memory.splat_bytes += splats * sizeof(uint64_t);
    memory.other_bytes += objectSortBound(splats, instance_count);
  }
  if (hasPasses(options)) memory.splat_bytes += splats * (sizeof(Vec3d) + sizeof(uint32_t));
  // Of each thread, splats near its block and its tile, and those that show at a pixel.
  memory.pair_bytes = splats * threadLimit() * 2 * (2 * sizeof(uint32_t) + sizeof(Hit));
  memory.result_bytes = renderMemory({}, camera, options).result_bytes;
  return memory;
}

RenderResult renderRays(std::span<const SplatInstance> instances, const Camera& camera,
                        const RenderOptions& options, const RayOptions& rays, Progress* progress) {
  if (rays.projection == RayProjection::kAffine) {
    requireImagePlane(camera, "the affine projection of splats");
  }
  const PlacedScene scene = placeSceneForRays(instances, camera, options);
  requireOrder(scene, rays);
  advance(progress, rays.progress_begin, "Placing splats");
  RenderResult result;
  sizeResult(camera, options, result);
  if (rays.projection == RayProjection::kRay) {
    drawAll<AlongRays>(scene, camera, raySplats(scene, rays.limits.least_alpha), options, rays,
                       result, progress);
  } else {
    drawAll<InPicture>(scene, camera, affineSplats(scene, rays.limits.least_alpha), options, rays,
                       result, progress);
  }
  finishSurface(options, result);
  advance(progress, rays.progress_end, "Following rays");
  return result;
}

}  // namespace stipple
