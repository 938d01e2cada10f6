#include "splat/cpu/rays/ray_tiles.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "splat/cpu/rays/ray_forms.h"
#include "splat/cpu/rays/ray_lists.h"
#include "splat/render/double_pixel.h"
#include "splat/render/pixel_passes.h"
#include "splat/render/scene.h"

// Order at a pixel: a tile takes its splats by the nearest that any of its rays may meet them, some
// at a time. What a pixel has met nearer than the next splat can be is final: it is sorted and
// blended, and a pixel that has ended asks for no more.

namespace stipple {

namespace {

constexpr size_t kSplatsAtOnce = 64;
constexpr size_t kTilesAtOnce = 8;
/// So many splats are looked at before the memory of an image is told; of fewer, all may show.
constexpr uint64_t kCountedFrom = 1 << 20;
/// Sizes of g and w over |w| above which float32 leaves too few digits: alpha would be off by more
/// than 2e-4 of itself. Only splats thinner than a quarter of a pixel, or met end-on, have such.
constexpr double kMaxReach = 200;
/// Places that are nearer to each other, relative, are compared in double.
constexpr double kPlaceDoubt = 4e-6;

/// A splat that a pixel meets and has not blended.
struct Pending {
  double place;
  double alpha;
  uint32_t splat;
};

/// Least and largest of first + per_pixel * 0..15.
std::pair<double, double> rangeOf(double first, double x, double y) {
  const double along_x = 15 * x, along_y = 15 * y;
  return {first + std::min(along_x, 0.0) + std::min(along_y, 0.0),
          first + std::max(along_x, 0.0) + std::max(along_y, 0.0)};
}

double leastSize(const std::pair<double, double>& range) {
  return std::max({range.first, -range.second, 0.0});
}

double largestSize(const std::pair<double, double>& range) {
  return std::max(std::abs(range.first), std::abs(range.second));
}

/// A splat of a tile's list.
struct Listed {
  RayTileSplat seen;
  uint32_t splat;
  float nearest;   ///< no pixel of the tile meets it nearer, metres
  float doubt;     ///< of exponents
  bool in_double;  ///< `seen` has its rows alone
};

class TileRays {
 public:
  TileRays(RayTileKernel kernel, const PlacedScene& scene, const std::vector<RayForm>& forms,
           const PassValues& pass_values, const RenderOptions& options, const RayOptions& rays,
           RenderResult& result)
      : kernel_(kernel),
        scene_(scene),
        forms_(forms),
        pass_values_(pass_values),
        options_(options),
        rays_(rays),
        result_(result),
        by_pixel_(rays.order == RayOrder::kResponse),
        passes_(hasPasses(options) ? kTilePixelCount : 0),
        hits_(kTilePixelCount) {
    // Places of affine splats are those of the picture: the centre alone is between the planes.
    const bool is_affine = rays.projection == RayProjection::kAffine;
    constexpr float kFar = std::numeric_limits<float>::max();
    near_ = is_affine ? -kFar : static_cast<float>(scene.view.near_plane);
    far_ = is_affine ? kFar : static_cast<float>(std::min(scene.view.far_plane, 3e38));
    log2_least_ = std::log2(rays.limits.least_alpha);
  }

  /// In: splats in the order of their centres.
  void draw(uint32_t x0, uint32_t y0, std::span<const uint32_t> splats) {
    x0_ = x0;
    y0_ = y0;
    width_ = std::min(kTileSide, result_.width - x0);
    height_ = std::min(kTileSide, result_.height - y0);
    openPixels();
    listed_.clear();
    for (const uint32_t splat : splats) list(splat);
    if (by_pixel_) {
      std::stable_sort(listed_.begin(), listed_.end(),
                       [](const Listed& a, const Listed& b) { return a.nearest < b.nearest; });
    }
    for (size_t begin = 0; begin < listed_.size() && open_count_ > 0; begin += kSplatsAtOnce) {
      const size_t end = std::min(begin + kSplatsAtOnce, listed_.size());
      for (size_t i = begin; i < end && open_count_ > 0; ++i) meetSplat(listed_[i]);
      if (!by_pixel_) continue;
      blendPending(end < listed_.size() ? static_cast<double>(listed_[end].nearest)
                                        : std::numeric_limits<double>::infinity());
    }
    for (uint32_t y = 0; y < height_; ++y) {
      for (uint32_t x = 0; x < width_; ++x) {
        const size_t pixel = y * kTileSide + x;
        pixels_[pixel].write(options_, indexOf(x, y), result_);
        if (passes_.empty()) continue;
        passes_[pixel].write(options_, indexOf(x, y), pixels_[pixel].ownSurfaceWeight(), result_);
      }
    }
  }

