#include "io/mesh_file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "glb_builder.h"
#include "io/image_file.h"
#include "math/colour.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

class MeshFile : public ScratchFolder {
 protected:
  TriMesh read(const std::string& bytes) { return readMeshFile(store("a.glb", bytes)); }

  /// A picture of 2 x 2 pixels as PNG bytes: red, green over blue, white.
  std::string png(float alpha = 1.0f) {
    Image image;
    image.width = image.height = 2;
    image.channels = 4;
    image.transfer = Transfer::kSrgb;
    image.pixels = {1, 0, 0, 1, 0, 1, 0, 1, 0, 0, 1, 1, 1, 1, 1, 1};
    for (float& value : image.pixels) value *= alpha;
    writeImageFile(image, path("texture.png"));
    return load(path("texture.png"));
  }
};

const std::vector<float> kTriangle = {0, 0, 0, 1, 0, 0, 0, 1, 0};

/// One node with one mesh of one primitive; each argument is JSON text without its brackets.
std::string scene(const std::string& primitive, const std::string& node = "",
                  const std::string& rest = "") {
  std::string text = "\"scenes\":[{\"nodes\":[0]}],\"scene\":0,\"nodes\":[{\"mesh\":0";
  if (!node.empty()) text.append(",").append(node);
  text.append("}],\"meshes\":[{\"primitives\":[{").append(primitive).append("}]}]");
  if (!rest.empty()) text.append(",").append(rest);
  return text;
}

TEST_F(MeshFile, ReadsATriangleAndTurnsYUp) {
  GlbBuilder file;
  file.addFloats({0, 0, 0, 1, 2, 3, 0, 1, 0}, 3);
  file.addIndices({2, 0, 1});
  const TriMesh mesh = read(file.glb(scene("\"attributes\":{\"POSITION\":0},\"indices\":1")));
  validate(mesh);
  EXPECT_EQ(mesh.positions, (std::vector<float>{0, 0, 0, 1, -3, 2, 0, 0, 1}));
  EXPECT_EQ(mesh.triangles, (std::vector<uint32_t>{2, 0, 1}));
  EXPECT_TRUE(mesh.corner_normals.empty());
  EXPECT_TRUE(mesh.corner_uvs.empty());
  EXPECT_TRUE(mesh.corner_colours.empty());
  ASSERT_EQ(mesh.materials.size(), 1u);
  EXPECT_EQ(mesh.materials[0].colour, MaterialColour::kConstant);
  // The default material of glTF is white.
  EXPECT_EQ(mesh.materials[0].base_colour[0], 1.0f);
}

TEST_F(MeshFile, AppliesTheTransformsOfAllAncestors) {
  GlbBuilder file;
  file.addFloats(kTriangle, 3);
  file.addFloats({0, 0, 1, 0, 0, 1, 0, 0, 1}, 3);
  const std::string mesh_text =
      "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"NORMAL\":1}}]}]";
  // The child turns by 90 degrees about glTF's z and stretches x; the parent moves along x.
  const TriMesh mesh = read(file.glb(
      "\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"matrix\":[1,0,0,0,0,1,0,0,0,0,1,0,10,0,0,1],"
      "\"children\":[1]},{\"mesh\":0,\"rotation\":[0,0,0.70710678,0.70710678],"
      "\"scale\":[2,1,1],\"translation\":[0,0,5]}]," +
      mesh_text));
  const std::vector<float> expected = {10, -5, 0, 10, -5, 2, 9, -5, 0};
  for (size_t i = 0; i < expected.size(); ++i) {
    // 1e-6: the quaternion is given with eight digits.
    EXPECT_NEAR(mesh.positions[i], expected[i], 1e-6f) << i;
  }
  EXPECT_NEAR(mesh.corner_normals[1], -1.0f, 1e-6f);
}

TEST_F(MeshFile, KeepsMirroredTrianglesOutsideOut) {
  GlbBuilder file;
  file.addFloats(kTriangle, 3);
  file.addFloats({0, 0, 1, 0, 0, 1, 0, 0, 1}, 3);
  const TriMesh mesh =
      read(file.glb(scene("\"attributes\":{\"POSITION\":0,\"NORMAL\":1}", "\"scale\":[-1,1,1]")));
  EXPECT_EQ(mesh.triangles, (std::vector<uint32_t>{0, 2, 1}));
  // glTF's +z is −y here; the mirror in x leaves it.
  EXPECT_EQ(mesh.corner_normals[1], -1.0f);
}

