// USD layers of text and packages: what is read from layers that others write, and what ours say.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "io/bytes/zip_file.h"
#include "io/splats/splat_file.h"
#include "io/usd/usd_series_writer.h"
#include "io/usd/usd_splats.h"
#include "io/usd/usd_text.h"
#include "random_cloud.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

/// A layer of one prim of two splats. In: metadata of the layer; what stands around the prim.
std::string layerOf(const std::string& metadata, const std::string& before = "",
                    const std::string& after = "", const std::string& more = "") {
  return "#usda 1.0\n(\n" + metadata + "\n)\n" + before +
         "def ParticleField3DGaussianSplat \"Splats\"\n{\n"
         "    point3f[] positions = [(1, 2, 3), (4, 5, 6)]\n"
         "    float3[] scales = [(0.5, 1, 2), (1, 1, 1),]\n"
         "    quatf[] orientations = [(1, 0, 0, 0), (0, 2, 0, 0)]\n"
         "    float[] opacities = [0.25, 1]\n"
         "    uniform int radiance:sphericalHarmonicsDegree = 0\n"
         "    float3[] radiance:sphericalHarmonicsCoefficients = [(1, 2, 3), (-1, .5, 1e-3)]\n" +
         more + "}\n" + after;
}

class UsdSplats : public ScratchFolder {
 protected:
  SplatCloud read(const std::string& text, const std::string& name = "a.usda") {
    return readSplatFile(store(name, text));
  }
};

void expectPositions(const SplatCloud& cloud, const std::vector<float>& expected) {
  ASSERT_EQ(cloud.positions.size(), expected.size());
  for (size_t i = 0; i < expected.size(); ++i) {
    EXPECT_NEAR(cloud.positions[i], expected[i], 2e-6f) << i;
  }
}

TEST_F(UsdSplats, ComeBackBitForBit) {
  for (const int degree : {0, 1, 4}) {
    SplatCloud cloud = randomCloud(9000, degree, 1);
    cloud.frame = Frame::kRUB;
    for (const char* name : {"a.usda", "a.usd", "a.usdz"}) {
      writeSplatFile(cloud, path(name), {});
      const SplatCloud back = readSplatFile(path(name));
      EXPECT_TRUE(back.positions == cloud.positions) << name;
      EXPECT_TRUE(back.rotations == cloud.rotations) << name;
      EXPECT_TRUE(back.scales == cloud.scales) << name;
      EXPECT_TRUE(back.opacities == cloud.opacities) << name;
      EXPECT_TRUE(back.sh == cloud.sh) << name;
      EXPECT_EQ(back.sh_degree, degree);
      EXPECT_EQ(back.frame, Frame::kRUB);
      EXPECT_EQ(back.colour_space, ColourSpace::kDisplay);
    }
  }
}

TEST_F(UsdSplats, SayWhichWayIsUp) {
  SplatCloud cloud = randomCloud(3, 0, 2);
  cloud.frame = Frame::kRFU;
  writeSplatFile(cloud, path("y.usda"), {});
  EXPECT_NE(load(path("y.usda")).find("upAxis = \"Y\""), std::string::npos);
  // Blender's z, which is up, is USD's y; its y, away from the viewer, is USD's -z.
  const SplatCloud back = readSplatFile(path("y.usda"));
  expectPositions(back, {cloud.positions[0], cloud.positions[2], -cloud.positions[1],
                         cloud.positions[3], cloud.positions[5], -cloud.positions[4],
                         cloud.positions[6], cloud.positions[8], -cloud.positions[7]});
  writeSplatFile(cloud, path("z.usda"), {.frame = Frame::kRFU});
  EXPECT_NE(load(path("z.usda")).find("upAxis = \"Z\""), std::string::npos);
  EXPECT_EQ(readSplatFile(path("z.usda")).frame, Frame::kRFU);
  EXPECT_TRUE(readSplatFile(path("z.usda")).positions == cloud.positions);
  // Another frame is said beside it.
  writeSplatFile(cloud, path("x.usda"), {.frame = Frame::kRDF});
  EXPECT_EQ(readSplatFile(path("x.usda")).frame, Frame::kRDF);
}

TEST_F(UsdSplats, HaveTheSameBytesForAnyNumberOfThreads) {
  const SplatCloud cloud = randomCloud(20001, 1, 3);
  withThreads(1, [&] { writeSplatFile(cloud, path("one.usda"), {}); });
  withThreads(4, [&] { writeSplatFile(cloud, path("four.usda"), {}); });
  EXPECT_TRUE(load(path("one.usda")) == load(path("four.usda")));
}

