// Edits of whole clouds against one copy of the bytes of their result to fresh memory, on one
// thread: what any edit that gives a new cloud has to do. No targets: the ratios show changes.
// And a selection's answer to a stroke on a million splats, on two threads: beside 50 ms, which a
// hand feels as at once, and beside one pass over the bytes that every answer reads and writes.
#include <benchmark/benchmark.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "bench/comparison.h"
#include "bench/plain_file.h"
#include "bench/splat_scene.h"
#include "data/clouds/cloud_columns.h"
#include "data/clouds/cloud_selection.h"
#include "data/clouds/cloud_transform.h"
#include "mesh/floaters.h"
#include "splat/edit/cloud_merge.h"
#include "splat/edit/hole_filling.h"
#include "splat/edit/region_selection.h"

namespace stipple::bench {

namespace {

constexpr SplatCase k300k{"edit.300k", 300000, 0, 0, 3, 1.0};

/// A turn about a slanted axis and a move.
Mat4d turn() {
  Mat4d matrix = Mat4d::Identity();
  matrix.topLeftCorner<3, 3>() =
      Eigen::AngleAxisd(0.7, Vec3d(1, 2, 3).normalized()).toRotationMatrix();
  matrix.topRightCorner<3, 1>() = Vec3d(0.5, -1, 2);
  return matrix;
}

template <class Edit>
void edit(benchmark::State& state, const Edit& work) {
  const SplatCloud result = work();
  compare(
      state, "copy", [&] { benchmark::DoNotOptimize(work().positions.data()); },
      [&] { copyArrays(result); });
}

void transform(benchmark::State& state) {
  const SplatCloud& cloud = cloudOf(k300k);
  edit(state, [&] { return transformed(cloud, turn()); });
}

/// About half of the splats.
void cropBox(benchmark::State& state) {
  const SplatCloud& cloud = cloudOf(k300k);
  std::vector<float> xs;
  for (size_t i = 0; i < cloud.size(); ++i) xs.push_back(cloud.positions[i * 3]);
  std::nth_element(xs.begin(), xs.begin() + static_cast<std::ptrdiff_t>(xs.size() / 2), xs.end());
  Mat4d to_box = Mat4d::Identity() * 1e-4;
  to_box(3, 3) = 1.0;
  // The face of the box lies on the median of x.
  to_box(0, 3) = 1.0 - 1e-4 * static_cast<double>(xs[xs.size() / 2]);
  edit(state, [&] { return kept(cloud, insideBox(cloud, to_box)); });
}

void floaters(benchmark::State& state) {
  const SplatCloud& cloud = cloudOf(k300k);
  edit(state, [&] {
    FloaterReport report;
    return kept(cloud, withoutFloaters(cloud, {}, report, nullptr));
  });
}

/// The cloud as it is and once more, turned.
void merge(benchmark::State& state) {
  const SplatCloud& cloud = cloudOf(k300k);
  const std::array<SplatInstance, 2> instances = {SplatInstance{&cloud},
                                                  SplatInstance{&cloud, turn()}};
  edit(state, [&] { return merged(instances, cloud.frame); });
}

/// What a cloud is made of in Blender, and back.
void columns(benchmark::State& state) {
  const SplatCloud& cloud = cloudOf(k300k);
  std::vector<std::vector<float>> room(19, std::vector<float>(cloud.size() * 4));
  CloudColumns<float> out{room[0].data(), room[1].data(), room[2].data(), room[3].data(), {}};
  CloudColumns<const float> in{out.positions, out.rotations, out.scales, out.base, {}};
  for (size_t k = 0; k < 15; ++k) in.rest[k] = out.rest[k] = room[4 + k].data();
  edit(state, [&] {
    readColumns(cloud, out);
    return cloudFromColumns(in, cloud.size(), cloud.sh_degree);
  });
}

BENCHMARK(transform)
    ->Name("edit.transform.300k")
    ->UseManualTime()
    ->Iterations(5)
    ->Unit(benchmark::kMillisecond);
BENCHMARK(cropBox)
    ->Name("edit.crop_box.300k")
    ->UseManualTime()
    ->Iterations(5)
    ->Unit(benchmark::kMillisecond);
BENCHMARK(columns)
    ->Name("edit.columns.300k")
    ->UseManualTime()
    ->Iterations(5)
    ->Unit(benchmark::kMillisecond);
BENCHMARK(floaters)
    ->Name("edit.floaters.300k")
    ->UseManualTime()
    ->Iterations(3)
    ->Unit(benchmark::kMillisecond);
BENCHMARK(merge)
    ->Name("edit.merge.300k")
    ->UseManualTime()
    ->Iterations(3)
    ->Unit(benchmark::kMillisecond);

constexpr SplatCase kStrokeCloud{"regions.1M", 1000000, 1920, 1080, 3, 1.0};
constexpr double kStrokeMilliseconds = 50;
constexpr int kStrokeRepeats = 7;

/// What every stroke must read and write: positions, and a byte for each splat.
void passOverBytes(const SplatCloud& cloud, std::vector<uint8_t>& mask) {
  parallelFor(cloud.size(), 1 << 14, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const float* p = &cloud.positions[i * 3];
      mask[i] = p[0] + p[1] + p[2] > 0 ? 1 : 0;
    }
  });
}