TEST_F(MeshFile, ReadsStripsFansAndUnindexedTriangles) {
  GlbBuilder file;
  file.addFloats({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 2, 2, 0, 3, 3, 0}, 3);
  const auto triangles = [&](int mode) {
    return read(file.glb(scene("\"attributes\":{\"POSITION\":0},\"mode\":" + std::to_string(mode))))
        .triangles;
  };
  EXPECT_EQ(triangles(4), (std::vector<uint32_t>{0, 1, 2, 3, 4, 5}));
  EXPECT_EQ(triangles(5), (std::vector<uint32_t>{0, 1, 2, 1, 3, 2, 2, 3, 4, 3, 5, 4}));
  EXPECT_EQ(triangles(6), (std::vector<uint32_t>{0, 1, 2, 0, 2, 3, 0, 3, 4, 0, 4, 5}));
  expectError(ErrorCode::kFormat, {"no triangles"}, [&] { triangles(0); });
  expectError(ErrorCode::kFormat, {"no triangles"}, [&] { triangles(1); });
}

TEST_F(MeshFile, ReadsQuantisedAndSparseAccessors) {
  // Rows of four shorts for vectors of three: the accessor steps over the fourth.
  GlbBuilder strided;
  strided.add<int16_t>({0, 0, 0, 7, 100, 0, 0, 7, 0, -50, 0, 7}, "VEC3", 5122, 4);
  std::string json = strided.json(scene("\"attributes\":{\"POSITION\":0}", "",
                                        "\"extensionsRequired\":[\"KHR_mesh_quantization\"]"),
                                  "data.bin");
  json.replace(json.find("\"byteLength\":24}]"), 17, "\"byteLength\":24,\"byteStride\":8}]");
  store("data.bin", strided.data());
  EXPECT_EQ(readMeshFile(store("a.gltf", json)).positions,
            (std::vector<float>{0, 0, 0, 100, 0, 0, 0, 0, -50}));

  GlbBuilder sparse;
  const int index = sparse.addView(std::string("\x02\x00", 2));
  const std::vector<float> moved = {0, 9, 0};
  const int values = sparse.addView(std::string(reinterpret_cast<const char*>(moved.data()), 12));
  sparse.addAccessor(
      "\"componentType\":5126,\"count\":3,\"type\":\"VEC3\",\"sparse\":{\"count\":1,"
      "\"indices\":{\"bufferView\":" +
      std::to_string(index) +
      ",\"componentType\":5123},\"values\":{\"bufferView\":" + std::to_string(values) + "}}");
  EXPECT_EQ(read(sparse.glb(scene("\"attributes\":{\"POSITION\":0}"))).positions,
            (std::vector<float>{0, 0, 0, 0, 0, 0, 0, 0, 9}));
}

TEST_F(MeshFile, MultipliesVertexColoursByTheFactor) {
  GlbBuilder file;
  file.addFloats(kTriangle, 3);
  file.add<uint8_t>({255, 0, 0, 255, 0, 255, 0, 51, 0, 0, 255, 0}, "VEC4", 5121, 4,
                    ",\"normalized\":true");
  const auto colours = [&](const std::string& mode) {
    const TriMesh mesh = read(file.glb(
        scene("\"attributes\":{\"POSITION\":0,\"COLOR_0\":1},\"material\":0", "",
              "\"materials\":[{\"alphaMode\":\"" + mode +
                  "\",\"pbrMetallicRoughness\":{\"baseColorFactor\":[0.5,0.25,1,0.5]}}]")));
    validate(mesh);
    EXPECT_EQ(mesh.materials[0].colour, MaterialColour::kCorner);
    return mesh.corner_colours;
  };
  // Vertex colours are linear in glTF; alpha counts only where the material blends.
  EXPECT_EQ(colours("OPAQUE"), (std::vector<float>{0.5f, 0, 0, 1, 0, 0.25f, 0, 1, 0, 0, 1, 1}));
  EXPECT_EQ(colours("BLEND"),
            (std::vector<float>{0.5f, 0, 0, 0.5f, 0, 0.25f, 0, 0.1f, 0, 0, 1, 0}));
  EXPECT_EQ(colours("MASK"), (std::vector<float>{0.5f, 0, 0, 1, 0, 0.25f, 0, 0, 0, 0, 1, 0}));
}

