#include "data/meshes/tri_mesh.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "base/error.h"

namespace stipple {
namespace {

using ::testing::HasSubstr;

TriMesh triangle() {
  TriMesh mesh;
  mesh.positions = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  mesh.triangles = {0, 1, 2};
  mesh.materials.resize(1);
  return mesh;
}

std::string refusal(const TriMesh& mesh) {
  try {
    validate(mesh);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    return error.what();
  }
  return "accepted";
}

TEST(TriMesh, AcceptsATriangle) {
  EXPECT_EQ(refusal(triangle()), "accepted");
}

TEST(TriMesh, AcceptsZeroAreaFacesAmongGoodOnes) {
  TriMesh mesh = triangle();
  mesh.triangles.insert(mesh.triangles.end(), {1, 1, 2});
  EXPECT_EQ(refusal(mesh), "accepted");
}

TEST(TriMesh, RefusesAnEmptyMesh) {
  EXPECT_EQ(refusal(TriMesh{}), "mesh has 0 triangles; at least 1 is needed");
}

TEST(TriMesh, RefusesZeroTotalArea) {
  TriMesh mesh = triangle();
  mesh.positions = {0, 0, 0, 1, 0, 0, 2, 0, 0};
  EXPECT_THAT(refusal(mesh), HasSubstr("all faces have zero area (1 triangles)"));
}

TEST(TriMesh, NamesTheVertexThatIsNotThere) {
  TriMesh mesh = triangle();
  mesh.triangles[1] = 3;
  EXPECT_EQ(refusal(mesh), "mesh: triangle 0 uses vertex 3; the mesh has 3 vertices");
}

TEST(TriMesh, RefusesNonFiniteVertices) {
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    TriMesh mesh = triangle();
    mesh.positions[4] = bad;
    EXPECT_THAT(refusal(mesh), HasSubstr("position of vertex 1"));
  }
}

TEST(TriMesh, RefusesArraysOfTheWrongLength) {
  TriMesh mesh = triangle();
  mesh.corner_uvs.resize(5);
  EXPECT_EQ(refusal(mesh), "mesh: corner UVs holds 5 values; 6 are needed");
}

TEST(TriMesh, RefusesAMaterialThatIsNotThere) {
  TriMesh mesh = triangle();
  mesh.triangle_materials = {2};
  EXPECT_EQ(refusal(mesh), "mesh: triangle 0 uses material 2; the mesh has 1 materials");
  mesh.triangle_materials.clear();
  mesh.materials.clear();
  EXPECT_EQ(refusal(mesh), "mesh has 0 materials; at least 1 is needed");
}

TEST(TriMesh, RefusesWhatAMaterialNeedsAndTheMeshLacks) {
  TriMesh mesh = triangle();
  mesh.materials[0].colour = MaterialColour::kTexture;
  EXPECT_THAT(refusal(mesh), HasSubstr("no UV coordinates"));
  mesh.corner_uvs.resize(6);
  EXPECT_THAT(refusal(mesh), HasSubstr("a texture that is missing"));
  mesh.materials[0].texture = 1;
  EXPECT_THAT(refusal(mesh), HasSubstr("texture 1; the mesh has 0 textures"));
  mesh.materials[0].colour = MaterialColour::kCorner;
  EXPECT_THAT(refusal(mesh), HasSubstr("colour attribute"));
}

TEST(TriMesh, RefusesTexturesThatDisagreeWithTheirSize) {
  TriMesh mesh = triangle();
  mesh.textures.push_back(Image{2, 2, 3, std::vector<float>(11), Transfer::kSrgb});
  EXPECT_EQ(refusal(mesh), "mesh: texture 0 holds 11 values; 12 are needed");
  mesh.textures[0] = Image{0, 2, 3, {}, Transfer::kSrgb};
  EXPECT_THAT(refusal(mesh), HasSubstr("0 x 2 pixels"));
}

}  // namespace
}  // namespace stipple
