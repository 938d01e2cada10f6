// Meshes that take a shape. References: the solves and the nearest-neighbour queries of the same
// steps alone, which no implementation of the method goes without; of evening out, the factors,
// solves and landings; of images, drawing the mesh once into each by the renderer that has no
// derivatives; of images by splats, both passes of the renderer of splats.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "base/parallel.h"
#include "bench/comparison.h"
#include "fit/registration/even_sliding.h"
#include "fit/registration/picture_loss.h"
#include "fit/registration/registration_loss.h"
#include "mesh/adapt/mesh_adapter.h"
#include "mesh/adapt/point_rows.h"
#include "mesh/adapt/weighted_diffusion.h"
#include "mesh/mesh_image.h"
#include "train/backend/backend_factory.h"

namespace stipple::bench {

namespace {

constexpr size_t kPoints = 20000;
constexpr size_t kPerPoint = 4;
/// Two that even out, two that adapt and four with neither, as the schedule shares them.
constexpr uint32_t kSteps = 8;
constexpr int kRounds = 4;

struct Shape {
  std::vector<Vec3d> positions;
  std::vector<uint32_t> triangles;
};

/// A sphere of 98 rings of 102 vertices and two poles: 9,998 vertices.
Shape tenThousand() {
  constexpr uint32_t kRings = 98, kAround = 102;
  Shape shape;
  for (uint32_t ring = 0; ring < kRings; ++ring) {
    const double down = std::numbers::pi * (ring + 1) / (kRings + 1);
    for (uint32_t i = 0; i < kAround; ++i) {
      const double turn = 2 * std::numbers::pi * i / kAround;
      shape.positions.emplace_back(std::sin(down) * std::cos(turn), std::sin(down) * std::sin(turn),
                                   std::cos(down));
    }
  }
  const uint32_t top = kRings * kAround, bottom = top + 1;
  shape.positions.emplace_back(0, 0, 1);
  shape.positions.emplace_back(0, 0, -1);
  for (uint32_t i = 0; i < kAround; ++i) {
    const uint32_t next = (i + 1) % kAround, last = (kRings - 1) * kAround;
    shape.triangles.insert(shape.triangles.end(), {top, i, next});
    shape.triangles.insert(shape.triangles.end(), {bottom, last + next, last + i});
    for (uint32_t ring = 0; ring + 1 < kRings; ++ring) {
      const uint32_t a = ring * kAround + i, b = ring * kAround + next;
      shape.triangles.insert(shape.triangles.end(),
                             {a, a + kAround, b, b, a + kAround, b + kAround});
    }
  }
  return shape;
}

/// Even points of an egg with half-axes of 1, 0.7 and 0.5, and their normals.
RegistrationTarget egg() {
  RegistrationTarget target;
  const Vec3d axes(1, 0.7, 0.5);
  for (size_t i = 0; i < kPoints; ++i) {
    const double z = 1 - 2 * (static_cast<double>(i) + 0.5) / kPoints;
    const double turn = 2.399963229728653 * static_cast<double>(i), r = std::sqrt(1 - z * z);
    const Vec3d p(r * std::cos(turn), r * std::sin(turn), z);
    const Vec3d normal = p.cwiseQuotient(axes).normalized();
    for (int axis = 0; axis < 3; ++axis) {
      target.points.push_back(static_cast<float>(p[axis] * axes[axis]));
      target.normals.push_back(static_cast<float>(normal[axis]));
    }
  }
  return target;
}

void step(benchmark::State& state) {
  const Shape shape = tenThousand();
  const MeshLinks links(shape.positions.size(), shape.triangles);
  MeshAdapterOptions options;
  options.steps = kSteps;
  std::vector<std::unique_ptr<MeshAdapter>> adapters;
  for (int round = 0; round < kRounds; ++round) {
    adapters.push_back(std::make_unique<MeshAdapter>(links, shape.positions, options));
  }
  const RegistrationTarget target = egg();
  const RegistrationLoss loss(target, {}, {}, kPerPoint);
  std::vector<Vec3d> gradient(links.vertexCount());
  const Diffusion diffusion(links, 1.0, options.smoothness), smoothing(links, 0.5, 0.5);
  std::vector<double> column(links.vertexCount(), 1.0);
  std::vector<float> places(kPoints * kPerPoint * 3);
  const auto samples = spreadSamples(shape.triangles, shape.positions, kPoints * kPerPoint, 0);
  for (size_t i = 0; i < samples.size(); ++i) {
    setRow(places, i, samples[i].at(shape.triangles, shape.positions));
  }
  std::vector<uint32_t> found(kPoints);
  size_t next = 0;
  compare(
      state, "solves_and_queries",
      [&] {
        MeshAdapter& adapter = *adapters[next++ % adapters.size()];
        for (uint32_t i = 0; i < kSteps; ++i) {
          std::fill(gradient.begin(), gradient.end(), Vec3d::Zero());
          const auto matches = loss.match(links.triangles(), adapter.positions(), i);
          loss.addGradient(links.triangles(), adapter.positions(), matches, gradient);
          adapter.step(gradient);
        }
      },
      [&] {
        for (uint32_t i = 0; i < kSteps; ++i) {
          const NearestPoints tree(places);
          parallelFor(kPoints, 1024, [&](size_t begin, size_t end) {
            for (size_t p = begin; p < end; ++p) found[p] = tree.nearest(rowOf(target.points, p));
          });
          for (int solve = 0; solve < 2; ++solve) diffusion.solve(std::span<Vec3d>(gradient));
          if (i / (kSteps / 4) != 1) continue;
          for (int solve = 0; solve < 3; ++solve) smoothing.solve(std::span<double>(column));
        }
      });
  state.counters["step_ms"] = state.counters["best_ms"] / kSteps;
}

/// Steps of a mesh that is evened out: its reference is the factor, the solve and the landings of
/// the same steps.
void evenOut(benchmark::State& state) {
  Shape shape = tenThousand();
  for (Vec3d& p : shape.positions) p += Vec3d(0.6, -0.5, 0.62) * std::pow(std::max(0.0, p.z()), 4);
  const MeshLinks links(shape.positions.size(), shape.triangles);
  const SlidingSurface surface(links, shape.positions, 3.0);
  MeshAdapterOptions options;
  options.steps = kSteps;
  options.density = MeshDensity::kUniform;
  const std::vector<uint8_t> moves(links.vertexCount(), 1);
  WeightedDiffusion diffusion(links, moves);
  const std::vector<double> weights(links.vertexCount(), 1.0);
  std::vector<Vec3d> pull(links.vertexCount()), places;
  compare(
      state, "factors_and_landings",
      [&] {
        const EvenSliding slid = slideEvenly(links, shape.positions, surface, options,
                                             [](uint32_t, std::span<const Vec3d>) { return true; });
        benchmark::DoNotOptimize(slid.places.data());
      },
      [&] {
        for (uint32_t i = 0; i < kSteps; ++i) {
          diffusion.factor(weights, 1.0);
          diffusion.solve(pull);
          places = shape.positions;
          surface.land(places);
          benchmark::DoNotOptimize(surface.turned(places).data());
        }
      });
  state.counters["step_ms"] = state.counters["best_ms"] / kSteps;
}

/// A camera on a ring around the origin, at three times the radius of the sphere.
Camera onRing(size_t i, size_t count) {
  constexpr uint32_t kSide = 128;
  const double turn = 2 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(count);
  Camera camera;
  camera.width = camera.height = kSide;
  camera.fx = camera.fy = kSide;
  camera.cx = camera.cy = 0.5 * kSide;
  camera.world_to_camera.topRows<3>() << -std::sin(turn), std::cos(turn), 0, 0,  //
      0, 0, -1, 0,                                                               //
      -std::cos(turn), -std::sin(turn), 0, 3;
  return camera;
}

/// A mesh, images of it, and it a tenth smaller, which steps make larger.
struct PictureCase {
  static constexpr size_t kViews = 24;
  Shape shape = tenThousand();
  MeshLinks links{shape.positions.size(), shape.triangles};
  TriMesh mesh;
  std::vector<TargetPicture> pictures;
  std::vector<Vec3d> positions = shape.positions, gradient = shape.positions;

