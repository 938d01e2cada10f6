#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "io/splats/splat_file.h"
#include "random_cloud.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

class Ply : public ScratchFolder {
 protected:
  SplatCloud roundTrip(const SplatCloud& cloud, bool ascii = false) {
    writeSplatFile(cloud, path("trip.ply"), {.ascii = ascii});
    return readSplatFile(path("trip.ply"));
  }
};

/// A PLY file put together byte by byte, independent of the writer: each property has a type and
/// one value per vertex, in raw (logarithm, logit) form.
struct RawPly {
  struct Property {
    std::string type;
    std::string name;
    std::vector<double> values;
  };
  std::vector<Property> properties;
  std::string format = "binary_little_endian";
  std::string comments;
  std::string elements_before;  ///< header lines
  std::string bytes_before;
  std::string elements_after;

  static std::string number(const std::string& type, double value, bool big) {
    std::string bytes;
    const auto put = [&](auto typed) {
      bytes.resize(sizeof(typed));
      std::memcpy(bytes.data(), &typed, sizeof(typed));
    };
    if (type == "char" || type == "int8") put(static_cast<int8_t>(value));
    if (type == "uchar" || type == "uint8") put(static_cast<uint8_t>(value));
    if (type == "short" || type == "int16") put(static_cast<int16_t>(value));
    if (type == "ushort" || type == "uint16") put(static_cast<uint16_t>(value));
    if (type == "int" || type == "int32") put(static_cast<int32_t>(value));
    if (type == "uint" || type == "uint32") put(static_cast<uint32_t>(value));
    if (type == "float" || type == "float32") put(static_cast<float>(value));
    if (type == "double" || type == "float64") put(value);
    if (big != (std::endian::native == std::endian::big)) {
      std::reverse(bytes.begin(), bytes.end());
    }
    return bytes;
  }

  std::string bytes() const {
    const size_t count = properties.front().values.size();
    std::string text = "ply\nformat " + format + " 1.0\n" + comments + elements_before +
                       "element vertex " + std::to_string(count) + "\n";
    for (const Property& p : properties) text += "property " + p.type + " " + p.name + "\n";
    text += elements_after + "end_header\n" + bytes_before;
    for (size_t i = 0; i < count; ++i) {
      for (const Property& p : properties) {
        if (format == "ascii") {
          text += std::to_string(p.values[i]) + (&p == &properties.back() ? "\n" : " ");
        } else {
          text += number(p.type, p.values[i], format == "binary_big_endian");
        }
      }
    }
    return text;
  }

  Property& at(const std::string& name) {
    return *std::find_if(properties.begin(), properties.end(),
                         [&](const Property& p) { return p.name == name; });
  }
};

/// Two splats with numbers that every type but the 8-bit ones holds exactly.
RawPly twoSplats(const std::string& type = "float", int degree = 0) {
  RawPly ply;
  const auto add = [&](const std::string& name, double a, double b) {
    ply.properties.push_back({type, name, {a, b}});
  };
  add("x", 1, 4);
  add("y", 2, 5);
  add("z", 3, 6);
  for (int i = 0; i < 3; ++i) add("f_dc_" + std::to_string(i), i, 10 + i);
  const int rest = 3 * ((degree + 1) * (degree + 1) - 1);
  for (int i = 0; i < rest; ++i) add("f_rest_" + std::to_string(i), i, 100 - i);
  add("opacity", 0, 2);
  for (int i = 0; i < 3; ++i) add("scale_" + std::to_string(i), i, 3 + i);
  add("rot_0", 3, 1);
  add("rot_1", 0, 0);
  add("rot_2", 4, 0);
  add("rot_3", 0, 0);
  return ply;
}

