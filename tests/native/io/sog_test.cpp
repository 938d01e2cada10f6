#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include "base/parallel.h"
#include "io/splats/sog_file.h"
#include "io/splats/splat_file.h"
#include "random_cloud.h"
#include "scratch_folder.h"
#include "sog_scene.h"

namespace stipple {
namespace {

class Sog : public ScratchFolder {
 protected:
  SplatCloud read(const SogScene& scene) {
    scene.store(folder_ / "scene");
    return readSog(path("scene"), nullptr);
  }
  void refused(const SogScene& scene, std::initializer_list<const char*> texts,
               ErrorCode code = ErrorCode::kFormat) {
    expectError(code, texts, [&] { read(scene); });
  }
  std::string archive(const SogScene& scene, bool deflated = false) {
    ZipBytes zip;
    for (const auto& [name, bytes] : scene.files) zip.add(name, bytes, deflated);
    return zip.text();
  }
  SplatCloud roundTrip(const SplatCloud& cloud, const SogOptions& options = {}) {
    writeSog(cloud, path("trip.sog"), options, nullptr);
    return readSog(path("trip.sog"), nullptr);
  }
};

/// In input order, so that splats can be compared one by one.
constexpr SogOptions kUnsorted = {.palette_rounds = 4, .sort = false};

/// A stored component of a quaternion is off by h = sqrt 2 / 255 / 2 at most, three by sqrt 3 h;
/// the fourth follows from the length and, being at least 1/2, at most doubles that; an angle is
/// twice it.
const double kRotationBound = 4.0 * std::sqrt(3.0) * std::sqrt(2.0) / 510.0;

/// Appended one by one: GCC 12 sees trouble in a sum of texts that is none.
std::string quoted(const std::string& text) {
  return std::string(1, '"').append(text).append(1, '"');
}

double angleBetween(const float* a, const float* b) {
  double dot = 0;
  for (int k = 0; k < 4; ++k) dot += double(a[k]) * double(b[k]);
  return 2.0 * std::acos(std::min(1.0, std::abs(dot)));
}

void expectHandMade(const SplatCloud& cloud) {
  validate(cloud, "cloud");
  ASSERT_EQ(cloud.size(), 2u);
  ASSERT_EQ(cloud.sh_degree, 1);
  // Codes 0, 65535 and 0x1234 = 4660 of -1..1, 0..2, -2..3 in log space; then 65535, 0x7fff = 32767
  // and 0x3412 = 13330.
  const auto place = [](double low, double high, double code) {
    const double v = low + (high - low) * code / 65535.0;
    return static_cast<float>(std::copysign(std::exp(std::abs(v)) - 1.0, v));
  };
  const float expected[] = {place(-1, 1, 0),     place(0, 2, 65535), place(-2, 3, 4660),
                            place(-1, 1, 65535), place(0, 2, 32767), place(-2, 3, 13330)};
  // Two roundings to float32, and e^x - 1 in two ways.
  for (size_t i = 0; i < 6; ++i) EXPECT_FLOAT_EQ(cloud.positions[i], expected[i]) << i;
  const size_t stride = cloud.shStride();
  EXPECT_EQ(stride, 12u);
  // Bytes 255, 0, 128 after w: x = 1/sqrt 2, y = -1/sqrt 2, z = (256/255 - 1)/sqrt 2, and w is what
  // is left, nothing; the stored components are longer than 1 together by a little.
  const double z = (256.0 / 255.0 - 1.0) * M_SQRT1_2;
  const double length = std::sqrt(1.0 + z * z);
  const double first[] = {0.0, M_SQRT1_2 / length, -M_SQRT1_2 / length, z / length};
  // 51, 102, 204 with y the largest: w = -0.6, x = -0.2, z = 0.6 over sqrt 2.
  const double second[] = {-0.6 * M_SQRT1_2, -0.2 * M_SQRT1_2,
                           std::sqrt(1.0 - (0.36 + 0.04 + 0.36) / 2.0), 0.6 * M_SQRT1_2};
  for (size_t k = 0; k < 4; ++k) {
    // Float32 rounding of numbers up to 1.
    EXPECT_NEAR(cloud.rotations[k], first[k], 6e-8) << k;
    EXPECT_NEAR(cloud.rotations[4 + k], second[k], 6e-8) << k;
  }
}

TEST_F(Sog, ReadsAHandMadeSceneOfVersion2) {
  const SplatCloud cloud = read(SogScene::second());
  expectHandMade(cloud);
  for (size_t axis = 0; axis < 3; ++axis) {
    const double first[] = {0, 1, -1};
    const double second[] = {-8, 7.9375, 0};
    EXPECT_EQ(cloud.scales[axis], static_cast<float>(std::exp(first[axis])));
    EXPECT_EQ(cloud.scales[3 + axis], static_cast<float>(std::exp(second[axis])));
  }
  EXPECT_EQ(cloud.opacities[0], 0.2f);
  EXPECT_EQ(cloud.opacities[1], 1.0f);
  // codebook[b] is b / 64 - 2 in six decimals, exact; (b - 128) / 100 as it is parsed.
  const float first[] = {-2.0f,  -1.0f,  1.984375f, -1.28f, -1.27f, -1.26f,
                         -1.25f, -1.24f, -1.23f,    -1.22f, -1.21f, -1.20f};
  const float second[] = {0.0f, 1.0f, -1.984375f, 0, 0, 0, 0, 0, 0, 1.27f, 1.26f, 1.25f};
  for (size_t k = 0; k < 12; ++k) {
    EXPECT_EQ(cloud.sh[k], first[k]) << k;
    EXPECT_EQ(cloud.sh[12 + k], second[k]) << k;
  }
  EXPECT_EQ(cloud.antialias, Antialias::kClassic);
}

TEST_F(Sog, ReadsAHandMadeSceneOfVersion1) {
  const SplatCloud cloud = read(SogScene::first());
  expectHandMade(cloud);
  const auto step = [](double low, double high, double code) {
    return static_cast<float>(low + (high - low) * code / 255.0);
  };
  EXPECT_EQ(cloud.scales[0], static_cast<float>(std::exp(double(step(-5, 0, 128)))));
  EXPECT_EQ(cloud.scales[1], static_cast<float>(std::exp(double(step(-4, 1, 144)))));
  EXPECT_EQ(cloud.scales[2], static_cast<float>(std::exp(double(step(-3, 2, 112)))));
  EXPECT_EQ(cloud.sh[0], -2.0f);
  EXPECT_EQ(cloud.sh[1], step(-1, 1, 64));
  EXPECT_EQ(cloud.sh[2], 1.0f);
  EXPECT_EQ(cloud.sh[3], -1.0f);
  EXPECT_EQ(cloud.sh[4], step(-1, 2, 1));
  // Opacity is a logit: 51/255 of -5..10 is -2.
  EXPECT_EQ(cloud.opacities[0], static_cast<float>(1.0 / (1.0 + std::exp(2.0))));
}

TEST_F(Sog, ReadsFolderMetaAndZipsAlike) {
  const SogScene scene = SogScene::second();
  const SplatCloud folder = read(scene);
  for (const std::string& name :
       {path("scene/meta.json"), store("stored.sog", archive(scene)),
        store("deflated.sog", archive(scene, true)), store("other name", archive(scene))}) {
    SCOPED_TRACE(name);
    const SplatCloud cloud = readSog(name, nullptr);
    EXPECT_EQ(cloud.positions, folder.positions);
    EXPECT_EQ(cloud.sh, folder.sh);
  }
}

TEST_F(Sog, KnowsTheModel) {
  SogScene scene = SogScene::second();
  scene.replace("\"count\":2", "\"model\":\"antialiased\",\"count\":2");
  EXPECT_EQ(read(scene).antialias, Antialias::kMip);
  scene.replace("antialiased", "2dgs");
  const SplatCloud flat = read(scene);
  EXPECT_EQ(flat.scales[2], 1e-3f * flat.scales[0]);
  scene.replace("2dgs", "square");
  refused(scene, {"meta.json", "'model'", "square", "antialiased"}, ErrorCode::kUnsupported);
}

TEST_F(Sog, ReadsCodebooksWithoutTheirFirstNumber) {
  SogScene scene = SogScene::second();
  scene.files["sh0.webp"] = SogScene::webp({{0, 0, 0, 51}, {128, 192, 1, 255}});
  scene.replace("\"sh0\":{\"codebook\":[-2.000000,", "\"sh0\":{\"codebook\":[null,");
  // One step of (codebook[255] - codebook[1]) / 255 below the second number.
  EXPECT_EQ(read(scene).sh[0], static_cast<float>(-1.984375 - (1.984375 + 1.984375) / 255.0));
}

TEST_F(Sog, RoundTripsWithinHalfAStep) {
  const SplatCloud cloud = randomCloud(1500, 3, 1);
  const SplatCloud back = roundTrip(cloud, kUnsorted);
  validate(back, "back");
  ASSERT_EQ(back.size(), cloud.size());
  ASSERT_EQ(back.sh_degree, 3);
  for (size_t axis = 0; axis < 3; ++axis) {
    double low = INFINITY, high = -INFINITY;
    const auto logarithm = [](float x) { return std::copysign(std::log1p(std::abs(x)), x); };
    for (size_t i = axis; i < cloud.positions.size(); i += 3) {
      low = std::min<double>(low, logarithm(cloud.positions[i]));
      high = std::max<double>(high, logarithm(cloud.positions[i]));
    }
    // Half of 1/65535 in log space, and float32's rounding of the logarithms above.
    const double half = 0.5 * (high - low) / 65535.0 + 1e-6;
    for (size_t i = axis; i < cloud.positions.size(); i += 3) {
      ASSERT_NEAR(logarithm(back.positions[i]), logarithm(cloud.positions[i]), half);
    }
  }
  for (size_t i = 0; i < cloud.size(); ++i) {
    ASSERT_LE(angleBetween(&back.rotations[i * 4], &cloud.rotations[i * 4]), kRotationBound);
    ASSERT_NEAR(back.opacities[i], cloud.opacities[i], 0.5 / 255.0 + 1e-7);
  }
}

TEST_F(Sog, ErrsLessThanEvenStepsWould) {
  const SplatCloud cloud = randomCloud(3000, 1, 2);
  const SplatCloud back = roundTrip(cloud, kUnsorted);
  // The mean squared error of 256 even steps over the values' range is its square / 256^2 / 12.
  double scale = 0, colour = 0;
  for (size_t i = 0; i < cloud.scales.size(); ++i) {
    scale += std::pow(std::log(double(back.scales[i]) / double(cloud.scales[i])), 2);
  }
  const double scale_step = 7.0 * std::log(10.0) / 256.0;
  EXPECT_LT(scale / double(cloud.scales.size()), scale_step * scale_step / 12.0);
  for (size_t i = 0; i < cloud.size(); ++i) {
    for (size_t c = 0; c < 3; ++c) {
      colour += std::pow(double(back.sh[i * 12 + c]) - double(cloud.sh[i * 12 + c]), 2);
    }
  }
  // Normal numbers: 9000 of them span at least 6.
  EXPECT_LT(colour / double(cloud.size() * 3), 6.0 * 6.0 / 65536.0 / 12.0);
  // 2048 vectors of a palette for 3000 splats whose harmonics are pure noise, nine numbers each:
  // the rest is far below the noise itself, whose variance is 1.
  double rest = 0;
  for (size_t i = 0; i < cloud.size(); ++i) {
    for (size_t k = 3; k < 12; ++k) {
      rest += std::pow(double(back.sh[i * 12 + k]) - double(cloud.sh[i * 12 + k]), 2);
    }
  }
  EXPECT_LT(rest / double(cloud.size() * 9), 0.25);
}

TEST_F(Sog, KeepsFewHarmonicsExactly) {
  SplatCloud cloud = randomCloud(1200, 2, 3);
  const SplatCloud few = randomCloud(28, 2, 4);
  for (size_t i = 0; i < cloud.size(); ++i) {
    // 28 vectors of 24 numbers, of which 9 differ: 252 numbers fit the codebook.
    for (size_t k = 3; k < 27; ++k) cloud.sh[i * 27 + k] = few.sh[i % 28 * 27 + k % 9];
  }
  const SplatCloud back = roundTrip(cloud, kUnsorted);
  for (size_t i = 0; i < cloud.size(); ++i) {
    for (size_t k = 3; k < 27; ++k) ASSERT_EQ(back.sh[i * 27 + k], cloud.sh[i * 27 + k]);
  }
}

TEST_F(Sog, WritingAgainLosesNothingMore) {
  SplatCloud cloud = randomCloud(2000, 3, 5);
  cloud.antialias = Antialias::kMip;
  const SplatCloud once = roundTrip(cloud);
  const SplatCloud twice = roundTrip(once);
  EXPECT_EQ(twice.antialias, Antialias::kMip);
  EXPECT_EQ(twice.opacities, once.opacities);
  EXPECT_EQ(twice.scales, once.scales);
  EXPECT_EQ(twice.sh, once.sh);
  EXPECT_EQ(twice.positions, once.positions);
  for (size_t i = 0; i < once.size(); ++i) {
    // Where two components are about as large, the other one may count as the largest after
    // rounding and takes a rounding of its own.
    ASSERT_LT(angleBetween(&once.rotations[i * 4], &twice.rotations[i * 4]), kRotationBound);
  }
}

TEST_F(Sog, SortsAlongTheMortonCurveAndKeepsEverySplat) {
  SplatCloud cloud = randomCloud(5000, 0, 6);
  // The first colour names the splat; 5000 splats of 250 names.
  for (size_t i = 0; i < cloud.size(); ++i) {
    cloud.sh[i * 3] = static_cast<float>(i % 250);
    cloud.sh[i * 3 + 1] = cloud.sh[i * 3 + 2] = 0.0f;
  }
  const SplatCloud back = roundTrip(cloud);
  std::map<float, int> names;
  for (size_t i = 0; i < back.size(); ++i) ++names[back.sh[i * 3]];
  EXPECT_EQ(names.size(), 250u);
  for (const auto& [name, count] : names) EXPECT_EQ(count, 20) << name;
  const auto length = [](const SplatCloud& c) {
    double sum = 0;
    for (size_t i = 3; i < c.positions.size(); ++i) {
      sum += std::abs(double(c.positions[i]) - double(c.positions[i - 3]));
    }
    return sum;
  };
  // From neighbour to neighbour the curve is far shorter than a random walk through the cloud.
  EXPECT_LT(length(back), 0.3 * length(cloud));
}

TEST_F(Sog, WritesTheExtremes) {
  for (const size_t count : {size_t{0}, size_t{1}, size_t{17}}) {
    for (const int degree : {0, 1, 4}) {
      SplatCloud cloud = randomCloud(count, degree, 7);
      if (count == 17) {
        for (float& x : cloud.positions) x = 5.0f;
        cloud.positions[0] = 3e38f;
        cloud.positions[4] = -3e38f;
        cloud.scales[0] = 0.0f;
        cloud.scales[1] = 3e38f;
        cloud.opacities[0] = 0.0f;
        cloud.opacities[1] = 1.0f;
      }
      const SplatCloud back = roundTrip(cloud, kUnsorted);
      validate(back, "back");
      ASSERT_EQ(back.size(), count);
      // Degree 4 has no place in the format.
      EXPECT_EQ(back.sh_degree, count == 0 ? 0 : std::min(degree, 3));
      if (count == 17) {
        EXPECT_EQ(back.opacities[0], 0.0f);
        EXPECT_EQ(back.opacities[1], 1.0f);
        EXPECT_EQ(back.scales[0], 0.0f);
        // Logarithm and exponential of the largest numbers: 88 times float32's rounding.
        EXPECT_NEAR(back.scales[1] / 3e38f, 1.0f, 1e-5f);
        EXPECT_NEAR(back.positions[0] / 3e38f, 1.0f, 1e-5f);
        EXPECT_NEAR(back.positions[4] / -3e38f, 1.0f, 1e-5f);
        EXPECT_EQ(back.positions[5], 5.0f);
      }
    }
  }
}

TEST_F(Sog, CarriesWhatItsNumbersDoNotSay) {
  SplatCloud cloud = randomCloud(300, 1, 11);
  writeSplatFile(cloud, path("a.sog"), {});
  EXPECT_EQ(readSplatFile(path("a.sog")).frame, Frame::kRDF);
  EXPECT_EQ(readSplatFile(path("a.sog")).colour_space, ColourSpace::kDisplay);
  EXPECT_EQ(readSplatFile(path("a.sog")).antialias, Antialias::kClassic);
  cloud.colour_space = ColourSpace::kLinear;
  cloud.antialias = Antialias::kMip;
  cloud.frame = Frame::kRFU;
  std::filesystem::create_directory(path("scene"));
  writeSplatFile(cloud, path("scene/meta.json"), {.frame = Frame::kRFU});
  for (const char* name : {"scene", "scene/meta.json"}) {
    const SplatCloud back = readSplatFile(path(name));
    EXPECT_EQ(back.colour_space, ColourSpace::kLinear);
    EXPECT_EQ(back.antialias, Antialias::kMip);
    EXPECT_EQ(back.frame, Frame::kRFU);
  }
  SogScene scene = SogScene::second();
  scene.replace("\"count\":2", "\"count\":2,\"stipple_frame\":\"XYZ\"");
  refused(scene, {"meta.json", "frame 'XYZ'"}, ErrorCode::kUnsupported);
}

TEST_F(Sog, IsTheSameForAnyNumberOfThreads) {
  const SplatCloud cloud = randomCloud(3000, 2, 8);
  std::vector<SogPart> made[2];
  for (unsigned threads : {1u, 3u}) {
    withThreads(threads, [&] { made[threads / 2] = encodeSog(cloud, {}, nullptr); });
  }
  ASSERT_EQ(made[0].size(), made[1].size());
  for (size_t i = 0; i < made[0].size(); ++i) {
    EXPECT_EQ(made[0][i].name, made[1][i].name);
    EXPECT_EQ(made[0][i].bytes, made[1][i].bytes);
  }
}

TEST_F(Sog, RefusesPartsThatAreMissingOrOfTheWrongKind) {
  const auto without = [&](const char* key, std::initializer_list<const char*> texts) {
    SogScene scene = SogScene::second();
    scene.replace(quoted(key), "\"other\"");
    refused(scene, texts);
  };
  without("count", {"meta.json", "has no 'count'"});
  without("means", {"meta.json", "has no 'means'"});
  without("mins", {"has no 'means.mins'"});
  without("codebook", {"has no 'scales.codebook'"});
  without("quats", {"has no 'quats'"});
  const auto instead = [&](const char* from, const char* to,
                           std::initializer_list<const char*> texts,
                           ErrorCode code = ErrorCode::kFormat) {
    SogScene scene = SogScene::second();
    scene.replace(from, to);
    refused(scene, texts, code);
  };
  instead("\"version\":2", "\"version\":3", {"version 3", "1 and 2"}, ErrorCode::kUnsupported);
  instead("\"count\":2", "\"count\":-2", {"'count'", "-2", "whole number"});
  instead("\"count\":2", "\"count\":2.5", {"'count'", "2.5"});
  instead("[-1,0,-2]", "[-1,0]", {"'means.mins'", "a list of 2", "a list of 3"});
  instead("[-1,0,-2]", "[-1,0,1e999]", {"meta.json", "JSON"});
  instead("[-1,0,-2]", "[-1,0,NaN]", {"meta.json", "JSON"});
  instead("[-1,0,-2]", "[-1,0,-100]", {"'means'", "-100", "88.7"});
  instead("[-1,0,-2]", "[-1,0,\"a\"]", {"'means.mins'", "finite number"});
  instead("-8.000000,", "", {"'scales.codebook'", "a list of 255", "256"});
  instead("-8.000000,", "200,", {"'scales'", "200", "88.7"});
  instead("\"sh0\":{\"codebook\":[-2.000000,", "\"sh0\":{\"codebook\":[1e300,",
          {"'sh0.codebook'", "1e+300", "float32"});
  instead("\"bands\":1", "\"bands\":2", {"shN_centroids.webp", "192 pixels wide", "512"});
  instead("\"bands\":1", "\"bands\":4", {"'shN.bands'", "4"});
  // Without 'bands' the width of the palette tells the degree.
  SogScene scene = SogScene::second();
  scene.replace("\"bands\":1,", "");
  EXPECT_EQ(read(scene).sh_degree, 1);
}

TEST_F(Sog, RefusesNamesThatLeaveItsFolder) {
  for (const char* name : {"../sh0.webp", "/sh0.webp", "a/sh0.webp", "..", "a\\\\b", ""}) {
    SogScene scene = SogScene::second();
    scene.replace("\"sh0.webp\"", quoted(name));
    refused(scene, {"meta.json", "'sh0.files'", "plain name"});
  }
  SogScene scene = SogScene::second();
  scene.replace("\"sh0.webp\"", "\"sh1.webp\"");
  refused(scene, {"sh1.webp", "cannot be opened"}, ErrorCode::kIo);
  store("a.sog", archive(scene));
  expectError(ErrorCode::kFormat, {"a.sog", "no file 'sh1.webp'"},
              [&] { readSog(path("a.sog"), nullptr); });
}

TEST_F(Sog, RefusesCountsThatLie) {
  for (const char* count : {"3", "100000", "1099511627776", "18446744073709551615"}) {
    SogScene scene = SogScene::second();
    scene.replace("\"count\":2", std::string("\"count\":").append(count));
    refused(scene, {count});
  }
}

TEST_F(Sog, RefusesPicturesFarLargerThanItsSplats) {
  // 64 MB of one colour in a few hundred bytes; twenty times larger is no trouble for WebP.
  SogScene scene = SogScene::second();
  RgbaBytes bomb;
  bomb.width = bomb.height = 4000;
  bomb.bytes.assign(size_t{4} * 4000 * 4000, 255);
  const std::vector<uint8_t> bytes = encodeWebp(bomb, "bomb");
  EXPECT_LT(bytes.size(), 10000u);
  scene.files["quats.webp"] = std::string(bytes.begin(), bytes.end());
  refused(scene, {"quats.webp", "4000 x 4000", "at most 4096"});
  scene = SogScene::second();
  scene.files["shN_centroids.webp"] = std::string(bytes.begin(), bytes.end());
  refused(scene, {"shN_centroids.webp", "4000 x 4000"});
}

TEST_F(Sog, RefusesBytesThatMeanNothing) {
  SogScene scene = SogScene::second();
  scene.files["quats.webp"] = SogScene::webp({{255, 0, 128, 252}, {51, 102, 204, 251}});
  refused(scene, {"quats.webp", "251", "splat 1", "252 to 255"});
  scene = SogScene::second();
  scene.files["shN_labels.webp"] = SogScene::webp({{1, 0, 0, 255}, {65, 0, 0, 255}});
  refused(scene, {"shN_labels.webp", "vector 65", "splat 1", "65"});
  scene.files["shN_labels.webp"] = "RIFF";
  refused(scene, {"shN_labels.webp", "not a WebP image"});
}

TEST_F(Sog, EveryTruncatedPrefixIsRefused) {
  const SogScene whole = SogScene::second();
  for (const auto& [name, bytes] : whole.files) {
    // JSON is text of 8 kB; steps of 37 bytes are enough for it.
    for (size_t length = 0; length < bytes.size(); length += name == "meta.json" ? 37 : 1) {
      SogScene scene = whole;
      scene.files[name] = bytes.substr(0, length);
      scene.store(folder_ / "scene");
      // A WebP file whose last byte only pads it may be whole without it.
      if (length + 1 == bytes.size() && name != "meta.json") continue;
      expectError(ErrorCode::kFormat, {name.c_str()}, [&] { readSog(path("scene"), nullptr); });
    }
  }
}

TEST_F(Sog, KeepsTheOldFilesWhereWritingFails) {
  const SplatCloud cloud = randomCloud(100, 1, 9);
  writeSog(cloud, path("meta.json"), {}, nullptr);
  const size_t files = fileCount();
  EXPECT_EQ(files, 8u);
  std::map<std::string, std::string> before;
  for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
    before[entry.path().string()] = load(entry.path().string());
  }
  Progress cancelled;
  cancelled.cancel();
  expectError(ErrorCode::kCancelled, {},
              [&] { writeSog(randomCloud(200, 1, 10), path("meta.json"), {}, &cancelled); });
  // The last picture cannot be written: the others must not be replaced.
  std::filesystem::remove(path("shN_labels.webp"));
  std::filesystem::create_directory(path("shN_labels.webp"));
  expectError(ErrorCode::kIo, {"shN_labels.webp", "folder"},
              [&] { writeSog(randomCloud(200, 1, 10), path("meta.json"), {}, nullptr); });
  EXPECT_EQ(fileCount(), files);
  for (const auto& [name, bytes] : before) {
    if (std::filesystem::is_directory(name)) continue;
    EXPECT_EQ(load(name), bytes) << name;
  }
}

}  // namespace
}  // namespace stipple
