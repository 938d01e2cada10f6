#include "io/mesh_writer.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <string>

#include "io/mesh_file.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

class MeshWriter : public ScratchFolder {};

TriMesh tetrahedron() {
  TriMesh mesh;
  mesh.positions = {0, 0, 0, 1.1f, 0, -0.0f, 0, -2.5e-7f, 3, 1e6f, 1, 0.3333333f};
  mesh.triangles = {0, 1, 2, 0, 1, 3, 1, 2, 3, 2, 0, 3};
  return mesh;
}

uint32_t numberAt(const std::string& bytes, size_t at) {
  uint32_t value = 0;
  std::memcpy(&value, &bytes[at], 4);
  return value;
}

TEST_F(MeshWriter, GivesTheSameMeshBackFromAGlb) {
  const TriMesh mesh = tetrahedron();
  writeMeshFile(mesh, path("a.glb"));
  const TriMesh seen = readMeshFile(path("a.glb"));
  EXPECT_EQ(seen.positions, mesh.positions);
  EXPECT_EQ(seen.triangles, mesh.triangles);
  EXPECT_EQ(fileCount(), 1u);
}

TEST_F(MeshWriter, LaysAGlbOutAsItsSpecificationSays) {
  const TriMesh mesh = tetrahedron();
  writeMeshFile(mesh, path("a.glb"));
  const std::string bytes = load(path("a.glb"));
  EXPECT_EQ(bytes.substr(0, 4), "glTF");
  EXPECT_EQ(numberAt(bytes, 4), 2u);
  EXPECT_EQ(numberAt(bytes, 8), bytes.size());
  const uint32_t json = numberAt(bytes, 12);
  EXPECT_EQ(json % 4, 0u);
  EXPECT_EQ(bytes.substr(16, 4), "JSON");
  const size_t data = 20 + json + 8;
  EXPECT_EQ(bytes.substr(20 + json + 4, 4), std::string("BIN\0", 4));
  // Y up: (x, y, z) is stored as (x, z, -y). Then the triangles as they are.
  for (size_t v = 0; v < mesh.vertexCount(); ++v) {
    const float* from = &mesh.positions[v * 3];
    const float expected[3] = {from[0], from[2], -from[1]};
    EXPECT_EQ(std::memcmp(&bytes[data + v * 12], expected, 12), 0) << v;
  }
  EXPECT_EQ(bytes.size() - data, 4u * 12 + 12 * 4);
  EXPECT_EQ(std::memcmp(&bytes[data + 48], mesh.triangles.data(), 48), 0);
}

TEST_F(MeshWriter, RefusesWhatItCannotWrite) {
  expectError(ErrorCode::kUnsupported, {"a.obj", ".ply and .glb"},
              [&] { writeMeshFile(tetrahedron(), path("a.obj")); });
  expectError(ErrorCode::kIo, {"none/a.glb"},
              [&] { writeMeshFile(tetrahedron(), path("none/a.glb")); });
  EXPECT_EQ(fileCount(), 0u);
}

}  // namespace
}  // namespace stipple
