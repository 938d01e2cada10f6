#include "mesh/adapt/mesh_renderer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "mesh/adapt/harmonic_light.h"
#include "mesh/adapt_meshes.h"

namespace stipple {
namespace {

Camera cameraOf(uint32_t size, CameraModel model = CameraModel::kPerspective) {
  Camera camera;
  camera.model = model;
  camera.width = camera.height = size;
  camera.fx = camera.fy = model == CameraModel::kPerspective ? 1.1 * size : 0.37 * size;
  camera.cx = 0.5 * size + 0.13;  // no centre of a pixel lies on an edge of the sphere
  camera.cy = 0.5 * size - 0.07;
  camera.world_to_camera(2, 3) = 3.0;
  return camera;
}

/// A sphere with dents: parts of it hide others.
AdaptShape dented() {
  AdaptShape shape = sphere(2);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> factor(0.6, 1.0);
  for (Vec3d& p : shape.positions) p *= factor(random);
  return shape;
}

std::vector<Vec3d> randomVectors(size_t count, double low, double high) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> value(low, high);
  std::vector<Vec3d> made(count);
  for (Vec3d& v : made) v = {value(random), value(random), value(random)};
  return made;
}

double sumOf(const std::vector<double>& pixels, size_t channel) {
  double sum = 0;
  for (size_t i = channel; i < pixels.size(); i += 4) sum += pixels[i];
  return sum;
}

double dotOf(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

class MeshRendererOf : public testing::TestWithParam<CameraModel> {};

TEST_P(MeshRendererOf, DerivativesAreThoseOfFiniteDifferences) {
  const AdaptShape shape = dented();
  const Camera camera = cameraOf(40, GetParam());
  const MeshRenderer renderer(shape.triangles);
  const std::vector<Vec3d> colours = randomVectors(shape.positions.size(), 0, 1);
  std::vector<double> by_pixel(size_t{40} * 40 * 4);
  std::mt19937 random(7);
  for (double& by : by_pixel) by = std::normal_distribution<double>()(random);
  const MeshView view = renderer.draw(camera, shape.positions, colours);
  EXPECT_GT(view.outlines.size(), 80u);
  std::vector<Vec3d> by_position(shape.positions.size(), Vec3d::Zero());
  std::vector<Vec3d> by_colour = by_position;
  std::vector<double> passed_on = by_pixel;
  renderer.addGradient(view, camera, colours, passed_on, 1.0, by_position, by_colour);

  const auto lossOf = [&](const std::vector<Vec3d>& positions, const std::vector<Vec3d>& shades) {
    return dotOf(renderer.draw(camera, positions, shades).pixels, by_pixel);
  };
  // Of 198 numbers, a few have a centre of a pixel between the two places that are compared.
  constexpr double kStep = 1e-7;
  size_t apart = 0;
  double largest = 0;
  for (size_t v = 0; v < shape.positions.size(); ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<Vec3d> before = shape.positions, after = shape.positions;
      before[v][axis] -= kStep;
      after[v][axis] += kStep;
      const double difference = (lossOf(after, colours) - lossOf(before, colours)) / (2 * kStep);
      largest = std::max(largest, std::abs(difference));
      // Sums of about 100 numbers near 1 lose 1e-14, over 2e-7.
      if (std::abs(difference - by_position[v][axis]) > 1e-5 * (1 + std::abs(difference))) ++apart;
      std::vector<Vec3d> less = colours, more = colours;
      less[v][axis] -= kStep;
      more[v][axis] += kStep;
      EXPECT_NEAR(by_colour[v][axis],
                  (lossOf(shape.positions, more) - lossOf(shape.positions, less)) / (2 * kStep),
                  1e-5);
    }
  }
  EXPECT_LE(apart, 2u);
  EXPECT_GT(largest, 1.0);
}

INSTANTIATE_TEST_SUITE_P(Cameras, MeshRendererOf,
                         testing::Values(CameraModel::kPerspective, CameraModel::kOrthographic));

TEST(MeshRenderer, TheImageIsContinuousWhereTheOutlineCrossesCentres) {
  const AdaptShape shape = sphere(3);
  const MeshRenderer renderer(shape.triangles);
  const std::vector<Vec3d> white(shape.positions.size(), Vec3d::Ones());
  const Camera camera = cameraOf(48);
  std::vector<double> smooth, plain;
  for (int step = 0; step <= 200; ++step) {
    std::vector<Vec3d> positions = shape.positions;
    for (Vec3d& p : positions) p *= 0.9 + 0.0005 * step;
    const MeshView view = renderer.draw(camera, positions, white);
    smooth.push_back(sumOf(view.pixels, 3));
    plain.push_back(sumOf(view.plain, 3));
  }
  const auto unevenness = [](const std::vector<double>& sums) {
    const double even = (sums.back() - sums.front()) / static_cast<double>(sums.size() - 1);
    double largest = 0;
    for (size_t i = 1; i < sums.size(); ++i) {
      largest = std::max(largest, std::abs(sums[i] - sums[i - 1] - even));
    }
    return largest;
  };
  // About 900 pixels grow by one a step. Where steep parts of the outline end and others begin, one
  // pixel may be mixed by both or by neither.
  EXPECT_LT(unevenness(smooth), 1.0);
  EXPECT_GT(unevenness(plain), 3.0);
}

TEST(MeshRenderer, CoverageIsTheAreaAndItsDerivativeTheLengthOfTheOutline) {
  const AdaptShape shape = sphere(4);
  const Camera camera = cameraOf(96, CameraModel::kOrthographic);
  const MeshRenderer renderer(shape.triangles);
  const std::vector<Vec3d> white(shape.positions.size(), Vec3d::Ones());
  const MeshView view = renderer.draw(camera, shape.positions, white);
  const double radius = camera.fx;  // pixels
  EXPECT_NEAR(sumOf(view.pixels, 3), std::numbers::pi * radius * radius,
              0.01 * sumOf(view.pixels, 3));
  std::vector<double> by_pixel(view.pixels.size(), 0.0);
  for (size_t i = 3; i < by_pixel.size(); i += 4) by_pixel[i] = 1;
  std::vector<Vec3d> by_position(shape.positions.size(), Vec3d::Zero());
  std::vector<Vec3d> by_colour = by_position;
  renderer.addGradient(view, camera, white, by_pixel, 1.0, by_position, by_colour);
  double by_radius = 0;
  for (size_t v = 0; v < by_position.size(); ++v)
    by_radius += by_position[v].dot(shape.positions[v]);
  by_radius /= radius;
  // A ring of 96 pixels has about 230 crossings; where steep ones end and others begin, some of
  // their pixels are counted twice or never.
  EXPECT_NEAR(by_radius, 2 * std::numbers::pi * radius, 0.02 * 2 * std::numbers::pi * radius);
}

TEST(HarmonicLight, NormalsAndLightHaveTheDerivativesOfFiniteDifferences) {
  const AdaptShape shape = dented();
  const MeshLinks links(shape.positions.size(), shape.triangles);
  HarmonicLight light;
  std::mt19937 random(11);
  for (int i = 0; i < light.colours.size(); ++i) {
    light.colours.data()[i] = std::normal_distribution<double>()(random);
  }
  const std::vector<Vec3d> by_colour = randomVectors(shape.positions.size(), -1, 1);
  const auto lossOf = [&](const std::vector<Vec3d>& positions) {
    const std::vector<Vec3d> normals = vertexNormals(links, positions);
    double sum = 0;
    for (size_t v = 0; v < normals.size(); ++v) sum += by_colour[v].dot(light.on(normals[v]));
    return sum;
  };
  const std::vector<Vec3d> normals = vertexNormals(links, shape.positions);
  std::vector<Vec3d> by_normal(normals.size()), gradient(normals.size(), Vec3d::Zero());
  for (size_t v = 0; v < normals.size(); ++v) {
    EXPECT_NEAR(normals[v].norm(), 1, 1e-12);
    by_normal[v] = light.gradient(normals[v], by_colour[v]);
  }
  addNormalsGradient(links, shape.positions, by_normal, 0, gradient);
  constexpr double kStep = 1e-6;
  for (size_t v = 0; v < normals.size(); v += 5) {
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<Vec3d> before = shape.positions, after = shape.positions;
      before[v][axis] -= kStep;
      after[v][axis] += kStep;
      EXPECT_NEAR(gradient[v][axis], (lossOf(after) - lossOf(before)) / (2 * kStep), 1e-6);
    }
  }
}

TEST(HarmonicLight, IsFoundFromWhatItGives) {
  HarmonicLight light;
  std::mt19937 random(13);
  for (int i = 0; i < light.colours.size(); ++i) {
    light.colours.data()[i] = std::normal_distribution<double>()(random);
  }
  LightFit fit, half;
  EXPECT_TRUE(fit.isEmpty());
  const AdaptShape ball = sphere(3);
  for (size_t v = 0; v < ball.positions.size(); ++v) {
    LightFit& into = v % 2 == 0 ? fit : half;
    into.add(HarmonicLight::terms(ball.positions[v]), light.on(ball.positions[v]));
  }
  fit.add(half);
  // The ridge of 1e-4 of the mean pulls terms whose own share is a tenth of that by a thousandth.
  EXPECT_LT((fit.light().colours - light.colours).cwiseAbs().maxCoeff(), 0.01);
}

}  // namespace
}  // namespace stipple
