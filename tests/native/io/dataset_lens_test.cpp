#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <sstream>

#include "dataset_scene.h"

namespace stipple {
namespace {

constexpr uint32_t kWidth = 160, kHeight = 120;

/// A camera model: its parameters in the order of the file, and its formula as COLMAP's
/// documentation gives it, written out anew. In: the point of the plane at distance 1. Out: pixel.
struct ModelCase {
  const char* name;
  int number;
  std::vector<double> parameters;
  std::function<Vec2d(double u, double v, const std::vector<double>& p)> project;
};

Vec2d perspective(const std::vector<double>& p, bool two, double u, double v) {
  return two ? Vec2d(p[0] * u + p[2], p[1] * v + p[3]) : Vec2d(p[0] * u + p[1], p[0] * v + p[2]);
}

Vec2d atAngle(double u, double v) {
  const double r = std::hypot(u, v);
  return r > 0 ? Vec2d(u, v) * (std::atan(r) / r) : Vec2d(u, v);
}

Vec2d brown(double u, double v, double factor, double p1, double p2) {
  const double r2 = u * u + v * v;
  return {u * factor + 2 * p1 * u * v + p2 * (r2 + 2 * u * u),
          v * factor + 2 * p2 * u * v + p1 * (r2 + 2 * v * v)};
}

std::vector<ModelCase> models() {
  const double f = 130, g = 128, fish = 62, x = 78.5, y = 61.25;
  return {
      {"SIMPLE_PINHOLE",
       0,
       {f, x, y},
       [](double u, double v, const auto& p) { return perspective(p, false, u, v); }},
      {"PINHOLE",
       1,
       {f, g, x, y},
       [](double u, double v, const auto& p) { return perspective(p, true, u, v); }},
      {"SIMPLE_RADIAL",
       2,
       {f, x, y, -0.11},
       [](double u, double v, const auto& p) {
         const double a = 1 + p[3] * (u * u + v * v);
         return perspective(p, false, u * a, v * a);
       }},
      {"RADIAL",
       3,
       {f, x, y, 0.09, 0.02},
       [](double u, double v, const auto& p) {
         const double s = u * u + v * v, a = 1 + p[3] * s + p[4] * s * s;
         return perspective(p, false, u * a, v * a);
       }},
      {"OPENCV",
       4,
       {f, g, x, y, -0.2, 0.05, 1e-3, -2e-3},
       [](double u, double v, const auto& p) {
         const double s = u * u + v * v;
         const Vec2d at = brown(u, v, 1 + p[4] * s + p[5] * s * s, p[6], p[7]);
         return perspective(p, true, at.x(), at.y());
       }},
      {"OPENCV_FISHEYE",
       5,
       {fish, fish + 1, x, y, 0.02, -0.01, 0.003, -0.001},
       [](double u, double v, const auto& p) {
         const double r = std::hypot(u, v), t = std::atan(r);
         const double seen = t + p[4] * std::pow(t, 3) + p[5] * std::pow(t, 5) +
                             p[6] * std::pow(t, 7) + p[7] * std::pow(t, 9);
         return perspective(p, true, u * seen / r, v * seen / r);
       }},
      {"FULL_OPENCV",
       6,
       {f, g, x, y, 0.1, -0.02, 1e-3, -2e-3, 0.01, 0.2, 0.03, -0.01},
       [](double u, double v, const auto& p) {
         const double s = u * u + v * v;
         const double a = (1 + p[4] * s + p[5] * s * s + p[8] * s * s * s) /
                          (1 + p[9] * s + p[10] * s * s + p[11] * s * s * s);
         const Vec2d at = brown(u, v, a, p[6], p[7]);
         return perspective(p, true, at.x(), at.y());
       }},
      {"FOV",
       7,
       {f, g, x, y, 0.85},
       [](double u, double v, const auto& p) {
         const double r = std::hypot(u, v), w = p[4];
         const double a = std::atan(2 * r * std::tan(w / 2)) / (w * r);
         return perspective(p, true, u * a, v * a);
       }},
      {"SIMPLE_RADIAL_FISHEYE",
       8,
       {fish, x, y, 0.03},
       [](double u, double v, const auto& p) {
         const Vec2d at = atAngle(u, v) * (1 + p[3] * atAngle(u, v).squaredNorm());
         return perspective(p, false, at.x(), at.y());
       }},
      {"RADIAL_FISHEYE",
       9,
       {fish, x, y, 0.03, -0.02},
       [](double u, double v, const auto& p) {
         const double s = atAngle(u, v).squaredNorm();
         const Vec2d at = atAngle(u, v) * (1 + p[3] * s + p[4] * s * s);
         return perspective(p, false, at.x(), at.y());
       }},
      {"THIN_PRISM_FISHEYE",
       10,
       {fish, fish + 1, x, y, 0.02, -0.01, 1e-3, 2e-3, 0.003, -0.001, 2e-3, -3e-3},
       [](double u, double v, const auto& p) {
         const Vec2d a = atAngle(u, v);
         const double s = a.squaredNorm();
         const double factor =
             1 + p[4] * s + p[5] * s * s + p[8] * s * s * s + p[9] * s * s * s * s;
         const Vec2d at = brown(a.x(), a.y(), factor, p[6], p[7]);
         return perspective(p, true, at.x() + p[10] * s, at.y() + p[11] * s);
       }},
      {"RAD_TAN_THIN_PRISM_FISHEYE",
       11,
       {fish, fish + 1, x, y, 0.02, -0.01, 0.003, -0.001, 0.0005, -0.0002, 1e-3, 2e-3, 1e-3, 2e-4,
        -1e-3, 3e-4},
       [](double u, double v, const auto& p) {
         const Vec2d a = atAngle(u, v);
         const double s = a.squaredNorm();
         double factor = 1;
         for (int i = 0; i < 6; ++i) factor += p[4 + i] * std::pow(s, i + 1);
         const Vec2d b = a * factor;
         const double q = b.squaredNorm();
         const double dx = p[10] * (2 * b.x() * b.x() + q) + 2 * p[11] * b.x() * b.y();
         const double dy = p[11] * (2 * b.y() * b.y() + q) + 2 * p[10] * b.x() * b.y();
         return perspective(p, true, b.x() + dx + p[12] * q + p[13] * q * q,
                            b.y() + dy + p[14] * q + p[15] * q * q);
       }},
  };
}

class DatasetLens : public DatasetScene {
 protected:
  /// A picture whose values are the places of its own pixels: interpolation leaves them exact.
  void storePlaces(const std::string& name) const {
    storeImage(name, image(
                         kWidth, kHeight, 3,
                         [](uint32_t x, uint32_t y, uint32_t c) {
                           return c == 0   ? static_cast<float>(x) + 0.5f
                                  : c == 1 ? static_cast<float>(y) + 0.5f
                                           : 1.0f;
                         },
                         Transfer::kLinear));
  }