TEST_F(MeshFile, ReadsEmbeddedAndExternalTextures) {
  const std::string picture = png();
  GlbBuilder file;
  file.addFloats(kTriangle, 3);
  file.addFloats({0, 0, 1, 0, 0.25f, 1}, 2);
  const int view = file.addView(picture);
  const auto rest = [](const std::string& image, const std::string& material) {
    return "\"images\":[{" + image +
           "}],\"textures\":[{\"source\":0}],\"materials\":[{"
           "\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":0" +
           material;
  };
  const std::string primitive = "\"attributes\":{\"POSITION\":0,\"TEXCOORD_0\":1},\"material\":0";
  const std::string embedded = "\"mimeType\":\"image/png\",\"bufferView\":" + std::to_string(view);
  const TriMesh mesh = read(file.glb(scene(primitive, "", rest(embedded, "}}}]"))));
  validate(mesh);
  ASSERT_EQ(mesh.textures.size(), 1u);
  EXPECT_EQ(mesh.materials[0].colour, MaterialColour::kTexture);
  EXPECT_EQ(mesh.textures[0].pixels,
            (std::vector<float>{1, 0, 0, 1, 0, 1, 0, 1, 0, 0, 1, 1, 1, 1, 1, 1}));
  // v counts from the top in glTF and from the bottom here.
  EXPECT_EQ(mesh.corner_uvs, (std::vector<float>{0, 1, 1, 1, 0.25f, 0}));

  // The factor is linear, the picture display-encoded.
  const TriMesh tinted =
      read(file.glb(scene(primitive, "", rest(embedded, "},\"baseColorFactor\":[0.5,1,1,1]}}]"))));
  EXPECT_NEAR(tinted.textures[0].pixels[0], linearToSrgb(0.5f), 1e-6f);
  EXPECT_NEAR(tinted.textures[0].pixels[5], 1.0f, 1e-6f);

  const std::string external = "\"uri\":\"my%20texture.png\"";
  store("my texture.png", picture);
  EXPECT_EQ(read(file.glb(scene(primitive, "", rest(external, "}}}]")))).textures[0].pixels,
            mesh.textures[0].pixels);
  std::filesystem::remove(path("my texture.png"));
  expectError(ErrorCode::kIo, {"my%20texture.png", "missing"},
              [&] { read(file.glb(scene(primitive, "", rest(external, "}}}]")))); });
  expectError(ErrorCode::kFormat, {"TEXCOORD_0"}, [&] {
    read(file.glb(
        scene("\"attributes\":{\"POSITION\":0},\"material\":0", "", rest(embedded, "}}}]"))));
  });
  const auto read_picture = [&](const std::string& bytes) {
    GlbBuilder broken;
    broken.addFloats(kTriangle, 3);
    broken.addFloats({0, 0, 1, 0, 0, 1}, 2);
    broken.addView(bytes);
    read(broken.glb(
        scene(primitive, "", rest("\"mimeType\":\"image/png\",\"bufferView\":2", "}}}]"))));
  };
  expectError(ErrorCode::kFormat, {"image 0"}, [&] { read_picture(picture.substr(0, 40)); });
  // Behind the header, a text that would be 1.9 GB long.
  const std::string text("\x71\0\0\0tEXt", 8);
  expectError(ErrorCode::kFormat, {"image 0", "1895825408 bytes"},
              [&] { read_picture(picture.substr(0, 33) + text + picture.substr(33)); });
}

TEST_F(MeshFile, ChoosesTheUvSetAndTransformsIt) {
  GlbBuilder file;
  file.addFloats(kTriangle, 3);
  file.addFloats({0, 0, 1, 0, 0, 1}, 2);
  file.add<uint16_t>({0, 0, 65535, 0, 0, 65535}, "VEC2", 5123, 2, ",\"normalized\":true");
  file.addView(png());
  const TriMesh mesh = read(file.glb(scene(
      "\"attributes\":{\"POSITION\":0,\"TEXCOORD_1\":2},\"material\":0", "",
      "\"images\":[{\"mimeType\":\"image/png\",\"bufferView\":3}],\"textures\":[{\"source\":0}],"
      "\"materials\":[{\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":0,\"texCoord\":1,"
      "\"extensions\":{\"KHR_texture_transform\":{\"offset\":[0.5,0.25],\"scale\":[2,3],"
      "\"rotation\":1.5707963267948966}}}}}]")));
  // A quarter turn counter-clockwise as seen on the picture, whose v axis points down, takes (1, 0)
  // up to (0, −1) and (0, 1) to (1, 0).
  const std::vector<float> expected = {0.5f, 0.75f, 0.5f, 2.75f, 3.5f, 0.75f};
  for (size_t i = 0; i < expected.size(); ++i) {
    EXPECT_NEAR(mesh.corner_uvs[i], expected[i], 1e-6f) << i;
  }
}