TEST_F(UsdSplats, LieInPackagesAtMultiplesOf64) {
  writeSplatFile(randomCloud(50, 0, 4), path("a.usdz"), {});
  const std::string bytes = load(path("a.usdz"));
  const size_t at = bytes.find("#usda 1.0");
  ASSERT_NE(at, std::string::npos);
  EXPECT_EQ(at % 64, 0u);
  EXPECT_EQ(bytes.substr(30, 11), "splats.usda");
  EXPECT_EQ(bytes[8], '\0');  // stored
}

TEST_F(UsdSplats, AreReadWithTheSchemasFallbacks) {
  const SplatCloud cloud = read(layerOf("upAxis = \"Z\""));
  expectPositions(cloud, {1, 2, 3, 4, 5, 6});
  EXPECT_EQ(cloud.frame, Frame::kRFU);
  EXPECT_EQ(cloud.rotations, (std::vector<float>{1, 0, 0, 0, 0, 1, 0, 0}));
  EXPECT_EQ(cloud.scales, (std::vector<float>{0.5f, 1, 2, 1, 1, 1}));
  EXPECT_EQ(cloud.opacities, (std::vector<float>{0.25f, 1}));
  EXPECT_EQ(cloud.sh, (std::vector<float>{1, 2, 3, -1, 0.5f, 1e-3f}));
  const SplatCloud bare = read(
      "#usda 1.0\ndef ParticleField3DGaussianSplat \"a\" { point3h[] positionsh = [(1,2,3)] }");
  EXPECT_EQ(bare.frame, Frame::kRUB);
  EXPECT_EQ(bare.rotations, (std::vector<float>{1, 0, 0, 0}));
  EXPECT_EQ(bare.scales, (std::vector<float>{1, 1, 1}));
  EXPECT_EQ(bare.opacities, (std::vector<float>{1}));
  EXPECT_EQ(bare.sh, (std::vector<float>{0, 0, 0}));  // a grey of one half
}

TEST_F(UsdSplats, PreferSinglePrecisionCutLongArraysAndTakeTheFirstTime) {
  const SplatCloud cloud = read(
      "#usda 1.0\ndef ParticleField3DGaussianSplat \"a\" {\n"
      "  point3h[] positionsh = [(9, 9, 9)]\n  point3f[] positions = [(1, 2, 3)]\n"
      "  float[] opacities = [0.5, 0.75]\n"
      "  float3[] scales.timeSamples = { 7: [(7, 7, 7)], 2: [(2, 2, 2)], 1: None, }\n"
      "  rel material:binding = </Looks/a> (doc = \"}\")\n"
      "  float3[] scales.connect = </b.scales>\n"
      "  custom string note = \"\"\"a \" ) } ] \"\"\" ( hidden = true )\n}");
  expectPositions(cloud, {1, 2, 3});
  EXPECT_EQ(cloud.opacities, (std::vector<float>{0.5f}));
  EXPECT_EQ(cloud.scales, (std::vector<float>{2, 2, 2}));
}

TEST_F(UsdSplats, StandWhereTheirPrimsStand) {
  // By hand: half of it, turned by 90 degrees about z, then moved; in centimetres.
  const SplatCloud cloud = read(
      layerOf("metersPerUnit = 0.01",
              "def Xform \"World\" (kind = \"group\")\n{\n"
              "    double3 xformOp:translate = (100, 0, 0)\n    float xformOp:rotateZ = 90\n"
              "    float3 xformOp:scale:half = (0.5, 0.5, 0.5)\n"
              "    uniform token[] xformOpOrder = [\"xformOp:translate\", \"xformOp:rotateZ\", "
              "\"xformOp:scale:half\"]\n",
              "}\n"));
  expectPositions(cloud, {0.01f * (100 - 1.0f), 0.01f * 0.5f, 0.01f * 1.5f, 0.01f * (100 - 2.5f),
                          0.01f * 2.0f, 0.01f * 3.0f});
  EXPECT_NEAR(cloud.scales[2], 0.01f, 1e-8f);
}