 private:
  size_t indexOf(uint32_t x, uint32_t y) const {
    return static_cast<size_t>(y0_ + y) * result_.width + x0_ + x;
  }

  void openPixels() {
    pixels_.clear();
    for (PixelPasses& passes : passes_) passes.clear();
    open_count_ = 0;
    for (uint32_t y = 0; y < kTileSide; ++y) {
      for (uint32_t x = 0; x < kTileSide; ++x) {
        const bool is_inside = x < width_ && y < height_;
        open_[y * kTileSide + x] = is_inside ? 1.0f : 0.0f;
        if (is_inside) ++open_count_;
        pixels_.emplace_back(options_, is_inside ? indexOf(x, y) : indexOf(0, 0),
                             rays_.limits.ends_early);
        hits_[y * kTileSide + x].clear();
      }
    }
  }

  void list(uint32_t splat) {
    const RayForm& f = forms_[splat];
    const double dx = x0_ + 0.5 - f.mean_x, dy = y0_ + 0.5 - f.mean_y;
    const double g0 = f.l00 * dx, g1 = f.l10 * dx + f.l11 * dy;
    const double w0 = f.t00 * dx + f.t01 * dy + f.t02, w1 = f.t11 * dy + f.t12;
    const double n = f.n + f.nx * dx + f.ny * dy;
    const double rest = f.t22 * f.t22;
    const auto g0_range = rangeOf(g0, f.l00, 0), g1_range = rangeOf(g1, f.l10, f.l11);
    const auto w0_range = rangeOf(w0, f.t00, f.t01), w1_range = rangeOf(w1, 0, f.t11);
    const auto n_range = rangeOf(n, f.nx, f.ny);
    const auto squares = [rest](double a, double b) { return a * a + b * b + rest; };
    const double least_w = squares(leastSize(w0_range), leastSize(w1_range));
    const double largest_w = squares(largestSize(w0_range), largestSize(w1_range));
    // Nowhere in the tile: |g| is at least this.
    const double least_g =
        leastSize(g0_range) * leastSize(g0_range) + leastSize(g1_range) * leastSize(g1_range);
    if (least_g > (f.log2_opacity - log2_least_ + 1e-6) * largest_w) return;

    Listed out;
    out.splat = splat;
    double nearest = n_range.first > 0 ? n_range.first / largest_w : n_range.first / least_w;
    if (!(least_w > 0) || !(nearest > f.nearest)) nearest = f.nearest;
    nearest -= kPlaceDoubt * std::abs(nearest);
    out.nearest = static_cast<float>(std::clamp(nearest, -3e38, 3e38));
    const double width = std::sqrt(least_w);
    const double largest = largestSize(g0_range) + std::abs(g1) +
                           15 * (f.l00 + std::abs(f.l10) + f.l11) + std::abs(w0) + std::abs(w1) +
                           f.t22 + 15 * (f.t00 + std::abs(f.t01) + f.t11);
    out.in_double = !(largest <= kMaxReach * width) ||
                    !(std::abs(n) + 15 * std::abs(f.nx) + 15 * std::abs(f.ny) < 1e30);
    out.seen.row_begin = 0;
    out.seen.row_end = height_;
    if (!out.in_double) {
      RayTileSplat& s = out.seen;
      const double doubt = 3e-6 * largest / width + 4e-6;
      out.doubt = static_cast<float>(doubt);
      s.g0 = static_cast<float>(g0);
      s.g1 = static_cast<float>(g1);
      s.l00 = static_cast<float>(f.l00);
      s.l10 = static_cast<float>(f.l10);
      s.l11 = static_cast<float>(f.l11);
      s.w0 = static_cast<float>(w0);
      s.w1 = static_cast<float>(w1);
      s.w00 = static_cast<float>(f.t00);
      s.w01 = static_cast<float>(f.t01);
      s.w11 = static_cast<float>(f.t11);
      s.rest = static_cast<float>(rest);
      s.n = static_cast<float>(n);
      s.nx = static_cast<float>(f.nx);
      s.ny = static_cast<float>(f.ny);
      s.log2_opacity = static_cast<float>(f.log2_opacity);
      s.log2_least = static_cast<float>(log2_least_ - doubt);
    }
    listed_.push_back(out);
  }

