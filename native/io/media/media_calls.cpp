#include "io/media/media_calls.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <exception>
#include <new>
#include <system_error>

#include "base/error.h"

namespace stipple::media {

void report(StippleMediaStatus* status, int code, const std::string& message) {
  status->code = code;
  // One sentence: libraries separate their messages by line ends.
  std::string line = message;
  while (!line.empty() && (line.back() == '\n' || line.back() == ' ')) line.pop_back();
  std::replace(line.begin(), line.end(), '\n', ' ');
  const size_t length = std::min(line.size(), sizeof(status->message) - 1);
  std::memcpy(status->message, line.data(), length);
  status->message[length] = '\0';
}

void reportCurrentException(const char* path, StippleMediaStatus* status) {
  try {
    throw;
  } catch (const Error& error) {
    report(status, static_cast<int>(error.code()), error.what());
  } catch (const std::bad_alloc&) {
    report(status, static_cast<int>(ErrorCode::kOutOfMemory),
           std::string(path) + ": there is not enough memory");
  } catch (const std::exception& error) {
    report(status, static_cast<int>(ErrorCode::kFormat), std::string(path) + ": " + error.what());
  } catch (...) {
    report(status, static_cast<int>(ErrorCode::kInternal),
           std::string(path) + ": a library failed without a reason");
  }
}

void finishFile(std::ofstream& file, const char* path) {
  if (file) errno = 0;
  file.close();
  if (file) return;
  // A failure further up may have been followed by calls that reset the reason.
  const std::string reason = errno != 0 ? std::generic_category().message(errno)
                                        : std::string("the system took only a part of it");
  fail(ErrorCode::kIo, std::string(path) + " cannot be written: " + reason);
}

void* allocate(const StippleMediaSink& sink, uint32_t array, size_t bytes) {
  void* target = sink.allocate(sink.user, array, bytes);
  if (target == nullptr && bytes > 0) throw std::bad_alloc();
  return target;
}

void giveBytes(const StippleMediaSink& sink, uint32_t array, const void* data, size_t bytes) {
  void* target = allocate(sink, array, bytes);
  if (bytes > 0) std::memcpy(target, data, bytes);
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
  static const StippleMediaTable kTable = {
      kMediaTableVersion,         stipple_media_image_read,
      stipple_media_image_header, stipple_media_png_write,
      stipple_media_exr_write,    stipple_media_exr_channels_read,
      stipple_media_mesh_read,    stipple_media_mesh_write,
      stipple_media_mesh_reshape, stipple_media_volume_write,
      stipple_media_volume_read,  stipple_media_volume_surface,
      stipple_media_gzip_unpack,  stipple_media_gzip_pack,
      stipple_media_zstd_unpack,  stipple_media_zstd_pack,
      stipple_media_webp_size,    stipple_media_webp_decode,
      stipple_media_webp_encode,  stipple_media_zip_inflate,
      stipple_media_zip_checksum, stipple_media_gltf_splats_read};
  return version == kMediaTableVersion ? &kTable : nullptr;
}

}  // namespace stipple::media