TEST_F(MeshFile, JoinsPrimitivesWithDifferentAttributes) {
  GlbBuilder file;
  file.addFloats(kTriangle, 3);
  file.addFloats({1, 0, 0, 1, 0, 0, 1, 0, 0}, 3);
  file.addFloats({0, 1, 0, 0, 1, 0, 0, 1, 0}, 3);
  const TriMesh mesh = read(
      file.glb("\"scenes\":[{\"nodes\":[0,1]}],\"nodes\":[{\"mesh\":0},{\"mesh\":0}],\"meshes\":[{"
               "\"primitives\":[{\"attributes\":{\"POSITION\":0,\"NORMAL\":1}},"
               "{\"attributes\":{\"POSITION\":0,\"COLOR_0\":2}}]}]"));
  validate(mesh);
  EXPECT_EQ(mesh.triangleCount(), 4u);
  EXPECT_EQ(mesh.vertexCount(), 12u);
  EXPECT_EQ(mesh.triangle_materials, (std::vector<uint32_t>{0, 1, 0, 1}));
  EXPECT_EQ(mesh.corner_normals[0], 1.0f);
  // Without normals of its own: that of the face, glTF's +z, here −y.
  EXPECT_EQ(mesh.corner_normals[9 + 1], -1.0f);
  EXPECT_EQ(mesh.corner_colours[0], 1.0f);
  EXPECT_EQ(mesh.corner_colours[12], 0.0f);
}

TEST_F(MeshFile, LeavesOutPartsWithoutElements) {
  GlbBuilder file;
  const int positions = file.addFloats(kTriangle, 3);
  const int no_positions = file.addFloats({}, 3);
  const int no_colours = file.addFloats({}, 4);
  const int no_indices = file.addIndices({});
  file.addIndices({0, 1, 2});
  const auto part = [](int position, const std::string& more = "") {
    return "{\"attributes\":{\"POSITION\":" + std::to_string(position) + more + "}";
  };
  const auto parts = [](const std::string& list) {
    return "\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],\"meshes\":[{\"primitives\":[" +
           list + "]}]";
  };
  const std::string whole = part(positions) + ",\"indices\":4}";
  const std::string colours =
      ",\"NORMAL\":" + std::to_string(no_positions) + ",\"COLOR_0\":" + std::to_string(no_colours);
  const std::string without_vertices = part(no_positions, colours) + "}";
  const std::string without_indices =
      part(positions) + ",\"indices\":" + std::to_string(no_indices) + "}";
  const TriMesh expected = read(file.glb(parts(whole)));
  for (const int mode : {4, 5, 6}) {
    const std::string as = ",\"mode\":" + std::to_string(mode) + "}";
    std::string empty = without_vertices;
    empty.replace(empty.size() - 1, 1, as);
    std::string unused = without_indices;
    unused.replace(unused.size() - 1, 1, as);
    const TriMesh mesh = read(file.glb(parts(empty + "," + whole + "," + unused)));
    validate(mesh);
    EXPECT_EQ(mesh.positions, expected.positions) << mode;
    EXPECT_EQ(mesh.triangles, expected.triangles) << mode;
    EXPECT_EQ(mesh.materials.size(), expected.materials.size()) << mode;
    EXPECT_TRUE(mesh.corner_normals.empty()) << mode;
    EXPECT_TRUE(mesh.corner_colours.empty()) << mode;
  }
  expectError(ErrorCode::kFormat, {"a.glb", "no triangles"},
              [&] { read(file.glb(parts(without_vertices + "," + without_indices))); });
  expectError(ErrorCode::kFormat, {"primitive 0", "vertex 0 of 0"},
              [&] { read(file.glb(parts(part(no_positions) + ",\"indices\":4}"))); });
}

