#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "base/error.h"
#include "glb_builder.h"
#include "io/mesh_file.h"
#include "io/mesh_writer.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

class GltfReshape : public ScratchFolder {
 protected:
  std::string refusal(const TriMesh& mesh, const std::string& source, const std::string& out) {
    try {
      writeReshapedMesh(mesh, source, out);
    } catch (const Error& error) {
      code_ = error.code();
      return error.what();
    }
    return "";
  }
  ErrorCode code_ = ErrorCode::kInternal;
};

const std::vector<float> kCorners = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 2, 2, 2};

/// Four triangles of a tetrahedron in two primitives that share their vertices, one of which no
/// triangle uses, with normals and tangents.
GlbBuilder tetrahedron() {
  GlbBuilder file;
  file.addFloats(kCorners, 3);
  file.addFloats({1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, 0, 0, 1, 0}, 3);
  file.addFloats(std::vector<float>(20, 1.0f), 4);
  file.addIndices({0, 2, 1, 0, 1, 3});
  file.addIndices({0, 3, 2, 1, 2, 3});
  return file;
}

std::string meshes() {
  const std::string attributes =
      "\"attributes\":{\"POSITION\":0,\"NORMAL\":1,\"TANGENT\":2},\"indices\":";
  return "\"meshes\":[{\"name\":\"M\",\"primitives\":[{" + attributes + "3},{" + attributes +
         "4}]}]";
}

std::string scene(const std::string& node, const std::string& more = "") {
  return "\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[" + node + "]," + meshes() + more;
}

/// Everything elsewhere, and bent; seam by seam the same.
TriMesh bent(TriMesh mesh) {
  for (size_t v = 0; v < mesh.vertexCount(); ++v) {
    float* p = &mesh.positions[v * 3];
    p[0] += 0.25f * std::sin(p[2]);
    p[1] -= 3;
    p[2] *= 1.5f;
  }
  // All normals along one direction of no axis.
  for (size_t i = 0; i < mesh.corner_normals.size(); ++i) {
    const float kDirection[3] = {2.0f / 3, -1.0f / 3, 2.0f / 3};
    mesh.corner_normals[i] = kDirection[i % 3];
  }
  return mesh;
}

TEST_F(GltfReshape, BringsTheShapeBackThroughNodesThatTurnScaleAndMirror) {
  // A parent that turns by 90 degrees and a child that is scaled, mirrored and moved.
  const std::string source =
      store("a.glb",
            tetrahedron().glb(scene("{\"children\":[1],\"rotation\":[0.70710678,0,0,0.70710678]},"
                                    "{\"mesh\":0,\"scale\":[-2,1,0.5],\"translation\":[5,0,1]}")));
  const TriMesh given = readMeshFile(source);
  ASSERT_EQ(given.vertexCount(), 10u);
  const TriMesh wanted = bent(given);
  writeReshapedMesh(wanted, source, path("b.glb"));
  const TriMesh seen = readMeshFile(path("b.glb"));
  EXPECT_EQ(seen.triangles, given.triangles);
  ASSERT_EQ(seen.vertexCount(), given.vertexCount());
  for (size_t i = 0; i < wanted.positions.size(); ++i) {
    // Vertex 4, at (2, 2, 2) in the file, is in no triangle and goes with the first use of it.
    EXPECT_NEAR(seen.positions[i], wanted.positions[i], 2e-6) << i;  // floats of about 5
  }
  ASSERT_EQ(seen.corner_normals.size(), wanted.corner_normals.size());
  for (size_t i = 0; i < wanted.corner_normals.size(); ++i) {
    EXPECT_NEAR(seen.corner_normals[i], wanted.corner_normals[i], 1e-6) << i;
  }
}

TEST_F(GltfReshape, KeepsVerticesThatPrimitivesShareAndDropsTangents) {
  const std::string source = store("a.glb", tetrahedron().glb(scene("{\"mesh\":0}")));
  const TriMesh given = readMeshFile(source);
  writeReshapedMesh(bent(given), source, path("b.glb"));
  const std::string bytes = load(path("b.glb"));
  EXPECT_EQ(bytes.find("TANGENT"), std::string::npos);
  EXPECT_NE(bytes.find("\"name\":\"M\""), std::string::npos);
  // One accessor of positions and one of normals for both, after the five that were there.
  const auto uses = [&](const std::string& text) {
    size_t count = 0;
    for (size_t at = bytes.find(text); at != std::string::npos; at = bytes.find(text, at + 1)) {
      ++count;
    }
    return count;
  };
  EXPECT_EQ(uses("\"POSITION\":5"), 2u);
  EXPECT_EQ(uses("\"NORMAL\":6"), 2u);
}

TEST_F(GltfReshape, TakesFilesBesideAGltfIntoOne) {
  const GlbBuilder file = tetrahedron();
  std::filesystem::create_directory(path("in"));
  store("in/a.bin", file.data());
  store("in/picture.png", "\x89PNG not looked at, since no base color needs it");
  const std::string source =
      store("in/a.gltf", file.json(scene("{\"mesh\":0}",
                                         ",\"images\":[{\"uri\":\"picture.png\",\"name\":\"P\"}],"
                                         "\"textures\":[{\"source\":0}]"),
                                   "a.bin"));
  const TriMesh given = readMeshFile(source);
  writeReshapedMesh(bent(given), source, path("b.glb"));
  std::filesystem::remove_all(path("in"));
  const TriMesh seen = readMeshFile(path("b.glb"));
  EXPECT_EQ(seen.triangles, given.triangles);
  const std::string bytes = load(path("b.glb"));
  EXPECT_NE(bytes.find("PNG not looked at, since no base color needs it"), std::string::npos);
  EXPECT_NE(bytes.find("\"mimeType\":\"image/png\""), std::string::npos);
  EXPECT_EQ(bytes.find("\"uri\""), std::string::npos);
}

TEST_F(GltfReshape, RefusesWhatItCannotKeep) {
  const std::string source = store("a.glb", tetrahedron().glb(scene("{\"mesh\":0}")));
  TriMesh mesh = readMeshFile(source);
  EXPECT_NE(refusal(mesh, source, path("b.ply")).find("'.ply'; .glb is supported"),
            std::string::npos);
  const std::string twice =
      store("twice.glb", tetrahedron().glb("\"scene\":0,\"scenes\":[{\"nodes\":[0,1]}],\"nodes\":["
                                           "{\"mesh\":0},{\"mesh\":0}]," +
                                           meshes()));
  EXPECT_NE(refusal(readMeshFile(twice), twice, path("b.glb")).find("shows mesh 0 several times"),
            std::string::npos);
  EXPECT_EQ(code_, ErrorCode::kUnsupported);
  const std::string flat =
      store("flat.glb", tetrahedron().glb(scene("{\"mesh\":0,\"scale\":[1,0,1]}")));
  EXPECT_NE(refusal(readMeshFile(flat), flat, path("b.glb")).find("is scaled to zero"),
            std::string::npos);
  mesh.positions.insert(mesh.positions.end(), {0, 0, 0});
  EXPECT_NE(refusal(mesh, source, path("b.glb"))
                .find("has 10 vertices and 4 triangles; the mesh with the new shape has 11 and 4"),
            std::string::npos);
  EXPECT_EQ(code_, ErrorCode::kInvalidArgument);
  EXPECT_NE(refusal(mesh, path("nothing.glb"), path("b.glb")), "");
  EXPECT_EQ(fileCount(), 3u);  // nothing is left of what failed
}

}  // namespace
}  // namespace stipple