  void meetSplat(const Listed& listed) {
    if (listed.in_double) {
      meetInDouble(listed);
      return;
    }
    const size_t count = kernel_(listed.seen, near_, far_, open_, met_);
    const float sure = static_cast<float>(log2_least_) + listed.doubt;
    for (size_t k = 0; k < count; ++k) {
      const uint32_t pixel = met_.pixel[k];
      double alpha = static_cast<double>(met_.alpha[k]);
      if (met_.exponent[k] < sure) {
        alpha = inDouble(listed.splat, pixel).alpha;
        if (alpha < rays_.limits.least_alpha) continue;
      }
      take(listed.splat, pixel, static_cast<double>(met_.place[k]), alpha);
    }
  }

  RayMeeting inDouble(uint32_t splat, uint32_t pixel) const {
    return meet(forms_[splat], x0_ + pixel % kTileSide + 0.5, y0_ + pixel / kTileSide + 0.5);
  }

  void meetInDouble(const Listed& listed) {
    for (uint32_t pixel = 0; pixel < height_ * kTileSide; ++pixel) {
      if (open_[pixel] == 0.0f) continue;
      const RayMeeting met = inDouble(listed.splat, pixel);
      if (met.alpha < rays_.limits.least_alpha) continue;
      if (rays_.projection == RayProjection::kRay &&
          !(met.place >= scene_.view.near_plane && met.place <= scene_.view.far_plane)) {
        continue;
      }
      take(listed.splat, pixel, met.place, met.alpha);
    }
  }

  void take(uint32_t splat, uint32_t pixel, double place, double alpha) {
    alpha = std::min(alpha, rays_.limits.most_alpha);
    if (by_pixel_) {
      hits_[pixel].push_back({place, alpha, splat});
    } else {
      blend(pixel, splat, forms_[splat].depth, alpha);
    }
  }

  /// Returns false where the pixel has ended.
  bool blend(uint32_t pixel, uint32_t splat, double depth, double alpha) {
    const RayForm& form = forms_[splat];
    if (pixels_[pixel].add(alpha, form.colour, depth, form.is_holdout)) {
      if (!passes_.empty() && !form.is_holdout) {
        pass_values_.add(pixels_[pixel].weight(), splat, passes_[pixel]);
      }
      return true;
    }
    open_[pixel] = 0.0f;
    --open_count_;
    return false;
  }

  /// What pixels have met up to a place.
  void blendPending(double end) {
    for (uint32_t pixel = 0; pixel < height_ * kTileSide; ++pixel) {
      std::vector<Pending>& hits = hits_[pixel];
      if (hits.empty() || open_[pixel] == 0.0f) continue;
      sortHits(pixel, hits);
      size_t done = 0;
      while (done < hits.size() && hits[done].place < end) {
        const Pending& hit = hits[done++];
        if (!blend(pixel, hit.splat, hit.place, hit.alpha)) break;
      }
      if (open_[pixel] == 0.0f) {
        hits.clear();
      } else {
        hits.erase(hits.begin(), hits.begin() + static_cast<ptrdiff_t>(done));
      }
    }
  }

  static bool isBefore(const Pending& a, const Pending& b) {
    return a.place < b.place || (a.place == b.place && a.splat < b.splat);
  }

  void sortHits(uint32_t pixel, std::vector<Pending>& hits) const {
    std::sort(hits.begin(), hits.end(), isBefore);
    for (size_t begin = 0; begin < hits.size();) {
      size_t end = begin + 1;
      while (end < hits.size() &&
             hits[end].place - hits[end - 1].place <= kPlaceDoubt * std::abs(hits[end].place)) {
        ++end;
      }
      if (end - begin > 1) {
        for (size_t i = begin; i < end; ++i) hits[i].place = inDouble(hits[i].splat, pixel).place;
        std::sort(hits.begin() + static_cast<ptrdiff_t>(begin),
                  hits.begin() + static_cast<ptrdiff_t>(end), isBefore);
      }
      begin = end;
    }
  }

  RayTileKernel kernel_;
  const PlacedScene& scene_;
  const std::vector<RayForm>& forms_;
  const PassValues& pass_values_;
  const RenderOptions& options_;
  const RayOptions& rays_;
  RenderResult& result_;
  bool by_pixel_;
  float near_, far_;
  double log2_least_;
  uint32_t x0_ = 0, y0_ = 0, width_ = 0, height_ = 0, open_count_ = 0;
  alignas(64) float open_[kTilePixelCount];
  RayMetPixels met_;
  std::vector<Listed> listed_;
  std::vector<DoublePixel> pixels_;
  std::vector<PixelPasses> passes_;  ///< empty where none is asked for
  std::vector<std::vector<Pending>> hits_;
};

struct Forms {
  std::vector<RayForm> forms;
  std::vector<RayReach> reaches;
  PassValues pass_values;
};

template <typename Splat, typename Form, typename Reach>
Forms formsOf(const PlacedScene& scene, const RenderOptions& options,
              const std::vector<Splat>& splats, Form form, Reach reach) {
  Forms out;
  out.pass_values = passValues(scene, splats, options);
  out.forms.resize(splats.size());
  out.reaches.resize(splats.size());
  parallelFor(splats.size(), 1024, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      out.forms[i] = form(splats[i]);
      out.reaches[i] = reach(splats[i]);
    }
  });
  return out;
}