void expectTwoSplats(const SplatCloud& cloud, int degree = 0) {
  ASSERT_EQ(cloud.size(), 2u);
  ASSERT_EQ(cloud.sh_degree, degree);
  EXPECT_EQ(cloud.positions, (std::vector<float>{1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(cloud.opacities[0], 0.5f);
  EXPECT_EQ(cloud.opacities[1], static_cast<float>(1.0 / (1.0 + std::exp(-2.0))));
  for (size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(cloud.scales[i], static_cast<float>(std::exp(double(i))));
  }
  EXPECT_EQ(cloud.rotations, (std::vector<float>{0.6f, 0, 0.8f, 0, 1, 0, 0, 0}));
  const size_t rest = shCoefficientCount(degree) - 1;
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_EQ(cloud.sh[c], float(c));
    EXPECT_EQ(cloud.sh[cloud.shStride() + c], 10.0f + float(c));
    for (size_t k = 0; k < rest; ++k) {
      // Channel-major in the file: channel c starts at c * rest.
      EXPECT_EQ(cloud.sh[(1 + k) * 3 + c], float(c * rest + k));
      EXPECT_EQ(cloud.sh[cloud.shStride() + (1 + k) * 3 + c], 100.0f - float(c * rest + k));
    }
  }
}

TEST_F(Ply, ReadsEveryEncodingNumberTypeAndDegree) {
  for (const char* format : {"ascii", "binary_little_endian", "binary_big_endian"}) {
    for (const char* type :
         {"char", "uchar", "short", "ushort", "int", "uint", "float", "double", "int8", "uint8",
          "int16", "uint16", "int32", "uint32", "float32", "float64"}) {
      for (int degree = 0; degree <= 4; ++degree) {
        SCOPED_TRACE(std::string(format) + " " + type + " degree " + std::to_string(degree));
        RawPly ply = twoSplats(type, degree);
        ply.format = format;
        expectTwoSplats(readSplatFile(store("a.ply", ply.bytes())), degree);
      }
    }
  }
}

TEST_F(Ply, ReadsHalfFloats) {
  // 0x3555 is 0.33325195, 0x0001 the smallest subnormal number 2^-24.
  RawPly half = twoSplats();
  half.at("f_dc_0").type = "ushort";
  half.at("f_dc_0").values = {0x3555, 0x0001};
  std::string text = half.bytes();
  text.replace(text.find("property ushort f_dc_0"), 22, "property half f_dc_0");
  const SplatCloud cloud = readSplatFile(store("a.ply", text));
  EXPECT_EQ(cloud.sh[0], 0.333251953125f);
  EXPECT_EQ(cloud.sh[3], 0x1p-24f);
}

TEST_F(Ply, ReadsAnyPropertyOrderWithOthersInBetween) {
  std::mt19937 random(7);
  for (int trial = 0; trial < 20; ++trial) {
    RawPly ply = twoSplats("float", 2);
    ply.properties.push_back({"uchar", "red", {9, 9}});
    ply.properties.push_back({"double", "nx", {0.5, 0.5}});
    ply.properties.push_back({"short", "t", {-1, 1}});
    std::shuffle(ply.properties.begin(), ply.properties.end(), random);
    expectTwoSplats(readSplatFile(store("a.ply", ply.bytes())), 2);
  }
}

TEST_F(Ply, PassesOverOtherElementsAndLists) {
  RawPly ply = twoSplats();
  ply.elements_before =
      "element face 2\nproperty list uchar int vertex_indices\n"
      "element camera 1\nproperty float f\nproperty uchar u\n";
  ply.bytes_before = std::string("\x01", 1) + std::string(4, 'q') + std::string("\x03", 1) +
                     std::string(12, 'q') + std::string(5, 'c');
  ply.elements_after = "element tail 1000000\nproperty list uchar uchar t\n";
  std::string bytes = ply.bytes() + std::string(1000000, '\0');
  expectTwoSplats(readSplatFile(store("a.ply", bytes)));

  ply.format = "ascii";
  ply.elements_after.clear();
  ply.bytes_before = "1 8\n\n3 8 8 8\n0.5 7\n";
  expectTwoSplats(readSplatFile(store("a.ply", ply.bytes())));
}

TEST_F(Ply, ReadsListsInsideTheVertexItself) {
  for (const char* format : {"binary_little_endian", "binary_big_endian"}) {
    RawPly ply = twoSplats();
    ply.format = format;
    // A list of one ushort, spelled as two scalars in the row's bytes.
    ply.properties.insert(ply.properties.begin() + 4, {"uchar", "COUNT", {1, 1}});
    ply.properties.insert(ply.properties.begin() + 5, {"ushort", "VALUE", {513, 513}});
    std::string bytes = ply.bytes();
    const std::string two = "property uchar COUNT\nproperty ushort VALUE\n";
    bytes.replace(bytes.find(two), two.size(), "property list uchar ushort extra\n");
    expectTwoSplats(readSplatFile(store("a.ply", bytes)));
  }
}

TEST_F(Ply, ReadsWindowsLineEndsAndSignsInText) {
  RawPly ply = twoSplats();
  ply.format = "ascii";
  std::string bytes = ply.bytes();
  size_t at = 0;
  while ((at = bytes.find('\n', at)) != std::string::npos) {
    bytes.replace(at, 1, "\r\n");
    at += 2;
  }
  bytes.replace(bytes.find("1.000000 2.0"), 8, "+1.0E+00");
  expectTwoSplats(readSplatFile(store("a.ply", bytes)));
}

TEST_F(Ply, MakesTheMissingAxisOf2dSplatsThin) {
  RawPly ply = twoSplats();
  ply.properties.erase(ply.properties.end() - 5);
  ASSERT_EQ(ply.properties[ply.properties.size() - 5].name, "scale_1");
  const SplatCloud cloud = readSplatFile(store("a.ply", ply.bytes()));
  EXPECT_EQ(cloud.scales[2], 1e-3f * cloud.scales[0]);
  EXPECT_EQ(cloud.scales[5], 1e-3f * cloud.scales[3]);
}

TEST_F(Ply, AppliesTheFilterOfMipSplatting) {
  RawPly ply = twoSplats();
  ply.properties.push_back({"float", "filter_3D", {2.0, 0.0}});
  const SplatCloud cloud = readSplatFile(store("a.ply", ply.bytes()));
  EXPECT_EQ(cloud.antialias, Antialias::kMip);
  double ratio = 1.0;
  for (int axis = 0; axis < 3; ++axis) {
    const double variance = std::exp(2.0 * axis);
    ratio *= variance / (variance + 4.0);
    // 1e-6: the scales have been rounded to float32 twice.
    EXPECT_NEAR(double(cloud.scales[size_t(axis)]) / std::sqrt(variance + 4.0), 1.0, 1e-6);
  }
  EXPECT_NEAR(double(cloud.opacities[0]), 0.5 * std::sqrt(ratio), 1e-6);
  EXPECT_EQ(cloud.scales[3], static_cast<float>(std::exp(3.0)));
}

TEST_F(Ply, ReadsTheModeAndColourSpaceFromComments) {
  const auto read = [&](const std::string& comments) {
    RawPly ply = twoSplats();
    ply.comments = comments;
    return readSplatFile(store("a.ply", ply.bytes()));
  };
  EXPECT_EQ(read("").antialias, Antialias::kClassic);
  EXPECT_EQ(read("").colour_space, ColourSpace::kDisplay);
  EXPECT_EQ(read("comment SplatRenderMode: mip\n").antialias, Antialias::kMip);
  EXPECT_EQ(read("comment SplatRenderMode: default\n").antialias, Antialias::kClassic);
  EXPECT_EQ(read("comment antialiased 1\n").antialias, Antialias::kMip);
  EXPECT_EQ(read("comment antialiased 0\n").antialias, Antialias::kClassic);
  EXPECT_EQ(read("comment stipple_colour_space lin_rec709_display\n").colour_space,
            ColourSpace::kLinear);
  EXPECT_EQ(read("").frame, Frame::kUnknown);
  EXPECT_EQ(read("comment stipple_frame RFU\n").frame, Frame::kRFU);
  expectError(ErrorCode::kUnsupported, {"frame", "'up'", "RDF"},
              [&] { read("comment stipple_frame up\n"); });
  expectError(ErrorCode::kUnsupported, {"acescg", "lin_rec709_display"},
              [&] { read("comment stipple_colour_space acescg\n"); });
}

/// Tolerances: a float32 logarithm l carries its value with a relative error of |l| 2^-24, at most
/// 14 * 6e-8 for scales of 1e-6; a logit is better than that by the factor 1 - opacity.
void expectClose(const SplatCloud& seen, const SplatCloud& expected) {
  EXPECT_EQ(seen.positions, expected.positions);
  EXPECT_EQ(seen.sh, expected.sh);
  EXPECT_EQ(seen.sh_degree, expected.sh_degree);
  EXPECT_EQ(seen.antialias, expected.antialias);
  EXPECT_EQ(seen.colour_space, expected.colour_space);
  EXPECT_EQ(seen.rotations, expected.rotations);
  for (size_t i = 0; i < expected.scales.size(); ++i) {
    ASSERT_NEAR(seen.scales[i], expected.scales[i], 1e-6f * expected.scales[i]);
  }
  for (size_t i = 0; i < expected.opacities.size(); ++i) {
    ASSERT_NEAR(seen.opacities[i], expected.opacities[i], 1e-6f);
  }
}

TEST_F(Ply, GivesARandomCloudBackForEveryDegreeAndFlag) {
  for (int degree = 0; degree <= 4; ++degree) {
    for (const bool ascii : {false, true}) {
      SplatCloud cloud = randomCloud(5000, degree, 11u + static_cast<unsigned>(degree));
      cloud.antialias = degree % 2 == 0 ? Antialias::kMip : Antialias::kClassic;
      cloud.colour_space = degree < 2 ? ColourSpace::kLinear : ColourSpace::kDisplay;
      expectClose(roundTrip(cloud, ascii), cloud);
    }
  }
}

TEST_F(Ply, WritesTheSameBytesAfterReading) {
  SplatCloud cloud = randomCloud(100000, 0, 3);
  std::mt19937 random(5);
  for (size_t i = 0; i < cloud.size(); i += 3) {
    // All magnitudes, down to subnormal numbers.
    cloud.opacities[i] = std::ldexp(1.0f, -int(random() % 150));
    cloud.scales[i * 3] = std::ldexp(1.7f, int(random() % 276) - 149);
  }
  for (const bool ascii : {false, true}) {
    writeSplatFile(cloud, path("a.ply"), {.ascii = ascii});
    writeSplatFile(readSplatFile(path("a.ply")), path("b.ply"), {.ascii = ascii});
    EXPECT_EQ(load(path("a.ply")), load(path("b.ply"))) << ascii;
  }
}

TEST_F(Ply, GivesOpacity0And1AndScale0BackExactly) {
  SplatCloud cloud = randomCloud(3, 1, 4);
  cloud.opacities = {0.0f, 1.0f, std::nextafter(1.0f, 0.0f)};
  cloud.scales = {
      0, 0, 0, 1, 1, 0, std::numeric_limits<float>::max(), std::numeric_limits<float>::min(), 1};
  const SplatCloud seen = roundTrip(cloud);
  EXPECT_EQ(seen.opacities, cloud.opacities);
  for (const size_t i : {0u, 1u, 2u, 3u, 4u, 5u, 8u}) EXPECT_EQ(seen.scales[i], cloud.scales[i]);
  // 1e-5: the logarithm 88.72 of the largest float32 has an ulp of 7.6e-6.
  EXPECT_NEAR(seen.scales[6] / cloud.scales[6], 1.0f, 1e-5f);
  EXPECT_NEAR(seen.scales[7] / cloud.scales[7], 1.0f, 1e-5f);
}

TEST_F(Ply, KeepsAnEmptyCloud) {
  SplatCloud cloud;
  cloud.sh_degree = 3;
  const SplatCloud seen = roundTrip(cloud);
  EXPECT_EQ(seen.size(), 0u);
  EXPECT_EQ(seen.sh_degree, 3);
  EXPECT_EQ(roundTrip(cloud, true).size(), 0u);
}

TEST_F(Ply, ReadsAndWritesTheSameWithOneAndTwoThreads) {
  const SplatCloud cloud = randomCloud(20000, 2, 9);
  SplatCloud one;
  SplatCloud two;
  withThreads(1, [&] {
    writeSplatFile(cloud, path("one.ply"), {});
    one = readSplatFile(path("one.ply"));
  });
  withThreads(2, [&] {
    writeSplatFile(cloud, path("two.ply"), {});
    two = readSplatFile(path("two.ply"));
  });
  EXPECT_EQ(load(path("one.ply")), load(path("two.ply")));
  EXPECT_EQ(one.scales, two.scales);
  EXPECT_EQ(one.opacities, two.opacities);
  EXPECT_EQ(one.rotations, two.rotations);
}

TEST_F(Ply, TakesTheZeroQuaternionAsIdentity) {
  RawPly ply = twoSplats();
  ply.at("rot_0").values = {0, 1};
  ply.at("rot_2").values = {0, 0};
  EXPECT_EQ(readSplatFile(store("a.ply", ply.bytes())).rotations[0], 1.0f);
}

TEST_F(Ply, RefusesALyingCountBeforeAllocating) {
  for (const char* format : {"ascii", "binary_little_endian"}) {
    RawPly ply = twoSplats();
    ply.format = format;
    std::string bytes = ply.bytes();
    bytes.replace(bytes.find("vertex 2"), 8, "vertex 1000000000000");
    expectError(ErrorCode::kFormat, {"a.ply", "1000000000000", "at most"},
                [&] { readSplatFile(store("a.ply", bytes)); });
  }
  // A list of 255 elements of a lying length.
  RawPly ply = twoSplats();
  ply.elements_before = "element face 1\nproperty list uint double v\n";
  ply.bytes_before = "\xff\xff\xff\xff";
  expectError(ErrorCode::kFormat, {"'v'", "4294967295"},
              [&] { readSplatFile(store("a.ply", ply.bytes())); });
}

TEST_F(Ply, SaysWhatIsWrongWithAHeader) {
  const auto refuse = [&](const std::string& bytes, std::initializer_list<const char*> texts) {
    expectError(ErrorCode::kFormat, texts, [&] { readSplatFile(store("a.ply", bytes)); });
  };
  const std::string good = twoSplats().bytes();
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string bytes = good;
    bytes.replace(bytes.find(from), from.size(), to);
    return bytes;
  };
  refuse("", {"a.ply", "empty"});
  refuse("obj\n", {"'obj?'", "'ply'"});
  refuse("plymouth", {"'plymouth'"});
  refuse(with("binary_little_endian", "binary_middle_endian"), {"middle", "ascii"});
  refuse(with("property float x\n", ""), {"'x'"});
  refuse(with("property float x", "property quad x"), {"quad", "TYPE"});
  refuse(with("property float y", "property float x"), {"twice"});
  refuse(with("vertex 2", "vertex -2"), {"vertex -2", "whole number"});
  refuse(with("vertex 2", "vertex 99999999999999999999"), {"whole number"});
  refuse(with("element vertex", "element splats"), {"no element 'vertex'"});
  refuse(with("f_dc_2", "f_rest_0"), {"1 properties f_rest", "0, 9, 24, 45 or 72"});
  refuse(with("end_header", "end_heater"), {"end_heater"});
  refuse(good.substr(0, 100), {"ends in its header"});
  refuse("ply\nformat ascii 1.0\ncomment " + std::string(2u << 20, 'c'), {"longer than"});
  RawPly degree = twoSplats("float", 1);
  degree.at("f_rest_8").name = "f_rest_9";
  refuse(degree.bytes(), {"f_rest_8"});
  RawPly text = twoSplats();
  text.format = "ascii";
  std::string bytes = text.bytes();
  bytes.replace(bytes.find("6.000000"), 8, "sixxxxxx");
  refuse(bytes, {"vertex 1", "sixxxxxx", "'z'"});
}

TEST_F(Ply, NamesOtherKindsOfPly) {
  RawPly ply = twoSplats();
  ply.elements_before = "element chunk 0\nproperty float min_x\n";
  expectError(ErrorCode::kFormat, {"compressed", "2 splats"},
              [&] { readSplatFile(store("a.ply", ply.bytes())); });
  RawPly scaffold = twoSplats();
  scaffold.at("f_dc_0").name = "f_anchor_feat_0";
  expectError(ErrorCode::kUnsupported, {"Scaffold-GS"},
              [&] { readSplatFile(store("a.ply", scaffold.bytes())); });
}

TEST_F(Ply, RefusesNumbersThatAreNotFinite) {
  for (const double value : {std::nan(""), HUGE_VAL, -HUGE_VAL, 1e300}) {
    for (const char* name : {"x", "f_dc_1", "opacity", "scale_2", "rot_3"}) {
      RawPly ply = twoSplats("double");
      ply.at(name).values[1] = value;
      expectError(ErrorCode::kFormat, {name, "vertex 1", "finite"},
                  [&] { readSplatFile(store("a.ply", ply.bytes())); });
    }
  }
  RawPly ply = twoSplats();
  ply.at("scale_1").values[1] = 100;
  expectError(ErrorCode::kFormat, {"100", "'scale_1' of vertex 1", "88.7"},
              [&] { readSplatFile(store("a.ply", ply.bytes())); });
}

TEST_F(Ply, RefusesFilesThatCannotBeReadOrWritten) {
  expectError(ErrorCode::kIo, {"missing.ply", "No such file"},
              [&] { readSplatFile(path("missing.ply")); });
  expectError(ErrorCode::kIo, {"folder"}, [&] { readSplatFile(folder_.string()); });
  expectError(ErrorCode::kFormat, {"'.txt'"}, [&] { readSplatFile(store("a.txt", "words")); });
  const SplatCloud cloud = randomCloud(2, 0, 1);
  expectError(ErrorCode::kUnsupported, {"'.obj'", ".ply"},
              [&] { writeSplatFile(cloud, path("a.obj"), {}); });
  expectError(ErrorCode::kIo, {"No such file"},
              [&] { writeSplatFile(cloud, path("missing/a.ply"), {}); });
  SplatCloud bad = cloud;
  bad.positions[4] = std::nanf("");
  store("kept.ply", "kept");
  expectError(ErrorCode::kInvalidArgument, {"position"},
              [&] { writeSplatFile(bad, path("kept.ply"), {}); });
  EXPECT_EQ(load(path("kept.ply")), "kept");
}

TEST_F(Ply, LeavesTheOldFileWhenCancelled) {
  store("a.ply", "old");
  Progress progress;
  progress.cancel();
  expectError(ErrorCode::kCancelled, {},
              [&] { writeSplatFile(randomCloud(10, 0, 1), path("a.ply"), {}, &progress); });
  EXPECT_EQ(load(path("a.ply")), "old");
  EXPECT_EQ(fileCount(), 1u);
}

TEST_F(Ply, GivesAnErrorForEveryTruncation) {
  for (const char* format : {"ascii", "binary_little_endian", "binary_big_endian"}) {
    RawPly ply = twoSplats("float", 1);
    ply.format = format;
    ply.elements_before = "element face 1\nproperty list uchar uchar v\n";
    ply.bytes_before = ply.format == "ascii" ? "2 1 1\n" : "\x02vv";
    const std::string bytes = ply.bytes();
    // The last line end and the digits before it are not needed by text.
    const size_t needed = bytes.size() - (ply.format == "ascii" ? 8 : 0);
    for (size_t length = 0; length < needed; ++length) {
      try {
        readSplatFile(store("a.ply", bytes.substr(0, length)));
        ADD_FAILURE() << format << " cut to " << length << " bytes is accepted";
      } catch (const Error&) {
      }
    }
  }
}

TEST_F(Ply, SurvivesAnyDamage) {
  std::mt19937 random(13);
  size_t refused = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    RawPly ply = twoSplats("float", trial % 3);
    ply.format = trial % 2 == 0 ? "binary_little_endian" : "ascii";
    ply.elements_before = "element face 1\nproperty list uchar uchar v\n";
    ply.bytes_before = trial % 2 == 0 ? "\x02vv" : "2 1 1\n";
    std::string bytes = ply.bytes();
    for (unsigned flips = 0; flips <= random() % 4; ++flips) {
      bytes[random() % bytes.size()] = static_cast<char>(random());
    }
    try {
      validate(readSplatFile(store("a.ply", bytes)), "cloud");
    } catch (const Error&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 500u);
}

TEST_F(Ply, KeepsAnUnknownFrameAndTurnsAKnownOneToItsOwn) {
  SplatCloud cloud = randomCloud(50, 2, 3);
  EXPECT_EQ(roundTrip(cloud).frame, Frame::kUnknown);
  EXPECT_EQ(roundTrip(cloud).positions, cloud.positions);
  cloud.frame = Frame::kRUB;
  const SplatCloud turned = roundTrip(cloud);
  EXPECT_EQ(turned.frame, Frame::kRDF);
  EXPECT_EQ(turned.positions[0], cloud.positions[0]);
  EXPECT_EQ(turned.positions[1], -cloud.positions[1]);
  EXPECT_EQ(turned.positions[2], -cloud.positions[2]);
  writeSplatFile(cloud, path("kept.ply"), {.frame = Frame::kRUB});
  const SplatCloud kept = readSplatFile(path("kept.ply"));
  EXPECT_EQ(kept.frame, Frame::kRUB);
  EXPECT_EQ(kept.positions, cloud.positions);
}

TEST_F(Ply, LeavesOutHarmonicsAboveTheLimit) {
  const SplatCloud cloud = randomCloud(20, 3, 4);
  writeSplatFile(cloud, path("low.ply"), {.sh_degree_limit = 1});
  const SplatCloud low = readSplatFile(path("low.ply"));
  ASSERT_EQ(low.sh_degree, 1);
  for (size_t i = 0; i < cloud.size(); ++i) {
    for (size_t k = 0; k < 12; ++k) EXPECT_EQ(low.sh[i * 12 + k], cloud.sh[i * 48 + k]);
  }
  expectError(ErrorCode::kInvalidArgument, {"5", "0 to 4"}, [&] {
    writeSplatFile(cloud, path("low.ply"), {.sh_degree_limit = 5});
  });
}

}  // namespace
}  // namespace stipple