  PictureCase() {
    mesh.materials.resize(1);
    mesh.triangles = shape.triangles;
    for (const Vec3d& p : shape.positions) {
      for (int axis = 0; axis < 3; ++axis) mesh.positions.push_back(static_cast<float>(p[axis]));
    }
    const SurfaceColour colour(mesh);
    for (size_t i = 0; i < kViews; ++i) {
      TargetPicture picture{onRing(i, kViews), {}};
      picture.pixels.resize(size_t{picture.camera.width} * picture.camera.height * 4);
      drawMeshImage(mesh, colour, picture.camera, 1, picture.pixels);
      pictures.push_back(std::move(picture));
    }
    for (Vec3d& p : positions) p *= 0.9;
  }

  void step(PictureLoss& loss) {
    std::fill(gradient.begin(), gradient.end(), Vec3d::Zero());
    loss.addGradient(positions, 3.0, gradient);
  }
};

void pictureStep(benchmark::State& state) {
  PictureCase of;
  PictureLoss loss(of.pictures, of.links);
  const SurfaceColour colour(of.mesh);
  std::vector<float> image(of.pictures[0].pixels.size());
  compare(
      state, "draws", [&] { of.step(loss); },
      [&] {
        for (const TargetPicture& picture : of.pictures) {
          drawMeshImage(of.mesh, colour, picture.camera, 1, image);
        }
      });
}

void pictureStepBySplats(benchmark::State& state) {
  PictureCase of;
  PictureLoss loss(of.pictures, of.links);
  loss.drawSplats(*cpuBackends(), of.positions);
  const BoundSplats splats(of.links, of.positions, 3.0 / of.pictures[0].camera.fx);
  SplatCloud cloud;
  splats.place(of.positions, of.positions, cloud);
  const auto pass = cpuBackends()->makeViewPass();
  const std::vector<float> ones(of.pictures[0].pixels.size(), 1.0f);
  compare(
      state, "passes", [&] { of.step(loss); },
      [&] {
        pass->forget();
        for (const TargetPicture& picture : of.pictures) {
          pass->forward(cloud, picture.camera, boundSplatsDrawing());
          pass->setLossGradient(ones);
          pass->backward({});
        }
      });
  state.counters["splats"] = static_cast<double>(splats.count());
}

BENCHMARK(pictureStep)
    ->Name("mesh.picture_step.10k")
    ->UseManualTime()
    ->Iterations(kRounds)
    ->Unit(benchmark::kMillisecond);

BENCHMARK(pictureStepBySplats)
    ->Name("mesh.picture_splats_step.10k")
    ->UseManualTime()
    ->Iterations(kRounds)
    ->Unit(benchmark::kMillisecond);

BENCHMARK(evenOut)
    ->Name("mesh.even_out.10k")
    ->UseManualTime()
    ->Iterations(kRounds)
    ->Unit(benchmark::kMillisecond);

BENCHMARK(step)
    ->Name("mesh.adapt_steps.10k")
    ->UseManualTime()
    ->Iterations(kRounds)
    ->Unit(benchmark::kMillisecond);

}  // namespace

}  // namespace stipple::bench