Forms formsOf(const PlacedScene& scene, const RenderOptions& options, const RayOptions& rays) {
  const double least = rays.limits.least_alpha;
  if (rays.projection == RayProjection::kAffine) {
    return formsOf(
        scene, options, affineSplats(scene, least),
        [](const AffineSplat& splat) { return rayForm(splat); },
        [](const AffineSplat& splat) { return rayReach(splat); });
  }
  return formsOf(
      scene, options, raySplats(scene, least),
      [&](const RaySplat& splat) { return rayForm(scene.view, splat); },
      [&](const RaySplat& splat) { return rayReach(scene.view, splat, least); });
}

}  // namespace

RenderResult renderRayTilesWith(RayTileKernel kernel, std::span<const SplatInstance> instances,
                                const Camera& camera, const RenderOptions& options,
                                const RayOptions& rays, Progress* progress) {
  if (!rays.areas.empty()) {
    fail(ErrorCode::kInvalidArgument, "areas are given; single precision draws whole images");
  }
  const PlacedScene scene = placeScene(instances, camera, options);
  requireOrder(scene, rays);
  advance(progress, rays.progress_begin, "Placing splats");
  const Forms forms = formsOf(scene, options, rays);
  RenderResult result;
  sizeResult(camera, options, result);
  result.visible_count = forms.forms.size();
  const TileGrid grid(camera.width, camera.height);
  std::atomic<size_t> drawn{0};
  forEachRayTileBand(forms.reaches, scene.view, grid, [&](const RayTileBand& band) {
    const size_t count = band.end_tile - band.first_tile;
    parallelFor(count, kTilesAtOnce, [&](size_t begin, size_t end) {
      // A count, not a place: threads come in any order.
      const double done =
          static_cast<double>(drawn.fetch_add(end - begin)) / static_cast<double>(grid.tileCount());
      advance(progress, rays.progress_begin + done * (rays.progress_end - rays.progress_begin),
              "Following rays");
      TileRays tile(kernel, scene, forms.forms, forms.pass_values, options, rays, result);
      for (size_t i = begin; i < end; ++i) {
        const size_t index = band.first_tile + i;
        tile.draw(static_cast<uint32_t>(index % grid.columns) * kTileSide,
                  static_cast<uint32_t>(index / grid.columns) * kTileSide, band.tile(index));
      }
    });
  });
  finishSurface(options, result);
  advance(progress, rays.progress_end, "Following rays");
  return result;
}

RenderResult renderRayTiles(std::span<const SplatInstance> instances, const Camera& camera,
                            const RenderOptions& options, const RayOptions& rays,
                            Progress* progress) {
  return renderRayTilesWith(chosenRayTileKernel(), instances, camera, options, rays, progress);
}

RenderMemory rayTileMemory(std::span<const SplatInstance> instances, const Camera& camera,
                           const RenderOptions& options, const RayOptions& rays) {
  uint64_t splats = 0;
  for (const SplatInstance& instance : instances) {
    splats += instance.cloud ? instance.cloud->size() : 0;
  }
  if (splats >= kCountedFrom) {
    splats = mostRaySplats(placeScene(instances, camera, options), rays.limits.least_alpha,
                           rays.projection == RayProjection::kAffine);
  }
  RenderMemory memory = rayMemory(splats, instances.size(), camera, options);
  // Made while the splats in their order are still there.
  memory.splat_bytes += splats * (sizeof(RayForm) + sizeof(RayReach));
  const TileGrid grid(camera.width, camera.height);
  const RayListsBound lists = rayListsBound(splats, grid);
  memory.pair_bytes = lists.pair_bytes;
  // Of each thread the list of its tile, and what its pixels have met.
  memory.other_bytes +=
      lists.other_bytes +
      threadLimit() * (splats * sizeof(Listed) +
                       kTilePixelCount * std::min<uint64_t>(splats, 1 << 14) * 2 * sizeof(Pending));
  return memory;
}

}  // namespace stipple
