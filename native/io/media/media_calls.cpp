#include "io/media/media_calls.h"

#include <cerrno>
#include <system_error>

#include "base/error.h"

namespace stipple::media {

void finishFile(std::ofstream& file, const char* path) {
  if (file) errno = 0;
  file.close();
  if (file) return;
  // A failure further up may have been followed by calls that reset the reason.
  const std::string reason = errno != 0 ? std::generic_category().message(errno)
                                        : std::string("the system took only a part of it");
  fail(ErrorCode::kIo, std::string(path) + " cannot be written: " + reason);
}

void stipple_media_mesh_read(const char* path, const StippleMediaSink* sink,
                             StippleMediaStatus* status) {
  guard(path, status, [&] {
    const TriMesh mesh = readGltf(path);
    give(*sink, kMediaPositions, mesh.positions);
    give(*sink, kMediaTriangles, mesh.triangles);
    give(*sink, kMediaCornerNormals, mesh.corner_normals);
    give(*sink, kMediaCornerUvs, mesh.corner_uvs);
    give(*sink, kMediaCornerColours, mesh.corner_colours);
    give(*sink, kMediaTriangleMaterials, mesh.triangle_materials);
    std::vector<StippleMediaMaterial> materials;
    for (const Material& m : mesh.materials) {
      materials.push_back({static_cast<uint32_t>(m.colour),
                           {m.base_colour[0], m.base_colour[1], m.base_colour[2], m.base_colour[3]},
                           m.texture});
    }
    give(*sink, kMediaMaterials, materials);
    std::vector<StippleMediaTexture> textures;
    for (const Image& image : mesh.textures) {
      textures.push_back({image.width, image.height, image.channels});
    }
    give(*sink, kMediaTextures, textures);
    for (size_t i = 0; i < mesh.textures.size(); ++i) {
      give(*sink, kMediaTexturePixels + static_cast<uint32_t>(i), mesh.textures[i].pixels);
    }
  });
}

extern "C" const StippleMediaTable* stipple_media_table(uint32_t version) {
  static const StippleMediaTable kTable = {kMediaTableVersion,
                                           stipple_media_image_read,
                                           stipple_media_image_header,
                                           stipple_media_png_write,
                                           stipple_media_exr_write,
                                           stipple_media_exr_channels_read,
                                           stipple_media_mesh_read,
                                           stipple_media_mesh_write,
                                           stipple_media_mesh_reshape,
                                           stipple_media_volume_write,
                                           stipple_media_volume_read,
                                           stipple_media_volume_surface,
                                           stipple_media_gltf_splats_read};
  return version == kMediaTableVersion ? &kTable : nullptr;
}

}  // namespace stipple::media
