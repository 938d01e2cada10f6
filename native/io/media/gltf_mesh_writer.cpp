// Based on: The Khronos 3D Formats Working Group, glTF 2.0 Specification, sections 3.7 (meshes) and
// 4 (GLB).
#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>

#include "base/error.h"
#include "io/media/gltf_model.h"
#include "io/media/media_calls.h"

namespace stipple::media {

namespace {

/// Room for what stands in front of the arrays: of one mesh about 700 bytes.
constexpr uint64_t kHeadBytes = 4096;

/// Z up becomes Y up. In: out [count,3]; lowest and highest of each axis.
void rotatePositions(const StippleMediaMesh& mesh, unsigned char* out, float (&low)[3],
                     float (&high)[3]) {
  for (uint64_t v = 0; v < mesh.vertex_count; ++v) {
    const float* from = mesh.positions + v * 3;
    const float rotated[3] = {from[0], from[2], -from[1]};
    std::memcpy(out + v * sizeof(rotated), rotated, sizeof(rotated));
    for (size_t axis = 0; axis < 3; ++axis) {
      low[axis] = v == 0 ? rotated[axis] : std::min(low[axis], rotated[axis]);
      high[axis] = v == 0 ? rotated[axis] : std::max(high[axis], rotated[axis]);
    }
  }
}

tinygltf::BufferView viewOf(uint64_t offset, uint64_t bytes, int target) {
  tinygltf::BufferView view;
  view.buffer = 0;
  view.byteOffset = static_cast<size_t>(offset);
  view.byteLength = static_cast<size_t>(bytes);
  view.target = target;
  return view;
}

tinygltf::Accessor accessorOf(int view, int component, int type, uint64_t count) {
  tinygltf::Accessor accessor;
  accessor.bufferView = view;
  accessor.componentType = component;
  accessor.type = type;
  accessor.count = static_cast<size_t>(count);
  return accessor;
}

tinygltf::Model modelOf(const StippleMediaMesh& mesh) {
  const uint64_t position_bytes = mesh.vertex_count * 3 * sizeof(float);
  const uint64_t index_bytes = mesh.triangle_count * 3 * sizeof(uint32_t);
  tinygltf::Model model;
  model.asset.version = "2.0";
  model.asset.generator = "Stipple";
  model.buffers.resize(1);
  std::vector<unsigned char>& data = model.buffers[0].data;
  data.resize(static_cast<size_t>(position_bytes + index_bytes));
  float low[3] = {}, high[3] = {};
  rotatePositions(mesh, data.data(), low, high);
  std::copy_n(reinterpret_cast<const unsigned char*>(mesh.triangles), index_bytes,
              data.begin() + static_cast<std::ptrdiff_t>(position_bytes));
  model.bufferViews = {viewOf(0, position_bytes, TINYGLTF_TARGET_ARRAY_BUFFER),
                       viewOf(position_bytes, index_bytes, TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER)};
  model.accessors = {
      accessorOf(0, TINYGLTF_COMPONENT_TYPE_FLOAT, TINYGLTF_TYPE_VEC3, mesh.vertex_count),
      accessorOf(1, TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT, TINYGLTF_TYPE_SCALAR,
                 mesh.triangle_count * 3)};
  model.accessors[0].minValues.assign(low, low + 3);
  model.accessors[0].maxValues.assign(high, high + 3);
  tinygltf::Primitive primitive;
  primitive.attributes["POSITION"] = 0;
  primitive.indices = 1;
  primitive.mode = TINYGLTF_MODE_TRIANGLES;
  model.meshes.resize(1);
  model.meshes[0].primitives = {primitive};
  model.nodes.resize(1);
  model.nodes[0].mesh = 0;
  model.scenes.resize(1);
  model.scenes[0].nodes = {0};
  model.defaultScene = 0;
  return model;
}

}  // namespace

void stipple_media_mesh_write(const char* path, const StippleMediaMesh* mesh,
                              StippleMediaStatus* status) {
  guard(path, status, [&] {
    const uint64_t bytes = kHeadBytes + 3 * (mesh->vertex_count * sizeof(float) +
                                             mesh->triangle_count * sizeof(uint32_t));
    if (bytes > UINT32_MAX) {
      fail(ErrorCode::kUnsupported, std::string(path) + " would have about " +
                                        std::to_string(bytes) +
                                        " bytes; a .glb holds less than 4 GiB, a .ply more");
    }
    const tinygltf::Model model = modelOf(*mesh);
    std::ofstream file(std::filesystem::path(path), std::ios::binary | std::ios::trunc);
    tinygltf::TinyGLTF writer;
    // What it returns says nothing of the disk: the stream does.
    writer.WriteGltfSceneToStream(&model, file, false, true);
    finishFile(file, path);
  });
}

}  // namespace stipple::media