TEST_F(UsdSplats, KnowEveryOperationOfTransformation) {
  struct {
    const char* says;
    std::vector<float> first;  ///< where (1, 2, 3) goes
  } const cases[] = {
      // X turns first: (1, 2, 3) to (1, -3, 2), then Y: (2, -3, -1).
      {"float3 xformOp:rotateXYZ = (90, 90, 0)\n token[] xformOpOrder = [\"xformOp:rotateXYZ\"]",
       {2, -3, -1}},
      {"float3 xformOp:rotateYXZ = (90, 90, 0)\n token[] xformOpOrder = [\"xformOp:rotateYXZ\"]",
       {3, 1, 2}},
      {"quatf xformOp:orient = (0, 0, 0, 2)\n token[] xformOpOrder = [\"xformOp:orient\"]",
       {-1, -2, 3}},
      {"matrix4d xformOp:transform = ((0,1,0,0),(-1,0,0,0),(0,0,1,0),(10,20,30,1))\n"
       " token[] xformOpOrder = [\"xformOp:transform\"]",
       {8, 21, 33}},
      {"float3 xformOp:translate:pivot = (1, 1, 1)\n float xformOp:rotateX = 180\n"
       " token[] xformOpOrder = [\"xformOp:translate:pivot\", \"xformOp:rotateX\", "
       "\"!invert!xformOp:translate:pivot\"]",
       {1, 0, -1}},
      {"float3 xformOp:scale.timeSamples = { 3: (2, 2, 2), 1: (3, 3, 3) }\n"
       " token[] xformOpOrder = [\"!resetXformStack!\", \"xformOp:scale\"]",
       {3, 6, 9}},
  };
  for (const auto& one : cases) {
    const SplatCloud cloud = read(layerOf("", "def Xform \"a\" {\n", "}\n", one.says));
    ASSERT_EQ(cloud.size(), 2u);
    for (size_t k = 0; k < 3; ++k) {
      EXPECT_NEAR(cloud.positions[k], one.first[k], 1e-5f) << one.says;
    }
  }
}

TEST_F(UsdSplats, AreDrawnOncePerReference) {
  store("far.usda",
        layerOf("defaultPrim = \"Splats\"") + "class \"Hidden\" { def Xform \"a\" { } }\n");
  const SplatCloud cloud = read(
      "#usda 1.0\n"
      "def Xform \"Scan\" {\n def ParticleField3DGaussianSplat \"s\" {\n"
      "  point3f[] positions = [(0, 0, 0)]\n } }\n"
      "def \"Again\" (prepend references = </Scan>) {\n"
      "  double3 xformOp:translate = (5, 0, 0)\n"
      "  uniform token[] xformOpOrder = [\"xformOp:translate\"]\n"
      "  over \"s\" { float[] opacities = [0.5] }\n}\n"
      "def \"Off\" (active = false\n references = </Scan>) {}\n"
      "def \"Unseen\" (references = [</Scan>]) { token visibility = \"invisible\" }\n"
      "def \"StandIn\" (references = </Scan>) { uniform token purpose = \"proxy\" }\n"
      "def PointInstancer \"Many\" { def \"p\" (references = </Scan>) {} }\n"
      "over \"Nothing\" { def \"s\" (references = </Scan>) {} }\n"
      "over \"Abstract\" (inherits = </Shape>) {}\n"
      "class \"Shape\" (references = </Scan>) {}\n"
      "def \"Far\" (prepend payload = @./far.usda@) {\n"
      "  double3 xformOp:translate = (0, 0, 7)\n"
      "  uniform token[] xformOpOrder = [\"xformOp:translate\"]\n}\n"
      "def \"Chosen\" (variants = { string look = \"b\" }) {\n"
      "  variantSet \"look\" = { \"a\" { def Xform \"x\" { } } \"b\" (doc = \"y\") { } } }\n");
  expectPositions(cloud, {0, 0, 0, 5, 0, 0, 1, 2, 10, 4, 5, 13});
  EXPECT_EQ(cloud.opacities, (std::vector<float>{1, 0.5f, 0.25f, 1}));
}

TEST_F(UsdSplats, ComeFromSublayers) {
  std::filesystem::create_directory(folder_ / "parts");
  store("parts/b.usda", layerOf("subLayers = [@../c.usda@]"));
  store("c.usda", "#usda 1.0\nover \"Splats\" { float[] opacities = [0, 0] }\n");
  const SplatCloud cloud = read(
      "#usda 1.0\n( subLayers = [ @parts/b.usda@ (offset = 3) ] )\n"
      "over \"Splats\" { float3[] scales = [(3, 3, 3), (4, 4, 4)] }\n");
  EXPECT_EQ(cloud.scales, (std::vector<float>{3, 3, 3, 4, 4, 4}));
  EXPECT_EQ(cloud.opacities, (std::vector<float>{0.25f, 1}));
}

