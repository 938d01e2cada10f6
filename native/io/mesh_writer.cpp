// Based on: Greg Turk, The PLY Polygon File Format.
#include "io/mesh_writer.h"

#include <cstring>
#include <vector>

#include "base/error.h"
#include "io/bytes/input_file.h"
#include "io/bytes/output_file.h"
#include "io/media_library.h"

namespace stipple {

namespace {

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

void writeGlb(const TriMesh& mesh, const std::string& path) {
  const StippleMediaMesh given = {mesh.vertexCount(), mesh.triangleCount(), mesh.positions.data(),
                                  mesh.triangles.data()};
  const StippleMediaTable& media = mediaTable();
  writeByLibrary(path, [&](const char* temporary) {
    callMedia([&](StippleMediaStatus* status) { media.mesh_write(temporary, &given, status); });
  });
}

}  // namespace

void writeMeshFile(const TriMesh& mesh, const std::string& path) {
  validate(mesh);
  const std::string extension = lowerExtension(path);
  if (extension == ".ply") {
    writePly(mesh, path);
  } else if (extension == ".glb") {
    writeGlb(mesh, path);
  } else {
    fail(ErrorCode::kUnsupported, path + " cannot be written as a mesh: its extension is '" +
                                      extension + "'; .ply and .glb are supported");
  }
}

void writeReshapedMesh(const TriMesh& mesh, const std::string& source, const std::string& path) {
  validate(mesh);
  if (lowerExtension(path) != ".glb") {
    fail(ErrorCode::kUnsupported, path + " cannot be written with all that " + source +
                                      " holds: its extension is '" + lowerExtension(path) +
                                      "'; .glb is supported");
  }
  const StippleMediaShape shape = {
      mesh.vertexCount(), mesh.triangleCount(), mesh.positions.data(),
      mesh.corner_normals.empty() ? nullptr : mesh.corner_normals.data()};
  const StippleMediaTable& media = mediaTable();
  writeByLibrary(path, [&](const char* temporary) {
    callMedia([&](StippleMediaStatus* status) {
      media.mesh_reshape(source.c_str(), temporary, &shape, status);
    });
  });
}

}  // namespace stipple
