#pragma once

#include <cstdint>
#include <fstream>
#include <string>
#include <vector>

#include "data/meshes/tri_mesh.h"
#include "io/media/media_status.h"
#include "io/media_table.h"

namespace stipple::media {

// The entries of the table. Nothing is thrown across it: each runs its work in `guard`.
extern "C" {
void stipple_media_image_read(const char* path, StippleMediaImage* image,
                              const StippleMediaSink* sink, StippleMediaStatus* status);
void stipple_media_image_header(const char* path, StippleMediaImage* image,
                                StippleMediaStatus* status);
void stipple_media_png_write(const char* path, const StippleMediaImage* image,
                             const uint8_t* pixels, StippleMediaStatus* status);
void stipple_media_exr_write(const char* path, const StippleMediaImage* image, const float* pixels,
                             StippleMediaStatus* status);
void stipple_media_exr_channels_read(const char* path, uint64_t limit_bytes,
                                     const StippleMediaSink* sink, StippleMediaStatus* status);
void stipple_media_mesh_read(const char* path, const StippleMediaSink* sink,
                             StippleMediaStatus* status);
void stipple_media_mesh_write(const char* path, const StippleMediaMesh* mesh,
                              StippleMediaStatus* status);
void stipple_media_mesh_reshape(const char* source, const char* path,
                                const StippleMediaShape* shape, StippleMediaStatus* status);
void stipple_media_volume_write(const char* path, const StippleMediaVolume* volume,
                                StippleMediaStatus* status);
void stipple_media_volume_read(const char* path, double* voxel_size, double* origin,
                               const StippleMediaSink* sink, StippleMediaStatus* status);
void stipple_media_volume_surface(const StippleMediaVolume* volume, double threshold,
                                  double adaptivity, const StippleMediaSink* sink,
                                  StippleMediaStatus* status);
void stipple_media_gltf_splats_read(const char* path, const StippleMediaSink* sink,
                                    StippleMediaStatus* status);
}

/// Ends a file that was written by a library or for it. Errors: kIo where not all of it is there.
void finishFile(std::ofstream& file, const char* path);

/// A picture as it is in its file or in memory.
struct DecodedImage {
  StippleMediaImage info{};
  std::vector<float> pixels;
};
/// What images are counted together where their pixels are compared with kImageAllowance.
struct ImagesSoFar {
  uint64_t pixel_bytes = 0;    ///< of those before this one
  uint64_t encoded_bytes = 0;  ///< of all files
};
/// In: name, what messages call it.
DecodedImage decodeImageBytes(const std::vector<unsigned char>& bytes, const std::string& name,
                              const ImagesSoFar& others);

/// The triangles of a glTF or GLB file.
TriMesh readGltf(const std::string& path);

}  // namespace stipple::media
