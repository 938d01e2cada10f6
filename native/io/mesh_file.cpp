#include "io/mesh_file.h"

#include <algorithm>
#include <string>
#include <vector>

#include "base/error.h"
#include "io/bytes/input_file.h"
#include "io/media_library.h"

namespace stipple {

namespace {

template <typename T>
void* resized(std::vector<T>& array, uint64_t bytes) {
  array.resize(static_cast<size_t>(bytes / sizeof(T)));
  return array.data();
}

/// What the media library delivers, before it is a TriMesh.
struct Delivery {
  TriMesh mesh;
  std::vector<StippleMediaMaterial> materials;
  std::vector<StippleMediaTexture> textures;
  std::vector<std::vector<float>> pixels;

  void* take(uint32_t array, uint64_t bytes) {
    switch (array) {
      case kMediaPositions:
        return resized(mesh.positions, bytes);
      case kMediaTriangles:
        return resized(mesh.triangles, bytes);
      case kMediaCornerNormals:
        return resized(mesh.corner_normals, bytes);
      case kMediaCornerUvs:
        return resized(mesh.corner_uvs, bytes);
      case kMediaCornerColours:
        return resized(mesh.corner_colours, bytes);
      case kMediaTriangleMaterials:
        return resized(mesh.triangle_materials, bytes);
      case kMediaMaterials:
        return resized(materials, bytes);
      case kMediaTextures:
        return resized(textures, bytes);
      default:
        pixels.resize(std::max<size_t>(pixels.size(), array - kMediaTexturePixels + 1));
        return resized(pixels[array - kMediaTexturePixels], bytes);
    }
  }

  void finish() {
    for (const StippleMediaMaterial& from : materials) {
      Material material;
      material.colour = static_cast<MaterialColour>(from.colour);
      std::copy_n(from.base_colour, 4, material.base_colour);
      material.texture = from.texture;
      mesh.materials.push_back(material);
    }
    pixels.resize(textures.size());
    for (size_t i = 0; i < textures.size(); ++i) {
      Image image;
      image.width = textures[i].width;
      image.height = textures[i].height;
      image.channels = textures[i].channels;
      image.pixels = std::move(pixels[i]);
      image.transfer = Transfer::kSrgb;
      mesh.textures.push_back(std::move(image));
    }
  }
};

}  // namespace

TriMesh readMeshFile(const std::string& path) {
  // Names a missing or unreadable file in the words of every reader.
  {
    const InputFile file(path);
    const std::string extension = lowerExtension(path);
    if (extension != ".gltf" && extension != ".glb") {
      fail(ErrorCode::kUnsupported, path + " cannot be read as a mesh: its extension is '" +
                                        extension + "'; .gltf and .glb are supported");
    }
    if (file.size() == 0) fail(ErrorCode::kFormat, path + " is empty");
  }
  Delivery delivery;
  const MediaSink sink(
      [&delivery](uint32_t array, uint64_t bytes) { return delivery.take(array, bytes); });
  const StippleMediaTable& media = mediaTable();
  callMedia([&](StippleMediaStatus* status) { media.mesh_read(path.c_str(), sink.get(), status); });
  delivery.finish();
  try {
    validateArrays(delivery.mesh);
  } catch (const Error& error) {
    fail(ErrorCode::kFormat, path + ": " + error.what());
  }
  return std::move(delivery.mesh);
}

}  // namespace stipple