TEST_F(UsdSplats, AreRefusedWithTheLineOrThePrim) {
  const auto refused = [&](const std::string& text, std::initializer_list<const char*> words,
                           ErrorCode code = ErrorCode::kFormat) {
    expectError(code, words, [&] { read(text); });
  };
  refused("#usda 1.0\n\ndef Xform \"a\" {\n  float b = }\n", {"a.usda", "line 4", "a number"});
  refused("#usda 1.0\ndef Xform \"a\" {", {"its end"});
  refused("#usda 1.0\ndef ParticleField3DGaussianSplat \"a\" { point3f[] positions = [(1,2)] }",
          {"line 2", "','"});
  refused("#usda 1.0\ndef Mesh \"a\" { }", {"draws no splats", "ParticleField3DGaussianSplat"});
  refused("PXR-USDC\0\1", {"binary", "usdcat"}, ErrorCode::kUnsupported);
  refused("#usda 1.0\ndef \"a\" (references = @../b.usda@) {}", {"../b.usda", "folder"},
          ErrorCode::kUnsupported);
  refused("#usda 1.0\ndef \"a\" (references = </b>) {}", {"/b", "not there"});
  refused("#usda 1.0\ndef \"a\" (references = @missing.usda@) {}", {"missing.usda"},
          ErrorCode::kIo);
  refused("#usda 1.0\ndef \"a\" (references = </b>) {}\ndef \"b\" (references = </a>) {}",
          {"circle"});
  refused("#usda 1.0\ndef \"a\" { def \"b\" (references = </a>) {} }", {"in each other"});
  refused("#usda 1.0\n( subLayers = [@a.usda@] )\n", {"circle"});
  std::string deep = "#usda 1.0\n";
  for (int i = 0; i < 100000; ++i) deep += "def \"a\" {";
  refused(deep, {"200"});
  refused(layerOf("", "", "", "float[] opacities = [0.5]\n"), {"/Splats", "opacities", "1", "2"});
  refused(layerOf("", "", "", "float[] opacities = [0.5, 1.5]\n"), {"/Splats", "opacity"});
  refused(layerOf("", "", "", "point3f[] positions = [(1, nan, 0), (-inf, 0, 0)]\n"),
          {"/Splats", "position"});
  refused(layerOf("", "", "", "uniform int radiance:sphericalHarmonicsDegree = 5\n"), {"degree"});
  refused(layerOf("", "", "", "uniform int radiance:sphericalHarmonicsDegree = 1\n"),
          {"6 numbers", "24"});
  refused(layerOf("metersPerUnit = 0"), {"metres"});
  refused(layerOf("", "", "", "token[] xformOpOrder = [\"xformOp:bend\"]\n"), {"bend"});
  refused(layerOf("", "", "", "uniform token colorSpace:name = \"lin_ap1_scene\"\n"),
          {"lin_ap1_scene"}, ErrorCode::kUnsupported);
  expectError(ErrorCode::kUnsupported, {"binary", "x.usdc"}, [&] {
    OutputFile file(path("b.usdz"));
    ZipWriter package(file, 64);
    const std::string head = "PXR-USDC";
    package.add("x.usdc", {head.begin(), head.end()});
    package.finish();
    file.commit();
    readSplatFile(path("b.usdz"));
  });
  expectError(ErrorCode::kUnsupported, {"empty"},
              [&] { writeSplatFile(SplatCloud(), path("c.usda"), {}); });
}

