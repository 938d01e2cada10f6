#include <cstring>
#include <memory>
#include <utility>
#include <vector>

#include "api/conversions.h"
#include "api/job.h"
#include "base/parallel.h"
#include "data/clouds/cloud_selection.h"
#include "splat/edit/hole_filling.h"
#include "splat/edit/region_selection.h"

using namespace stipple;
using namespace stipple::api;

namespace {

Vec3d vectorFrom(const double* values) {
  return Eigen::Map<const Vec3d>(values);
}

/// Refuses masks that do not fit the cloud.
void requireMask(const uint8_t* mask, uint64_t mask_count, const SplatCloud& cloud) {
  require(mask, "mask");
  if (mask_count != cloud.size()) {
    fail(ErrorCode::kInvalidArgument, "mask_count is " + std::to_string(mask_count) +
                                          "; the cloud has " + std::to_string(cloud.size()) +
                                          " splats, one value each is needed");
  }
}

SeenDepths seenFrom(const StippleRegion& given) {
  SeenDepths seen;
  seen.given = given.depths != nullptr;
  if (!seen.given) return seen;
  seen.width = given.depth_width;
  seen.height = given.depth_height;
  seen.depths = {given.depths, size_t{given.depth_width} * given.depth_height};
  seen.rect = Eigen::Map<const Vec4d>(given.depth_rect);
  seen.margin = given.depth_margin;
  return seen;
}

Region regionFrom(const StippleRegion& given, const char* name) {
  const auto field = [&](const char* member) { return std::string(name) + "->" + member; };
  Region region;
  region.kind = enumValue<RegionKind>(given.kind, kLastRegionKind, field("kind").c_str());
  region.operation =
      enumValue<RegionOperation>(given.operation, kLastRegionOperation, field("operation").c_str());
  region.cloud_to_pixels = Eigen::Map<const Mat4d>(given.cloud_to_pixels);
  region.cloud_to_depth = Eigen::Map<const Vec4d>(given.cloud_to_depth);
  if (given.point_count > 0 && given.point_count <= kMaxBrushPoints) {
    region.points = {&require(given.points, field("points").c_str()), given.point_count * 2};
  } else if (given.point_count > 0) {
    fail(ErrorCode::kInvalidArgument, field("point_count") + " is " +
                                          std::to_string(given.point_count) + "; at most " +
                                          std::to_string(kMaxBrushPoints) + " are allowed");
  }
  region.radius = given.radius;
  region.seen = seenFrom(given);
  region.centre = vectorFrom(given.centre);
  region.colour = vectorFrom(given.colour);
  region.tolerance = given.tolerance;
  region.cloud_to_box = Eigen::Map<const Mat4d>(given.cloud_to_box);
  region.distance = given.distance;
  region.shrink = given.shrink != 0;
  return region;
}

std::vector<Region> regionsFrom(const StippleRegion* given, uint64_t count) {
  const StructArray<StippleRegion> list(given, count, "regions");
  StippleRegion defaults;
  stipple_region_init(&defaults);
  std::vector<Region> regions;
  for (uint64_t i = 0; i < count; ++i) {
    const std::string name = list.nameOf(i);
    regions.push_back(regionFrom(completed(list.at(i), defaults, name.c_str()), name.c_str()));
  }
  return regions;
}

FillOptions fillOptions(const StippleFillOptions* options) {
  StippleFillOptions defaults;
  stipple_fill_options_init(&defaults);
  const StippleFillOptions given = completed(options, defaults, "options");
  FillOptions settings;
  if (given.radius != 0) settings.radius = given.radius;
  if (given.ring_width != 0) settings.ring_width = given.ring_width;
  if (given.patch_size != 0) settings.patch_size = given.patch_size;
  settings.seed = given.seed;
  return settings;
}

StippleFillReport reportFrom(const FillReport& found) {
  StippleFillReport out = {};
  out.hole_count = found.hole_count;
  out.filled_count = found.filled_count;
  out.no_ring_count = found.no_ring_count;
  out.no_plane_count = found.no_plane_count;
  out.covered_count = found.covered_count;
  out.splat_count = found.splat_count;
  out.radius = found.radius;
  return out;
}

}  // namespace

extern "C" {

void stipple_region_init(StippleRegion* region) {
  if (!region) return;
  const Region defaults;
  *region = {};
  region->struct_size = sizeof(StippleRegion);
  Eigen::Map<Mat4d>(region->cloud_to_pixels) = defaults.cloud_to_pixels;
  Eigen::Map<Vec4d>(region->cloud_to_depth) = defaults.cloud_to_depth;
  Eigen::Map<Mat4d>(region->cloud_to_box) = defaults.cloud_to_box;
}

StippleStatus stipple_cloud_select_regions(const StippleCloud* cloud, const StippleRegion* regions,
                                           uint64_t region_count, uint8_t* mask,
                                           uint64_t mask_count, uint64_t* selected_count) {
  return guarded([&] {
    const SplatCloud& splats = *require(cloud, "cloud").cloud;
    const std::vector<Region> list = regionsFrom(regions, region_count);
    requireMask(mask, mask_count, splats);
    withThreads(cloud->context->thread_count, [&] {
      const std::vector<uint8_t> after = selectedByRegions(splats, list, {mask, splats.size()});
      if (!after.empty()) std::memcpy(mask, after.data(), after.size());
      if (selected_count) *selected_count = selectedCount(after);
    });
  });
}

StippleStatus stipple_cloud_selected_positions(const StippleCloud* cloud, const uint8_t* mask,
                                               uint64_t mask_count, uint64_t max_count,
                                               float* positions, uint64_t* written_count) {
  return guarded([&] {
    const SplatCloud& splats = *require(cloud, "cloud").cloud;
    requireMask(mask, mask_count, splats);
    require(written_count, "written_count");
    if (max_count > 0) require(positions, "positions");
    withThreads(cloud->context->thread_count, [&] {
      const std::vector<float> found = selectedPositions(splats, {mask, splats.size()}, max_count);
      if (!found.empty()) std::memcpy(positions, found.data(), found.size() * sizeof(float));
      *written_count = found.size() / 3;
    });
  });
}

StippleStatus stipple_region_colours(const StippleCloud* cloud, const uint64_t* indices,
                                     uint64_t count, double* colours) {
  return guarded([&] {
    const SplatCloud& splats = *require(cloud, "cloud").cloud;
    if (count == 0) return;
    const std::vector<double> found = baseColours(splats, {&require(indices, "indices"), count});
    std::memcpy(&require(colours, "colours"), found.data(), found.size() * sizeof(double));
  });
}

void stipple_fill_options_init(StippleFillOptions* options) {
  if (!options) return;
  *options = {};
  options->struct_size = sizeof(StippleFillOptions);
}

StippleStatus stipple_cloud_fill_start(const StippleCloud* cloud, const StippleFillOptions* options,
                                       const uint8_t* mask, uint64_t mask_count,
                                       StippleFillReport* report, StippleJob** job) {
  return guarded([&] {
    const auto splats = require(cloud, "cloud").cloud;
    const FillOptions settings = fillOptions(options);
    requireMask(mask, mask_count, *splats);
    const std::vector<uint8_t> removed(mask, mask + mask_count);
    require(job, "job") = startJob(cloud->context, [=](Progress& progress) -> JobResult {
      FillReport found;
      SplatCloud made = holesFilled(*splats, removed, settings, found, &progress);
      progress.throwIfCancelled();
      if (report) deliver(report, reportFrom(found), "report");
      return std::make_shared<const SplatCloud>(std::move(made));
    });
  });
}

}  // extern "C"