  /// Every point of space that the given camera shows at a pixel is what the lens saw there.
  static void expectRoundTrip(const Dataset& dataset, const ModelCase& model) {
    SCOPED_TRACE(model.name);
    const Camera& camera = dataset.camera(0);
    const ViewPicture picture = dataset.load(0);
    ASSERT_EQ(picture.width, camera.width);
    size_t seen = 0, pixels = 0;
    for (uint32_t y = 0; y < camera.height; ++y) {
      for (uint32_t x = 0; x < camera.width; ++x, ++pixels) {
        if (!picture.weights.empty() && picture.weights[pixels] == 0) continue;
        const Vec2d at = model.project((x + 0.5 - camera.cx) / camera.fx,
                                       (y + 0.5 - camera.cy) / camera.fy, model.parameters);
        // The outermost half pixel has no neighbours to interpolate with.
        if (at.x() < 0.5 || at.y() < 0.5 || at.x() > kWidth - 0.5 || at.y() > kHeight - 0.5) {
          continue;
        }
        ++seen;
        ASSERT_NEAR(picture.colour[pixels * 3], at.x(), 0.01) << x << ", " << y;
        ASSERT_NEAR(picture.colour[pixels * 3 + 1], at.y(), 0.01) << x << ", " << y;
      }
    }
    EXPECT_GT(seen, pixels * 3 / 4);
  }
};

TEST_F(DatasetLens, EveryColmapModelAsTextIsUndistorted) {
  storePlaces("images/a.exr");
  for (const ModelCase& model : models()) {
    std::ostringstream line;
    line.precision(17);
    line << model.name << " " << kWidth << " " << kHeight;
    for (const double value : model.parameters) line << " " << value;
    storeColmap(line.str(), {"a.exr"});
    const auto dataset = openDataset(folder());
    EXPECT_EQ(dataset->source(0).view.camera_model, model.name);
    expectRoundTrip(*dataset, model);
  }
}

TEST_F(DatasetLens, EveryColmapModelInBinaryIsUndistorted) {
  storePlaces("images/a.exr");
  makeFolder("sparse/0");
  const auto f64 = [](ByteText& bytes, double value) { bytes.u64(std::bit_cast<uint64_t>(value)); };
  ByteText images;
  images.u64(1).u32(1);
  for (const double value : {1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0}) f64(images, value);
  images.u32(1).text("a.exr").u8(0).u64(0);
  store("sparse/0/images.bin", images.bytes);
  for (const ModelCase& model : models()) {
    ByteText cameras;
    cameras.u64(1).u32(1).u32(static_cast<uint32_t>(model.number)).u64(kWidth).u64(kHeight);
    for (const double value : model.parameters) f64(cameras, value);
    store("sparse/0/cameras.bin", cameras.bytes);
    const auto dataset = openDataset(folder());
    EXPECT_EQ(dataset->source(0).view.camera_model, model.name);
    expectRoundTrip(*dataset, model);
  }
}

TEST_F(DatasetLens, TransformsOfNerfstudioAreUndistorted) {
  storePlaces("a.exr");
  const std::string size =
      "\"fl_x\": 130, \"fl_y\": 128, \"cx\": 78.5, \"cy\": 61.25, \"w\": 160, \"h\": 120, ";
  const auto opened = [&](const std::string& keys) {
    storeTransforms(size + keys, frame("a.exr"));
    return openDataset(folder());
  };
  const std::vector<double> p = {130, 128, 78.5, 61.25};
  // Powers of r^2 up to the fourth, as nerfstudio has them.
  expectRoundTrip(
      *opened("\"camera_model\": \"OPENCV\", \"k1\": -0.1, \"k2\": 0.02, \"k3\": -0.003, \"k4\": "
              "0.001, \"p1\": 0.001, \"p2\": -0.002, "),
      {"OPENCV", 4, p, [](double u, double v, const auto& q) {
         const double s = u * u + v * v;
         const double a = 1 - 0.1 * s + 0.02 * s * s - 0.003 * s * s * s + 0.001 * s * s * s * s;
         const Vec2d at = brown(u, v, a, 0.001, -0.002);
         return perspective(q, true, at.x(), at.y());
       }});
  expectRoundTrip(*opened("\"k1\": 0.1, \"k4\": 0.2, \"k6\": 0.01, "),
                  {"rational", 6, p, [](double u, double v, const auto& q) {
                     const double s = u * u + v * v,
                                  a = (1 + 0.1 * s) / (1 + 0.2 * s + 0.01 * s * s * s);
                     return perspective(q, true, u * a, v * a);
                   }});
  for (const char* keys : {"\"camera_model\": \"OPENCV_FISHEYE\", \"k1\": 0.05, \"k4\": -0.002, ",
                           "\"is_fisheye\": true, \"k1\": 0.05, \"k4\": -0.002, "}) {
    expectRoundTrip(*opened(keys), {"fisheye", 5, p, [](double u, double v, const auto& q) {
                                      const double r = std::hypot(u, v), t = std::atan(r);
                                      const double a =
                                          (t + 0.05 * std::pow(t, 3) - 0.002 * std::pow(t, 9)) / r;
                                      return perspective(q, true, u * a, v * a);
                                    }});
  }
}

TEST_F(DatasetLens, WhatTheLensDidNotSeeDoesNotCount) {
  storeColmap("SIMPLE_RADIAL 160 120 100 80 60 0.3", {"a.exr"});
  storePlaces("images/a.exr");
  const auto dataset = openDataset(folder(), {.downscale = 2});
  const ViewPicture picture = dataset->load(0);
  ASSERT_FALSE(picture.weights.empty());
  EXPECT_EQ(picture.weights.front(), 0.0f);
  EXPECT_EQ(picture.weights.back(), 0.0f);
  const size_t middle = picture.height / 2 * picture.width + picture.width / 2;
  EXPECT_EQ(picture.weights[middle], 1.0f);
  // The third channel is 1 wherever something counts: blank pixels have no part in a mean.
  for (size_t i = 0; i < picture.weights.size(); ++i) {
    if (picture.weights[i] > 0) {
      ASSERT_NEAR(picture.colour[i * 3 + 2], 1.0f, 1e-6f);
    }
  }
}

TEST_F(DatasetLens, ALensThatCannotBeUndistortedIsNamed) {
  storeColmap("SIMPLE_RADIAL 160 120 100 -50 60 0.3", {"a.exr"});
  storePlaces("images/a.exr");
  expectError(ErrorCode::kUnsupported, {"images/a.exr", "principal point"},
              [&] { openDataset(folder()); });
}

}  // namespace
}  // namespace stipple