Mat4d toPixels() {
  const Camera camera = cameraOf(kStrokeCloud);
  Mat4d pixels = Mat4d::Zero();
  pixels.row(0) << camera.fx, 0, camera.cx, 0;
  pixels.row(1) << 0, camera.fy, camera.cy, 0;
  pixels(2, 2) = pixels(3, 2) = 1;
  return pixels * camera.world_to_camera;
}

/// A scribble of 600 points over a third of the image, or the outline of a flower.
std::vector<float> path(bool closed) {
  std::vector<float> points;
  for (int i = 0; i < 600; ++i) {
    const double t = 2 * std::numbers::pi * i / 600;
    const double x = closed ? (300 + 60 * std::cos(9 * t)) * std::cos(t) : 400 * std::sin(3 * t);
    const double y = closed ? (300 + 60 * std::cos(9 * t)) * std::sin(t) : 300 * std::sin(7 * t);
    points.push_back(static_cast<float>(960 + x));
    points.push_back(static_cast<float>(540 + y));
  }
  return points;
}

Region regionOf(RegionKind kind, const std::vector<float>& points) {
  Region region;
  region.kind = kind;
  region.cloud_to_pixels = toPixels();
  region.points = points;
  region.radius = kind == RegionKind::kBrush ? 40 : kind == RegionKind::kSphere ? 0.5 : 0;
  region.colour = Vec3d(0.3, 0.2, 0.1);
  region.tolerance = 0.1;
  return region;
}

/// In: special: with depths of what is in front; growing: of scattered splats.
void stroke(benchmark::State& state, RegionKind kind, bool special) {
  const SplatCloud& cloud = cloudOf(kStrokeCloud);
  const std::vector<float> points = path(kind != RegionKind::kBrush);
  const std::vector<float> depths(size_t{1920} * 1080, 3.0f);
  std::vector<uint8_t> before(cloud.size(), 0), other(cloud.size());
  std::array<Region, 1> regions = {regionOf(kind, points)};
  regions[0].cloud_to_depth = cameraOf(kStrokeCloud).world_to_camera.row(2);
  if (special && kind != RegionKind::kGrow)
    regions[0].seen = {depths, 1920, 1080, Vec4d(0, 0, 1920, 1080), 0.1, true};
  withThreads(2, [&] {
    if (kind == RegionKind::kGrow && special) {
      // Scattered over the whole cloud, as a colour selects.
      for (size_t i = 0; i < before.size(); ++i) before[i] = i * 2654435761u % 1000 < 377 ? 1 : 0;
    } else if (kind == RegionKind::kGrow) {
      const std::array<Region, 1> ball = {regionOf(RegionKind::kSphere, points)};
      before = selectedByRegions(cloud, ball, before);
    }
    compareWithAll(
        state, [&] { benchmark::DoNotOptimize(selectedByRegions(cloud, regions, before).data()); },
        {{"pass", [&] { passOverBytes(cloud, other); }}});
  });
  state.counters["ratio_50_ms"] = state.counters["best_ms"] / kStrokeMilliseconds;
}

/// A hole of a tenth of the ball's radius in the ground below it: 100,000 flat splats.
void fill(benchmark::State& state) {
  SplatCloud ground;
  ground.resize(100000);
  std::vector<uint8_t> removed(ground.size(), 0), other(ground.size());
  for (size_t i = 0; i < ground.size(); ++i) {
    const auto column = static_cast<float>(i % 316), row = static_cast<float>(i / 316);
    const float shift = 0.4f * std::sin(static_cast<float>(i) * 12.9898f);
    const std::array<float, 3> place = {column + shift, row - shift, 0.05f * shift};
    std::copy_n(place.data(), 3, &ground.positions[i * 3]);
    ground.rotations[i * 4] = 1;
    std::fill_n(&ground.scales[i * 3], 3, 0.5f);
    ground.opacities[i] = 0.9f;
    removed[i] = std::hypot(place[0] - 158, place[1] - 158) < 30 ? 1 : 0;
  }
  withThreads(2, [&] {
    compareWithAll(state,
                   [&] {
                     FillReport report;
                     benchmark::DoNotOptimize(
                         holesFilled(ground, removed, {}, report, nullptr).positions.data());
                   },
                   {{"pass", [&] { passOverBytes(ground, other); }}});
  });
}

struct Stroke {
  const char* name;
  RegionKind kind;
  bool special;
};
constexpr Stroke kStrokes[] = {
    {"regions.brush.1M", RegionKind::kBrush, false},
    {"regions.brush_front.1M", RegionKind::kBrush, true},
    {"regions.lasso.1M", RegionKind::kLasso, false},
    {"regions.sphere.1M", RegionKind::kSphere, false},
    {"regions.colour.1M", RegionKind::kColour, false},
    {"regions.grow.1M", RegionKind::kGrow, false},
    {"regions.grow_scattered.1M", RegionKind::kGrow, true},
};

const bool kRegistered = [] {
  for (const Stroke& each : kStrokes) {
    benchmark::RegisterBenchmark(
        each.name, [&each](benchmark::State& state) { stroke(state, each.kind, each.special); })
        ->UseManualTime()
        ->Iterations(kStrokeRepeats)
        ->Unit(benchmark::kMillisecond);
  }
  benchmark::RegisterBenchmark("regions.fill.100k", fill)
      ->UseManualTime()
      ->Iterations(kStrokeRepeats)
      ->Unit(benchmark::kMillisecond);
  return true;
}();

}  // namespace

}  // namespace stipple::bench