TEST_F(MeshFile, SaysWhatIsWrong) {
  GlbBuilder file;
  file.addFloats(kTriangle, 3);
  file.addIndices({0, 1, 3});
  file.addFloats({0, 0, 0, std::nanf(""), 0, 0, 0, 1, 0}, 3);
  file.addAccessor(
      "\"bufferView\":0,\"componentType\":5126,\"count\":1000000000000,"
      "\"type\":\"VEC3\"");
  file.addAccessor("\"componentType\":5126,\"count\":1000000000000,\"type\":\"VEC3\"");
  const auto refuse = [&](const std::string& rest, std::initializer_list<const char*> texts) {
    expectError(ErrorCode::kFormat, texts, [&] { read(file.glb(rest)); });
  };
  refuse(scene("\"attributes\":{\"POSITION\":0},\"indices\":1"), {"vertex 3 of 3"});
  refuse(scene("\"attributes\":{\"POSITION\":2}"), {"POSITION", "vertex 1", "nan"});
  refuse(scene("\"attributes\":{\"POSITION\":3}"), {"1000000000000", "36 bytes"});
  refuse(scene("\"attributes\":{\"POSITION\":4}"), {"1 primitives of mesh 0", "would take"});
  refuse(scene("\"attributes\":{\"POSITION\":77}"), {"77"});
  refuse(scene("\"attributes\":{\"POSITION\":1}"), {"components; 3"});
  refuse(scene("\"attributes\":{\"POSITION\":0},\"material\":5"), {"material 5"});
  refuse(scene("\"attributes\":{\"POSITION\":0}", "\"scale\":[1e39,1,1]"), {"a.glb", "inf"});
  refuse("\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"children\":[0]}]", {"ancestor"});
  refuse("\"scenes\":[{\"nodes\":[4]}],\"nodes\":[{}]", {"node 4"});
  refuse("\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":4}]", {"mesh 4"});
  refuse("\"scenes\":[{\"nodes\":[]}]", {"no triangles"});
  expectError(ErrorCode::kUnsupported, {"KHR_draco_mesh_compression"}, [&] {
    read(file.glb(scene("\"attributes\":{\"POSITION\":0}", "",
                        "\"extensionsRequired\":[\"KHR_draco_mesh_compression\"]")));
  });
  expectError(ErrorCode::kFormat, {"a.glb"}, [&] { read(""); });
  expectError(ErrorCode::kFormat, {"a.glb"}, [&] { read("no mesh at all, but long enough"); });
  expectError(ErrorCode::kFormat, {"a.gltf"}, [&] { readMeshFile(store("a.gltf", "{")); });
  expectError(ErrorCode::kUnsupported, {"'.obj'"},
              [&] { readMeshFile(store("a.obj", "v 0 0 0")); });
  expectError(ErrorCode::kIo, {"No such file"}, [&] { readMeshFile(path("missing.glb")); });
  expectError(ErrorCode::kIo, {"folder"}, [&] { readMeshFile(folder_.string()); });
}

TEST_F(MeshFile, DoesNotWaitForPipesThatAFileNames) {
  ASSERT_EQ(::mkfifo(path("pipe").c_str(), 0600), 0);
  std::filesystem::create_directory(path("inner"));
  const auto text = [](const std::string& uri) {
    return "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":36,\"uri\":\"" + uri +
           "\"}]}";
  };
  expectError(ErrorCode::kFormat, {"a.gltf", "pipe", "not a regular file"},
              [&] { readMeshFile(store("a.gltf", text("pipe"))); });
  expectError(ErrorCode::kFormat, {"a.gltf", "inner", "it is a folder"},
              [&] { readMeshFile(store("a.gltf", text("inner"))); });
  expectError(ErrorCode::kIo, {"pipe.glb", "not a regular file"}, [&] {
    ASSERT_EQ(::mkfifo(path("pipe.glb").c_str(), 0600), 0);
    readMeshFile(path("pipe.glb"));
  });
}

TEST_F(MeshFile, SurvivesTruncationAndDamage) {
  GlbBuilder file;
  file.addFloats(kTriangle, 3);
  file.addIndices({0, 1, 2});
  file.addFloats({0, 0, 1, 0, 0, 1}, 2);
  file.addView(png());
  const std::string bytes = file.glb(scene(
      "\"attributes\":{\"POSITION\":0,\"TEXCOORD_0\":2},\"indices\":1,\"material\":0", "",
      "\"images\":[{\"mimeType\":\"image/png\",\"bufferView\":3}],\"textures\":[{\"source\":0}],"
      "\"materials\":[{\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":0}}}]"));
  validate(read(bytes));
  for (size_t length = 0; length < bytes.size(); length += 3) {
    try {
      read(bytes.substr(0, length));
      ADD_FAILURE() << length << " of " << bytes.size() << " bytes are accepted";
    } catch (const Error&) {
    }
  }
  std::mt19937 random(3);
  for (int trial = 0; trial < 2000; ++trial) {
    std::string damaged = bytes;
    damaged[random() % damaged.size()] = static_cast<char>(random());
    try {
      validate(read(damaged));
    } catch (const Error&) {
    }
  }
}

}  // namespace
}  // namespace stipple
