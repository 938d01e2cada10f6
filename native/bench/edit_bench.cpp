// Edits of whole clouds against one copy of the bytes of their result to fresh memory, on one
// thread: what any edit that gives a new cloud has to do. No targets: the ratios are yardsticks.
#include <benchmark/benchmark.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <vector>

#include "bench/comparison.h"
#include "bench/plain_file.h"
#include "bench/splat_scene.h"
#include "data/clouds/cloud_columns.h"
#include "data/clouds/cloud_selection.h"
#include "data/clouds/cloud_transform.h"
#include "mesh/floaters.h"
#include "splat/edit/cloud_merge.h"

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

}  // namespace

}  // namespace stipple::bench