TEST_F(UsdSplats, HaveHalfPrecisionWhereItIsAskedFor) {
  SplatCloud cloud = randomCloud(5000, 2, 6);
  cloud.frame = Frame::kRUB;
  writeSplatFile(cloud, path("a.usda"), {});
  writeSplatFile(cloud, path("h.usda"), {.half = true});
  const SplatCloud back = readSplatFile(path("h.usda"));
  EXPECT_TRUE(back.positions == cloud.positions);
  const std::pair<std::vector<float> SplatCloud::*, float> arrays[] = {
      {&SplatCloud::scales, 0},
      {&SplatCloud::opacities, 0},
      {&SplatCloud::sh, 0},
      // Normalised again when they are read.
      {&SplatCloud::rotations, 1e-3f}};
  for (const auto& [values, slack] : arrays) {
    for (size_t i = 0; i < (cloud.*values).size(); ++i) {
      const float value = (cloud.*values)[i];
      // Half a step: of 11 bits, or of 2^-24 below 2^-14; and what five digits round.
      const float step = std::max(std::abs(value) * 0x1p-11f, 0x1p-25f) + std::abs(value) * 5e-5f;
      ASSERT_NEAR((back.*values)[i], value, step + slack) << i;
    }
  }
  EXPECT_FALSE(back.sh == cloud.sh);
  const auto bytes = [&](const char* name) {
    return static_cast<double>(std::filesystem::file_size(path(name)));
  };
  EXPECT_LT(bytes("h.usda"), 0.8 * bytes("a.usda"));
  cloud.scales[7] = 7e4f;
  expectError(ErrorCode::kUnsupported, {"h.usda", "70000", "65504"},
              [&] { writeSplatFile(cloud, path("h.usda"), {.half = true}); });
}

class UsdSeries : public ScratchFolder {};

TEST_F(UsdSeries, HasEveryFrameAtItsTime) {
  const size_t counts[] = {7, 0, 9000};
  UsdSeriesWriter writer(path("a.usda"), 23.976, {});
  std::vector<SplatCloud> clouds;
  for (size_t i = 0; i < 3; ++i) {
    clouds.push_back(randomCloud(counts[i], 1, static_cast<unsigned>(i)));
    if (i == 1) clouds.back() = SplatCloud();
    clouds.back().frame = Frame::kRUB;
    writer.add(clouds.back(), 10 + static_cast<double>(i));
  }
  EXPECT_FALSE(std::filesystem::exists(path("a.usda")));
  writer.finish();
  EXPECT_EQ(fileCount(), 1u);
  const std::string text = load(path("a.usda"));
  for (const char* line :
       {"timeCodesPerSecond = 23.976\n", "startTimeCode = 10\n", "endTimeCode = 12\n"}) {
    EXPECT_NE(text.find(line), std::string::npos) << line;
  }
  const UsdLayer layer = parseUsdText(text, "a.usda");
  const UsdPrim& prim = *layer.root.children.at(0);
  const std::pair<const char*, std::vector<float> SplatCloud::*> arrays[] = {
      {"positions", &SplatCloud::positions},
      {"orientations", &SplatCloud::rotations},
      {"scales", &SplatCloud::scales},
      {"opacities", &SplatCloud::opacities},
      {"radiance:sphericalHarmonicsCoefficients", &SplatCloud::sh}};
  for (const auto& [name, values] : arrays) {
    const auto& samples = prim.attributes.at(name).samples;
    ASSERT_EQ(samples.size(), 3u) << name;
    for (size_t i = 0; i < 3; ++i) {
      EXPECT_TRUE(samples.at(10 + static_cast<double>(i)).floats == clouds[i].*values) << name;
    }
  }
  EXPECT_EQ(prim.attributes.at("extent").samples.at(12).floats.size(), 6u);
  // As a file of splats it shows its first frame.
  EXPECT_TRUE(readSplatFile(path("a.usda")).positions == clouds[0].positions);
}

TEST_F(UsdSeries, ComesBackFrameByFrame) {
  const size_t counts[] = {7, 0, 9000};
  for (const char* name : {"a.usda", "a.usdz"}) {
    UsdSeriesWriter writer(path(name), 30, {});
    std::vector<SplatCloud> clouds;
    for (size_t i = 0; i < 3; ++i) {
      clouds.push_back(randomCloud(counts[i], 1, static_cast<unsigned>(i)));
      if (i == 1) clouds.back() = SplatCloud();
      clouds.back().frame = Frame::kRUB;
      writer.add(clouds.back(), 10 + 2.5 * static_cast<double>(i));
    }
    writer.finish();
    UsdSplatsReader reader(path(name));
    EXPECT_EQ(reader.times(), (std::vector<double>{10, 12.5, 15})) << name;
    EXPECT_EQ(reader.framesPerSecond(), 30);
    for (const size_t i : {2u, 0u, 1u}) {
      const SplatCloud back = reader.at(reader.times()[i]);
      EXPECT_EQ(back.frame, Frame::kRUB);
      EXPECT_TRUE(back.positions == clouds[i].positions) << name << " " << i;
      EXPECT_TRUE(back.rotations == clouds[i].rotations) << name << " " << i;
      EXPECT_TRUE(back.sh == clouds[i].sh) << name << " " << i;
    }
    EXPECT_TRUE(reader.still(nullptr).positions == clouds[0].positions);
  }
}

