#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "data/clouds/cloud_transform.h"
#include "glb_builder.h"
#include "io/mesh_file.h"
#include "io/splats/splat_file.h"
#include "math/colour.h"
#include "random_cloud.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

constexpr char kPrefix[] = "KHR_gaussian_splatting:";

/// JSON of a splat primitive whose attributes are added one by one.
struct Primitive {
  std::string attributes;
  std::string extension = "\"kernel\":\"ellipse\",\"colorSpace\":\"srgb_rec709_display\"";
  std::string mode = "0";
  std::string more;

  Primitive& add(const std::string& name, int accessor) {
    if (!attributes.empty()) attributes.push_back(',');
    attributes.append("\"").append(name).append("\":").append(std::to_string(accessor));
    return *this;
  }
  Primitive& addSplat(const std::string& name, int accessor) {
    return add(std::string(kPrefix).append(name), accessor);
  }
  std::string text() const {
    return std::string("{\"mode\":")
        .append(mode)
        .append(",\"attributes\":{")
        .append(attributes)
        .append("},\"extensions\":{\"KHR_gaussian_splatting\":{")
        .append(extension)
        .append("}}")
        .append(more)
        .append("}");
  }
};

/// Appended one by one: GCC 12 sees trouble in a sum of texts that is none.
std::string listed(const std::vector<std::string>& texts) {
  std::string list;
  for (const std::string& text : texts) {
    if (!list.empty()) list.push_back(',');
    list.append(text);
  }
  return list;
}

std::string scene(const std::string& primitives, const std::string& nodes = "{\"mesh\":0}") {
  return std::string(
             "\"extensionsUsed\":[\"KHR_gaussian_splatting\"],\"scenes\":[{\"nodes\":[0]}],")
      .append("\"nodes\":[")
      .append(nodes)
      .append("],\"meshes\":[{\"primitives\":[")
      .append(primitives)
      .append("]}]");
}

class GltfSplats : public ScratchFolder {
 protected:
  SplatCloud read(const std::string& bytes) { return readSplatFile(store("a.glb", bytes)); }
  void refused(const std::string& bytes, std::initializer_list<const char*> texts,
               ErrorCode code = ErrorCode::kFormat) {
    SCOPED_TRACE(texts.size() > 0 ? *texts.begin() : "");
    expectError(code, texts, [&] { read(bytes); });
  }

  /// A primitive whose splats are an SPZ file. In: claimed, the splats that its accessor has.
  static std::string packedGlb(const std::string& spz, size_t claimed, const std::string& more = "",
                               const std::string& nodes = "{\"mesh\":0}") {
    GlbBuilder file;
    const int view = file.addView(spz);
    Primitive primitive;
    primitive.add("POSITION", file.addAccessor("\"componentType\":5126,\"count\":" +
                                               std::to_string(claimed) + ",\"type\":\"VEC3\""));
    primitive.extension = std::string(more)
                              .append(
                                  "\"extensions\":{\"KHR_gaussian_splatting_compression_spz_2\":"
                                  "{\"bufferView\":")
                              .append(std::to_string(view))
                              .append("}}");
    return file.glb("\"extensionsRequired\":[\"KHR_gaussian_splatting_compression_spz_2\"]," +
                    scene(primitive.text(), nodes));
  }

  /// Two splats of degree 1 as floats.
  static Primitive twoSplats(GlbBuilder& file) {
    Primitive primitive;
    primitive.add("POSITION", file.addFloats({1, 2, 3, 4, 5, 6}, 3));
    // Twice a half turn about x; a quarter turn about z.
    primitive.addSplat("ROTATION", file.addFloats({1, 0, 0, 0, 0, 0, 0.6f, 0.8f}, 4));
    primitive.addSplat("SCALE", file.addFloats({0.5f, 0, 2, 1, 1, 1}, 3));
    primitive.addSplat("OPACITY", file.addFloats({0, 0.25f}, 1));
    primitive.addSplat("SH_DEGREE_0_COEF_0", file.addFloats({-1, 0, 1, 2, 3, 4}, 3));
    for (int m = 0; m < 3; ++m) {
      const float v = static_cast<float>(10 * m);
      primitive.addSplat("SH_DEGREE_1_COEF_" + std::to_string(m),
                         file.addFloats({v, v + 1, v + 2, v + 3, v + 4, v + 5}, 3));
    }
    return primitive;
  }
};

