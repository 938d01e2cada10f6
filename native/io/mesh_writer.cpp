// Based on: Greg Turk, The PLY Polygon File Format; The Khronos Group, glTF 2.0 Specification,
// sections 3 and 4 (GLB).
#include "io/mesh_writer.h"

#include <algorithm>
#include <cstring>
#include <nlohmann/json.hpp>
#include <vector>

#include "base/error.h"
#include "io/bytes/input_file.h"
#include "io/bytes/little_endian.h"
#include "io/bytes/output_file.h"

namespace stipple {

namespace {

using Json = nlohmann::ordered_json;

constexpr int kFloat = 5126;
constexpr int kUnsignedInt = 5125;
constexpr int kArrayBuffer = 34962;
constexpr int kElementArrayBuffer = 34963;
constexpr size_t kTriangleBytes = 13;  // of a PLY face: its length, three indices

void writePly(const TriMesh& mesh, const std::string& path) {
  const std::string head =
      "ply\nformat binary_little_endian 1.0\ncomment Written by Stipple\nelement vertex " +
      std::to_string(mesh.vertexCount()) +
      "\nproperty float x\nproperty float y\nproperty float z\nelement face " +
      std::to_string(mesh.triangleCount()) +
      "\nproperty list uchar uint vertex_indices\nend_header\n";
  std::vector<unsigned char> bytes(mesh.triangleCount() * kTriangleBytes);
  for (size_t t = 0; t < mesh.triangleCount(); ++t) {
    unsigned char* face = &bytes[t * kTriangleBytes];
    face[0] = 3;
    std::memcpy(face + 1, &mesh.triangles[t * 3], 12);
  }
  OutputFile file(path);
  file.write(head.data(), head.size());
  file.write(mesh.positions.data(), mesh.positions.size() * sizeof(float));
  file.write(bytes.data(), bytes.size());
  file.commit();
}

void putNumber(std::string& bytes, uint64_t value) {
  for (unsigned b = 0; b < 4; ++b) bytes.push_back(static_cast<char>(value >> (8 * b)));
}

void writeGlb(const TriMesh& mesh, const std::string& path) {
  std::vector<float> positions(mesh.positions.size());
  float low[3] = {0, 0, 0}, high[3] = {0, 0, 0};
  for (size_t v = 0; v < mesh.vertexCount(); ++v) {
    const float* from = &mesh.positions[v * 3];
    const float turned[3] = {from[0], from[2], -from[1]};
    std::copy_n(turned, 3, &positions[v * 3]);
    for (size_t axis = 0; axis < 3; ++axis) {
      low[axis] = v == 0 ? turned[axis] : std::min(low[axis], turned[axis]);
      high[axis] = v == 0 ? turned[axis] : std::max(high[axis], turned[axis]);
    }
  }
  const uint64_t position_bytes = positions.size() * sizeof(float);
  const uint64_t index_bytes = mesh.triangles.size() * sizeof(uint32_t);
  Json root;
  root["asset"] = {{"version", "2.0"}, {"generator", "Stipple"}};
  root["scene"] = 0;
  root["scenes"] = Json::array({{{"nodes", {0}}}});
  root["nodes"] = Json::array({{{"mesh", 0}}});
  root["meshes"] = Json::array(
      {{{"primitives", Json::array({{{"attributes", {{"POSITION", 0}}}, {"indices", 1}}})}}});
  root["accessors"] = Json::array({{{"bufferView", 0},
                                    {"componentType", kFloat},
                                    {"count", mesh.vertexCount()},
                                    {"type", "VEC3"},
                                    {"min", {low[0], low[1], low[2]}},
                                    {"max", {high[0], high[1], high[2]}}},
                                   {{"bufferView", 1},
                                    {"componentType", kUnsignedInt},
                                    {"count", mesh.triangles.size()},
                                    {"type", "SCALAR"}}});
  root["bufferViews"] = Json::array(
      {{{"buffer", 0}, {"byteOffset", 0}, {"byteLength", position_bytes}, {"target", kArrayBuffer}},
       {{"buffer", 0},
        {"byteOffset", position_bytes},
        {"byteLength", index_bytes},
        {"target", kElementArrayBuffer}}});
  const uint64_t data_bytes = position_bytes + index_bytes;
  root["buffers"] = Json::array({{{"byteLength", data_bytes}}});
  std::string text = root.dump();
  while (text.size() % 4 != 0) text.push_back(' ');
  const uint64_t total = 12 + 8 + text.size() + 8 + data_bytes;
  if (total > UINT32_MAX) {
    fail(ErrorCode::kUnsupported, path + " would have " + std::to_string(total) +
                                      " bytes; a .glb holds less than 4 GiB, a .ply more");
  }
  std::string head = "glTF";
  putNumber(head, 2);
  putNumber(head, total);
  putNumber(head, text.size());
  head += "JSON" + text;
  putNumber(head, data_bytes);
  head += std::string("BIN\0", 4);
  OutputFile file(path);
  file.write(head.data(), head.size());
  file.write(positions.data(), position_bytes);
  file.write(mesh.triangles.data(), index_bytes);
  file.commit();
}

}  // namespace

void writeMeshFile(const TriMesh& mesh, const std::string& path) {
  validate(mesh);
  const std::string ending = lowerEnding(path);
  if (ending == ".ply") {
    writePly(mesh, path);
  } else if (ending == ".glb") {
    writeGlb(mesh, path);
  } else {
    fail(ErrorCode::kUnsupported, path + " cannot be written as a mesh: its ending is '" + ending +
                                      "'; .ply and .glb are supported");
  }
}

}  // namespace stipple