TEST_F(UsdSeries, ShowsWhatMovesAndHidesSplatsAtEachTime) {
  // Another program's layer: values at times of the prim, of what it lies in, and of what has no
  // splats.
  const std::string text = layerOf(
      "framesPerSecond = 25",
      "def Xform \"Moved\"\n{\n"
      "    double3 xformOp:translate.timeSamples = { 1: (0, 0, 0), 3: (10, 0, 0), 4: None }\n"
      "    uniform token[] xformOpOrder = [\"xformOp:translate\"]\n"
      "    token visibility.timeSamples = { 0: \"inherited\", 5: \"invisible\" }\n",
      "}\ndef Camera \"C\"\n{\n    float focalLength.timeSamples = { 7: 50 }\n}\n",
      "    float[] opacities.timeSamples = { 2: [0.5, 0.125] }\n");
  UsdSplatsReader reader(store("moved.usda", text));
  EXPECT_EQ(reader.times(), (std::vector<double>{0, 1, 2, 3, 5}));
  EXPECT_EQ(reader.framesPerSecond(), 25);
  expectPositions(reader.at(0), {1, 2, 3, 4, 5, 6});
  expectPositions(reader.at(2), {1, 2, 3, 4, 5, 6});
  expectPositions(reader.at(3), {11, 2, 3, 14, 5, 6});
  EXPECT_EQ(reader.at(3).opacities, (std::vector<float>{0.5f, 0.125f}));
  EXPECT_EQ(reader.at(5).size(), 0u);
  // Without a time the value that has none is the one.
  EXPECT_EQ(reader.still(nullptr).opacities, (std::vector<float>{0.25f, 1.0f}));
}

TEST_F(UsdSeries, StandsStillWithoutTimes) {
  UsdSplatsReader reader(store("still.usda", layerOf("upAxis = \"Y\"")));
  EXPECT_TRUE(reader.times().empty());
  EXPECT_EQ(reader.framesPerSecond(), 24);
  EXPECT_EQ(reader.still(nullptr).size(), 2u);
}

TEST_F(UsdSeries, LiesInPackagesToo) {
  SplatCloud cloud = randomCloud(40, 2, 1);
  UsdSeriesWriter writer(path("a.usdz"), 24,
                         {.half = true, .sh_degree_limit = 1, .frame = Frame::kRFU});
  writer.add(cloud, 1);
  writer.add(cloud, 2.5);
  writer.finish();
  const SplatCloud back = readSplatFile(path("a.usdz"));
  EXPECT_EQ(back.size(), 40u);
  EXPECT_EQ(back.sh_degree, 1);
  EXPECT_EQ(back.frame, Frame::kRFU);
}

TEST_F(UsdSeries, RefusesWhatDoesNotFitAndLeavesNothing) {
  expectError(ErrorCode::kUnsupported, {"a.ply", ".usdz"},
              [&] { UsdSeriesWriter(path("a.ply"), 24, {}); });
  expectError(ErrorCode::kInvalidArgument, {"frames per second", "0"},
              [&] { UsdSeriesWriter(path("a.usda"), 0, {}); });
  expectError(ErrorCode::kIo, {"missing"},
              [&] { UsdSeriesWriter(path("missing/a.usda"), 24, {}); });
  store("a.usda", "old");
  {
    UsdSeriesWriter writer(path("a.usda"), 24, {});
    expectError(ErrorCode::kInvalidArgument, {"none of its frames"}, [&] { writer.finish(); });
    writer.add(randomCloud(5, 1, 1), 3);
    expectError(ErrorCode::kInvalidArgument, {"frame 3", "ascend"},
                [&] { writer.add(randomCloud(5, 1, 1), 3); });
    expectError(ErrorCode::kInvalidArgument, {"frame 4", "degree 0", "degree 1"},
                [&] { writer.add(randomCloud(5, 0, 1), 4); });
    SplatCloud bad = randomCloud(5, 1, 1);
    bad.opacities[2] = 2;
    expectError(ErrorCode::kInvalidArgument, {"opacity"}, [&] { writer.add(bad, 5); });
  }
  EXPECT_EQ(load(path("a.usda")), "old");
  EXPECT_EQ(fileCount(), 1u);
}

}  // namespace
}  // namespace stipple