TEST_F(GltfSplats, ReadsAHandMadeFile) {
  GlbBuilder file;
  const SplatCloud cloud = read(file.glb(scene(twoSplats(file).text())));
  validate(cloud, "cloud");
  EXPECT_EQ(cloud.positions, (std::vector<float>{1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(cloud.rotations, (std::vector<float>{0, 1, 0, 0, 0.8f, 0, 0, 0.6f}));
  EXPECT_EQ(cloud.scales, (std::vector<float>{0.5f, 0, 2, 1, 1, 1}));
  EXPECT_EQ(cloud.opacities, (std::vector<float>{0, 0.25f}));
  EXPECT_EQ(cloud.sh_degree, 1);
  EXPECT_EQ(cloud.sh, (std::vector<float>{-1, 0, 1, 0, 1, 2, 10, 11, 12, 20, 21, 22,  //
                                          2,  3, 4, 3, 4, 5, 13, 14, 15, 23, 24, 25}));
  EXPECT_EQ(cloud.colour_space, ColourSpace::kDisplay);
  EXPECT_EQ(cloud.antialias, Antialias::kClassic);
  EXPECT_EQ(cloud.frame, Frame::kLUF);
}

TEST_F(GltfSplats, ReadsBothColourSpaces) {
  GlbBuilder file;
  Primitive primitive = twoSplats(file);
  primitive.extension =
      "\"kernel\":\"ellipse\",\"colorSpace\":\"lin_rec709_display\","
      "\"projection\":\"perspective\",\"sortingMethod\":\"anything\"";
  EXPECT_EQ(read(file.glb(scene(primitive.text()))).colour_space, ColourSpace::kLinear);
}

TEST_F(GltfSplats, ReadsQuantisedAndSparseAccessors) {
  GlbBuilder file;
  Primitive primitive;
  const std::string normalized = ",\"normalized\":true";
  // Bytes of an element of three are padded to four, which a stride says.
  const int view = file.addView({"\x00\x80\xff\x00\x01\x02\x03\x00", 8}, 4);
  const int indices = file.addView(std::string("\1\0", 2));
  const std::vector<float> moved = {7, 8, 9};
  const int values =
      file.addView({reinterpret_cast<const char*>(moved.data()), moved.size() * sizeof(float)});
  const int base = file.addFloats({1, 2, 3, 4, 5, 6}, 3) - 0;
  const int sparse = file.addAccessor(
      "\"bufferView\":" + std::to_string(values + 1) +
      ",\"componentType\":5126,\"count\":2,\"type\":\"VEC3\",\"sparse\":{\"count\":1,"
      "\"indices\":{\"bufferView\":" +
      std::to_string(indices) +
      ",\"componentType\":5121},\"values\":{\"bufferView\":" + std::to_string(values) + "}}");
  EXPECT_EQ(base, 0);
  primitive.add("POSITION", sparse);
  primitive.addSplat("ROTATION",
                     file.add<int8_t>({127, 0, 0, 0, 0, 0, -76, 102}, "VEC4", 5120, 4, normalized));
  primitive.addSplat("SCALE", file.addAccessor("\"bufferView\":" + std::to_string(view) +
                                               ",\"componentType\":5121,\"count\":2,"
                                               "\"type\":\"VEC3\",\"normalized\":true"));
  primitive.addSplat("OPACITY", file.add<uint16_t>({0, 65535}, "SCALAR", 5123, 1, normalized));
  primitive.addSplat("SH_DEGREE_0_COEF_0", file.addFloats({-1, 0, 1, 2, 3, 4}, 3));
  const SplatCloud cloud = read(file.glb(scene(primitive.text())));
  EXPECT_EQ(cloud.positions, (std::vector<float>{1, 2, 3, 7, 8, 9}));
  EXPECT_EQ(cloud.rotations[1], 1.0f);
  // (-76, 102) / 127 has the length 1.0016; it is made a unit quaternion, float32's rounding off.
  EXPECT_NEAR(cloud.rotations[4], 102.0 / std::hypot(76.0, 102.0), 1e-7);
  EXPECT_NEAR(cloud.rotations[7], -76.0 / std::hypot(76.0, 102.0), 1e-7);
  const float byte = 255.0f;
  EXPECT_EQ(cloud.scales, (std::vector<float>{0, 128 / byte, 1, 1 / byte, 2 / byte, 3 / byte}));
  EXPECT_EQ(cloud.opacities, (std::vector<float>{0, 1}));
}

TEST_F(GltfSplats, PlacesSplatsByTheirNodes) {
  GlbBuilder file;
  // Splats along x, with a colour that grows towards +x: coefficient 3 of degree 1 is -x.
  Primitive primitive;
  primitive.add("POSITION", file.addFloats({1, 0, 0}, 3));
  primitive.addSplat("ROTATION", file.addFloats({0, 0, 0, 1}, 4));
  primitive.addSplat("SCALE", file.addFloats({3, 2, 1}, 3));
  primitive.addSplat("OPACITY", file.addFloats({0.5f}, 1));
  primitive.addSplat("SH_DEGREE_0_COEF_0", file.addFloats({0, 0, 0}, 3));
  primitive.addSplat("SH_DEGREE_1_COEF_0", file.addFloats({0, 0, 0}, 3));
  primitive.addSplat("SH_DEGREE_1_COEF_1", file.addFloats({0, 0, 0}, 3));
  primitive.addSplat("SH_DEGREE_1_COEF_2", file.addFloats({-1, -1, -1}, 3));
  // The parent moves by (10, 0, 0) and doubles; the child turns x to y.
  const SplatCloud cloud = read(
      file.glb(scene(primitive.text(),
                     "{\"children\":[1],\"translation\":[10,0,0],\"scale\":[2,2,2]},"
                     "{\"mesh\":0,\"rotation\":[0,0,0.70710678118654752,0.70710678118654752]}")));
  // One rounding to float32 of numbers up to 10.
  const float expected[] = {10, 2, 0};
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(cloud.positions[size_t(k)], expected[k], 1e-6) << k;
  EXPECT_NEAR(cloud.scales[0], 6, 1e-6);
  EXPECT_NEAR(cloud.rotations[0], M_SQRT1_2, 1e-7);
  EXPECT_NEAR(cloud.rotations[3], M_SQRT1_2, 1e-7);
  // Now it grows towards +y: coefficient 1 is -y.
  EXPECT_NEAR(cloud.sh[3], -1, 1e-6);
  EXPECT_NEAR(cloud.sh[6], 0, 1e-6);
  EXPECT_NEAR(cloud.sh[9], 0, 1e-6);
}

TEST_F(GltfSplats, JoinsTheSplatsOfAScene) {
  GlbBuilder file;
  const Primitive first = twoSplats(file);
  Primitive second;
  second.add("POSITION", file.addFloats({7, 8, 9}, 3));
  second.addSplat("ROTATION", file.addFloats({0, 0, 0, 1}, 4));
  second.addSplat("SCALE", file.addFloats({1, 1, 1}, 3));
  second.addSplat("OPACITY", file.addFloats({1}, 1));
  second.addSplat("SH_DEGREE_0_COEF_0", file.addFloats({9, 9, 9}, 3));
  const std::string points = "{\"mode\":0,\"attributes\":{\"POSITION\":0}}";
  const std::string nodes =
      "{\"children\":[1,2]},{\"mesh\":0},{\"mesh\":0,\"translation\":[0,0,1]}";
  const SplatCloud cloud =
      read(file.glb(scene(listed({first.text(), points, second.text()}), nodes)));
  ASSERT_EQ(cloud.size(), 6u);
  ASSERT_EQ(cloud.sh_degree, 1);
  EXPECT_EQ(cloud.positions, (std::vector<float>{1, 2, 3, 4, 5, 6, 7, 8, 9,  //
                                                 1, 2, 4, 4, 5, 7, 7, 8, 10}));
  EXPECT_EQ(cloud.sh[24], 9.0f);
  EXPECT_EQ(cloud.sh[27], 0.0f);

  Primitive linear = second;
  linear.extension = "\"kernel\":\"ellipse\",\"colorSpace\":\"lin_rec709_display\"";
  refused(file.glb(scene(listed({second.text(), linear.text()}))),
          {"a.glb", "several colour spaces"}, ErrorCode::kUnsupported);
}

TEST_F(GltfSplats, RoundTripsBitForBit) {
  for (const char* name : {"trip.glb", "trip.gltf", "na me#%.gltf"}) {
    for (int degree = 0; degree <= 3; ++degree) {
      SCOPED_TRACE(std::string(name) + " " + std::to_string(degree));
      SplatCloud cloud = randomCloud(1000, degree, 1);
      cloud.frame = Frame::kLUF;
      cloud.colour_space = degree % 2 == 0 ? ColourSpace::kLinear : ColourSpace::kDisplay;
      cloud.antialias = degree < 2 ? Antialias::kMip : Antialias::kClassic;
      writeSplatFile(cloud, path(name), {});
      const SplatCloud back = readSplatFile(path(name));
      EXPECT_EQ(back.positions, cloud.positions);
      EXPECT_EQ(back.rotations, cloud.rotations);
      EXPECT_EQ(back.scales, cloud.scales);
      EXPECT_EQ(back.opacities, cloud.opacities);
      EXPECT_EQ(back.sh, cloud.sh);
      EXPECT_EQ(back.colour_space, cloud.colour_space);
      EXPECT_EQ(back.antialias, cloud.antialias);
      EXPECT_EQ(back.frame, Frame::kLUF);
    }
  }
}

TEST_F(GltfSplats, TurnsToItsFrameOrNamesAnother) {
  SplatCloud cloud = randomCloud(10, 1, 2);
  cloud.frame = Frame::kRDF;
  writeSplatFile(cloud, path("a.glb"), {});
  const SplatCloud turned = readSplatFile(path("a.glb"));
  EXPECT_EQ(turned.frame, Frame::kLUF);
  EXPECT_EQ(turned.positions[0], -cloud.positions[0]);
  EXPECT_EQ(turned.positions[1], -cloud.positions[1]);
  EXPECT_EQ(turned.positions[2], cloud.positions[2]);
  writeSplatFile(cloud, path("a.glb"), {.frame = Frame::kRDF});
  const SplatCloud same = readSplatFile(path("a.glb"));
  EXPECT_EQ(same.frame, Frame::kRDF);
  EXPECT_EQ(same.positions, cloud.positions);
}

TEST_F(GltfSplats, FallBackColoursAreLinear) {
  for (const ColourSpace space : {ColourSpace::kDisplay, ColourSpace::kLinear}) {
    SplatCloud cloud = randomCloud(20, 0, 3);
    cloud.colour_space = space;
    cloud.sh[0] = -5;
    cloud.sh[1] = 5;
    writeSplatFile(cloud, path("a.gltf"), {});
    const auto json = nlohmann::json::parse(load(path("a.gltf")));
    const auto& accessor =
        json["accessors"][size_t(json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"])];
    EXPECT_EQ(accessor["componentType"], 5123);
    EXPECT_EQ(accessor["normalized"], true);
    const size_t offset = json["bufferViews"][size_t(accessor["bufferView"])]["byteOffset"];
    const std::string bytes = load(path("a.bin"));
    for (size_t i = 0; i < cloud.size(); ++i) {
      for (size_t c = 0; c < 4; ++c) {
        uint16_t code = 0;
        std::memcpy(&code, &bytes[offset + i * 8 + c * 2], 2);
        double expected = double(cloud.opacities[i]);
        if (c < 3) {
          expected = 0.5 + 0.28209479177387814 * double(cloud.sh[i * 3 + c]);
          if (space == ColourSpace::kDisplay) expected = srgbToLinear(expected);
        }
        // Half a step of 16 bits, and what the transfer function's table is off.
        EXPECT_NEAR(code / 65535.0, std::clamp(expected, 0.0, 1.0), 0.5 / 65535.0 + 1e-7);
      }
    }
  }
}

TEST_F(GltfSplats, RefusesABinaryPartThatIsCutShort) {
  GlbBuilder mesh;
  mesh.addFloats({0, 0, 0, 1, 0, 0, 0, 1, 0}, 3);
  std::string bytes = mesh.glb(
      "\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],"
      "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0}}]}]");
  // The head tells the size that the file has, so that the binary part alone is wrong.
  for (const size_t missing : {6, 36, 40}) {
    std::string cut = bytes.substr(0, bytes.size() - missing);
    const auto size = static_cast<uint32_t>(cut.size());
    std::memcpy(&cut[8], &size, sizeof size);
    expectError(ErrorCode::kFormat, {"a.glb", "its binary part says that it has"},
                [&] { readMeshFile(store("a.glb", cut)); });
  }
}

TEST_F(GltfSplats, IsToldFromMeshesByContent) {
  GlbBuilder file;
  const std::string bytes = file.glb(scene(twoSplats(file).text()));
  EXPECT_EQ(readSplatFile(store("no_extension", bytes)).size(), 2u);
  expectError(ErrorCode::kFormat, {"a.glb", "no triangles"},
              [&] { readMeshFile(store("a.glb", bytes)); });
  GlbBuilder mesh;
  mesh.addFloats({0, 0, 0, 1, 0, 0, 0, 1, 0}, 3);
  refused(mesh.glb("\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],"
                   "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0}}]}]"),
          {"a.glb", "no splats", "KHR_gaussian_splatting"});
}

TEST_F(GltfSplats, ReadsSplatsThatArePackedAsSpz) {
  for (const int version : {3, 4}) {
    SplatCloud cloud = randomCloud(50, 2, 6);
    cloud.antialias = Antialias::kMip;
    writeSplatFile(cloud, path("a.spz"), {.version = version});
    SplatCloud expected = readSplatFile(path("a.spz"));
    ASSERT_EQ(expected.frame, Frame::kRUB);
    convertFrame(expected, Frame::kLUF);
    const SplatCloud seen = read(packedGlb(load(path("a.spz")), 50));
    EXPECT_EQ(seen.positions, expected.positions);
    EXPECT_EQ(seen.rotations, expected.rotations);
    EXPECT_EQ(seen.scales, expected.scales);
    EXPECT_EQ(seen.opacities, expected.opacities);
    EXPECT_EQ(seen.sh, expected.sh);
    EXPECT_EQ(seen.sh_degree, 2);
    EXPECT_EQ(seen.frame, Frame::kLUF);
    EXPECT_EQ(seen.antialias, Antialias::kMip);
    EXPECT_EQ(seen.colour_space, ColourSpace::kDisplay);
    const SplatCloud moved =
        read(packedGlb(load(path("a.spz")), 50, "\"colorSpace\":\"lin_rec709_display\",",
                       "{\"mesh\":0,\"translation\":[8,0,0]}"));
    EXPECT_EQ(moved.colour_space, ColourSpace::kLinear);
    // One rounding to float32 of numbers up to 40.
    EXPECT_NEAR(moved.positions[0], expected.positions[0] + 8.0f, 4e-6);
  }
}

TEST_F(GltfSplats, SaysWhatIsWrongWithPackedSplats) {
  writeSplatFile(randomCloud(50, 1, 7), path("a.spz"), {.version = 3});
  const std::string spz = load(path("a.spz"));
  const char* part = "a.glb: mesh 0, primitive 0";
  refused(packedGlb(spz, 51), {part, "accessors of 51", "50 splats"});
  refused(packedGlb("no splats at all", 50), {part, "SPZ", "NGSP"});
  std::string glb = packedGlb(spz, 50);
  glb.replace(glb.find("_2\":{\"bufferView\":0"), 19, "_2\":{\"bufferView\":7");
  refused(glb, {part, "spz_2", "buffer view 7"});
  glb = packedGlb(spz, 50);
  glb.replace(glb.find("_2\":{\"bufferView\""), 17, "_2\":{\"bufferLook\"");
  refused(glb, {part, "spz_2", "'bufferView'"});
  for (size_t length = 1; length < spz.size(); length += 1 + length / 16) {
    refused(packedGlb(spz.substr(0, length), 50), {part});
  }
}

TEST_F(GltfSplats, SaysWhatIsMissingOrUnknown) {
  GlbBuilder file;
  const Primitive good = twoSplats(file);
  const auto changed = [&](const std::string& from, const std::string& to) {
    Primitive primitive = good;
    for (std::string* text : {&primitive.attributes, &primitive.extension}) {
      const size_t at = text->find(from);
      if (at != std::string::npos) text->replace(at, from.size(), to);
    }
    return file.glb(scene(primitive.text()));
  };
  for (const char* name :
       {"POSITION", "ROTATION", "SCALE", "OPACITY", "SH_DEGREE_0_COEF_0", "SH_DEGREE_1_COEF_1"}) {
    refused(changed(name, "OTHER"), {"a.glb: mesh 0, primitive 0", "no attribute", name});
  }
  refused(changed("ellipse", "cube"), {"kernel 'cube'", "ellipse"}, ErrorCode::kUnsupported);
  refused(changed("srgb_rec709_display", "p3"), {"colorSpace 'p3'", "lin_rec709_display"},
          ErrorCode::kUnsupported);
  refused(changed("\"kernel\"", "\"projection\":\"fish\",\"kernel\""), {"projection 'fish'"},
          ErrorCode::kUnsupported);
  refused(changed("\"kernel\"", "\"extensions\":{\"KHR_packed\":{\"bufferView\":0}},\"kernel\""),
          {"compression 'KHR_packed'", "compression_spz_2"}, ErrorCode::kUnsupported);
  Primitive primitive = good;
  primitive.mode = "4";
  refused(file.glb(scene(primitive.text())), {"mode 4", "mode 0"});
  refused(file.glb("\"extensionsRequired\":[\"EXT_odd\"]," + scene(good.text())),
          {"requires", "EXT_odd"}, ErrorCode::kUnsupported);
}

TEST_F(GltfSplats, RefusesValuesThatNoSplatHas) {
  const auto with = [&](const char* name, const std::vector<float>& values, size_t width) {
    GlbBuilder file;
    Primitive primitive = twoSplats(file);
    const int accessor = file.addFloats(values, width);
    const size_t at = primitive.attributes.find(name);
    const size_t colon = primitive.attributes.find(':', at + std::string(name).size());
    const size_t end = primitive.attributes.find(',', colon);
    primitive.attributes.replace(colon + 1, end - colon - 1, std::to_string(accessor));
    return file.glb(scene(primitive.text()));
  };
  const char* part = "a.glb: mesh 0, primitive 0";
  refused(with("POSITION", {1, NAN, 3, 4, 5, 6}, 3), {part, "position", "nan"});
  refused(with("SCALE", {1, -1, 3, 4, 5, 6}, 3), {part, "scale"});
  refused(with("OPACITY", {0, 1.5f}, 1), {part, "opacit"});
  refused(with("ROTATION", {0, 0, 0, 0, 0, 0, 0, 1}, 4), {part, "rotation"});
  refused(with("OPACITY", {0, 1, 1}, 1), {part, "OPACITY", "3 elements", "2 splats"});
  refused(with("SCALE", {1, 1, 1, 1}, 2), {part, "SCALE", "2 components", "3 are needed"});
}

TEST_F(GltfSplats, RefusesAccessorsOutsideTheirBuffers) {
  GlbBuilder file;
  const Primitive primitive = twoSplats(file);
  const auto refusedWith = [&](const std::string& from, const std::string& to,
                               std::initializer_list<const char*> texts) {
    SCOPED_TRACE(to);
    std::string json = file.json(scene(primitive.text()), "data.bin");
    ASSERT_NE(json.find(from), std::string::npos);
    json.replace(json.find(from), from.size(), to);
    store("data.bin", file.data());
    expectError(ErrorCode::kFormat, texts, [&] { readSplatFile(store("a.gltf", json)); });
  };
  refusedWith("\"count\":2,", "\"count\":3,", {"a.gltf", "POSITION", "3 elements", "24 bytes"});
  refusedWith("\"bufferView\":1,", "\"bufferView\":99,", {"ROTATION", "buffer view 99"});
  refusedWith("\"byteOffset\":24,", "\"byteOffset\":2400,", {"ROTATION", "2400"});
  refusedWith("\"byteLength\":24}", "\"byteLength\":23}", {"POSITION", "23 bytes"});
  refusedWith("\"bufferView\":0,", "\"bufferView\":0,\"byteOffset\":4,", {"POSITION", "byte 4"});
  refusedWith("\"byteLength\":24}", "\"byteLength\":24,\"byteStride\":252}", {"POSITION", "252"});
  GlbBuilder huge;
  Primitive lying = twoSplats(huge);
  const int accessor = huge.addAccessor(
      "\"bufferView\":0,\"componentType\":5126,\"count\":1099511627776,\"type\":\"VEC3\"");
  lying.attributes.replace(lying.attributes.find("\"POSITION\":0"), 12,
                           "\"POSITION\":" + std::to_string(accessor));
  refused(huge.glb(scene(lying.text())), {"POSITION", "1099511627776"});
  const int nothing =
      huge.addAccessor("\"componentType\":5126,\"count\":9000000,\"type\":\"VEC3\"");
  const std::string before = "\"POSITION\":" + std::to_string(accessor);
  lying.attributes.replace(lying.attributes.find(before), before.size(),
                           "\"POSITION\":" + std::to_string(nothing));
  refused(huge.glb(scene(lying.text())), {"POSITION", "no buffer view"});
}

TEST_F(GltfSplats, EveryTruncatedPrefixIsRefused) {
  GlbBuilder file;
  const std::string bytes = file.glb(scene(twoSplats(file).text()));
  for (size_t length = 0; length < bytes.size(); ++length) {
    refused(bytes.substr(0, length), {"a.glb"});
  }
}

TEST_F(GltfSplats, KeepsTheOldFilesWhereWritingFails) {
  writeSplatFile(randomCloud(10, 0, 4), path("a.gltf"), {});
  const std::string before = load(path("a.gltf"));
  Progress cancelled;
  cancelled.cancel();
  expectError(ErrorCode::kCancelled, {},
              [&] { writeSplatFile(randomCloud(20, 0, 5), path("a.gltf"), {}, &cancelled); });
  std::filesystem::remove(path("a.bin"));
  std::filesystem::create_directory(path("a.bin"));
  expectError(ErrorCode::kIo, {"a.bin", "folder"},
              [&] { writeSplatFile(randomCloud(20, 0, 5), path("a.gltf"), {}); });
  EXPECT_EQ(load(path("a.gltf")), before);
  EXPECT_EQ(fileCount(), 2u);
  expectError(ErrorCode::kUnsupported, {"b.glb", "empty"},
              [&] { writeSplatFile(SplatCloud(), path("b.glb"), {}); });
}

}  // namespace
}  // namespace stipple
