#pragma once

#include <cstddef>
#include <cstdint>

/// The private tables of calls from libstipple to libstipple_media and libstipple_packing: plain C
/// data only, so that neither side sees an exception or a type of the other's libraries. All are
/// built together; the versions guard against a file left over from another build.

namespace stipple {

constexpr uint32_t kMediaTableVersion = 8;
constexpr uint32_t kPackingTableVersion = 1;

extern "C" {

/// What went wrong: code is an ErrorCode, 0 for success.
struct StippleMediaStatus {
  int32_t code;
  char message[2000];
};

/// Takes arrays whose size only the reader knows. `allocate` returns room for `bytes` bytes of the
/// array `array` (an enumerator of the reader), or null where there is no memory.
struct StippleMediaSink {
  void* user;
  void* (*allocate)(void* user, uint32_t array, uint64_t bytes);
};

/// A picture as it is in its file.
struct StippleMediaImage {
  uint32_t width;
  uint32_t height;
  uint32_t channels;             ///< 1, 3 or 4
  uint32_t is_display;           ///< 1: 8- or 16-bit display sRGB; 0: float, scene linear
  uint32_t alpha_is_associated;  ///< 1: colours are multiplied by alpha
  uint32_t bits;                 ///< of a value in the file: 8, 16, 32...
};

enum StippleMediaImageArray : uint32_t {
  kMediaPixels = 0,  ///< float [height, width, channels]
};

/// One channel of an EXR file; its values are the array kMediaChannelPlanes + index.
struct StippleMediaChannel {
  uint32_t width;
  uint32_t height;
  uint32_t name_bytes;  ///< in kMediaChannelNames, one name after the other
};

enum StippleMediaChannelArray : uint32_t {
  kMediaChannels = 0,       ///< StippleMediaChannel
  kMediaChannelNames = 1,   ///< UTF-8
  kMediaChannelPlanes = 2,  ///< + index: float [height, width]
};

/// The triangles of a mesh to write. The arrays are the caller's.
struct StippleMediaMesh {
  uint64_t vertex_count;
  uint64_t triangle_count;
  const float* positions;     ///< [V,3] metres, Z up
  const uint32_t* triangles;  ///< [T,3]
};

/// The shape of a mesh that was read from a file. The arrays are the caller's.
struct StippleMediaShape {
  uint64_t vertex_count;
  uint64_t triangle_count;
  const float* positions;       ///< [V,3] metres, Z up
  const float* corner_normals;  ///< [T,3,3] or null
};

/// One texture of a mesh; its pixels are the array kMediaTexturePixels + index.
struct StippleMediaTexture {
  uint32_t width;
  uint32_t height;
  uint32_t channels;
};

struct StippleMediaMaterial {
  uint32_t colour;  ///< MaterialColour
  float base_colour[4];
  uint32_t texture;
};

enum StippleMediaMeshArray : uint32_t {
  kMediaPositions = 0,          ///< float [V,3]
  kMediaTriangles = 1,          ///< uint32 [T,3]
  kMediaCornerNormals = 2,      ///< float [T,3,3] or empty
  kMediaCornerUvs = 3,          ///< float [T,3,2] or empty
  kMediaCornerColours = 4,      ///< float [T,3,4] or empty
  kMediaTriangleMaterials = 5,  ///< uint32 [T]
  kMediaMaterials = 6,          ///< StippleMediaMaterial
  kMediaTextures = 7,           ///< StippleMediaTexture
  kMediaTexturePixels = 8,      ///< + index: float, display sRGB, straight alpha
};

/// A volume to write. The arrays are the caller's.
struct StippleMediaVolume {
  double voxel_size;
  double origin[3];
  uint64_t brick_count;
  const int32_t* bricks;  ///< [B,3]
  const float* density;   ///< [B,512]
  const float* colour;    ///< [B,512,3]
};

/// Of a volume that is read; the grid's frame goes to the last argument of volume_read.
enum StippleMediaVolumeArray : uint32_t {
  kMediaBricks = 0,
  kMediaDensity = 1,
  kMediaColour = 2,
};

/// Of the surface of a volume: faces of four corners, or of three, whose last is kMediaNoCorner.
enum StippleMediaSurfaceArray : uint32_t {
  kMediaSurfacePoints = 0,  ///< float [V,3] metres
  kMediaSurfaceFaces = 1,   ///< uint32 [F,4], all the same way round
};
constexpr uint32_t kMediaNoCorner = UINT32_MAX;

/// How the splats of a glTF primitive are stored.
enum StippleMediaSplatPacking : uint32_t {
  kMediaSplatsInArrays = 0,
  kMediaSplatsInSpz = 1,  ///< an SPZ file; its bytes take the place of the positions
};

/// The splats of one use of a glTF primitive.
struct StippleMediaSplatPart {
  uint64_t count;    ///< packed: what the accessors say, or UINT64_MAX
  uint32_t packing;  ///< StippleMediaSplatPacking
  uint32_t sh_degree;
  uint32_t colour_space;  ///< ColourSpace
  uint32_t antialias;     ///< Antialias
  uint32_t frame;         ///< Frame
  uint32_t mesh;          ///< which of the file's, for messages
  uint32_t primitive;
  double matrix[16];  ///< from the primitive to the scene, row by row
};

/// Of splats that are read: the parts first, then five arrays of each.
enum StippleMediaSplatArray : uint32_t {
  kMediaSplatParts = 0,      ///< StippleMediaSplatPart
  kMediaSplatPositions = 1,  ///< + 5 part: float [N,3]
  kMediaSplatRotations = 2,  ///< float [N,4] x, y, z, w
  kMediaSplatScales = 3,     ///< float [N,3]
  kMediaSplatOpacities = 4,  ///< float [N]
  kMediaSplatSh = 5,         ///< float [N,(degree+1)^2,3]
};

struct StippleMediaTable {
  uint32_t version;
  void (*image_read)(const char* path, StippleMediaImage* image, const StippleMediaSink* sink,
                     StippleMediaStatus* status);
  /// Only what the file's header says: no pixels are decoded.
  void (*image_header)(const char* path, StippleMediaImage* image, StippleMediaStatus* status);
  /// 8-bit PNG. In: pixels [height, width, channels] display sRGB 0..255, straight alpha.
  void (*png_write)(const char* path, const StippleMediaImage* image, const uint8_t* pixels,
                    StippleMediaStatus* status);
  /// Float32 EXR. In: pixels [height, width, channels] scene linear, premultiplied.
  void (*exr_write)(const char* path, const StippleMediaImage* image, const float* pixels,
                    StippleMediaStatus* status);
  /// All channels of all parts of an EXR file. The arrays of planes come after the two others, in
  /// order. In: limit_bytes, what the planes may take together.
  void (*exr_channels_read)(const char* path, uint64_t limit_bytes, const StippleMediaSink* sink,
                            StippleMediaStatus* status);
  void (*mesh_read)(const char* path, const StippleMediaSink* sink, StippleMediaStatus* status);
  /// GLB, Y up.
  void (*mesh_write)(const char* path, const StippleMediaMesh* mesh, StippleMediaStatus* status);
  /// The file `source`, whose meshes have another shape, as a GLB: everything else in it stays.
  void (*mesh_reshape)(const char* source, const char* path, const StippleMediaShape* shape,
                       StippleMediaStatus* status);
  void (*volume_write)(const char* path, const StippleMediaVolume* volume,
                       StippleMediaStatus* status);
  void (*volume_read)(const char* path, double* voxel_size, double* origin,
                      const StippleMediaSink* sink, StippleMediaStatus* status);
  /// The surface where the density of a volume (its colour is not read) passes `threshold`, per
  /// metre. In: adaptivity 0..1, larger faces where it is flat.
  void (*volume_surface)(const StippleMediaVolume* volume, double threshold, double adaptivity,
                         const StippleMediaSink* sink, StippleMediaStatus* status);
  /// The splats of a glTF or GLB file's scene (KHR_gaussian_splatting).
  void (*gltf_splats_read)(const char* path, const StippleMediaSink* sink,
                           StippleMediaStatus* status);
};

struct StipplePackingTable {
  uint32_t version;
  /// Compressed streams. In: what, which messages name; bytes [count]. Unpacking writes at most
  /// `capacity` bytes to `out` and says how many; packing hands one array to the sink.
  void (*gzip_unpack)(const char* what, const uint8_t* bytes, uint64_t count, uint8_t* out,
                      uint64_t capacity, uint64_t* produced, StippleMediaStatus* status);
  void (*gzip_pack)(const char* what, const uint8_t* bytes, uint64_t count, int32_t level,
                    const StippleMediaSink* sink, StippleMediaStatus* status);
  void (*zstd_unpack)(const char* what, const uint8_t* bytes, uint64_t count, uint8_t* out,
                      uint64_t capacity, uint64_t* produced, StippleMediaStatus* status);
  void (*zstd_pack)(const char* what, const uint8_t* bytes, uint64_t count, int32_t level,
                    const StippleMediaSink* sink, StippleMediaStatus* status);

  /// WebP, from and to memory; `name` is what messages call it. Every byte of every channel is
  /// kept, under an alpha of 0 too. In: rgba [height, width, 4].
  void (*webp_size)(const char* name, const uint8_t* bytes, uint64_t byte_count, uint32_t* width,
                    uint32_t* height, StippleMediaStatus* status);
  void (*webp_decode)(const char* name, const uint8_t* bytes, uint64_t byte_count, uint8_t* rgba,
                      uint64_t rgba_bytes, StippleMediaStatus* status);
  /// Lossless; the sink's one array is the encoded file.
  void (*webp_encode)(const char* name, const uint8_t* rgba, uint32_t width, uint32_t height,
                      const StippleMediaSink* sink, StippleMediaStatus* status);

  /// Raw deflate data of a zip entry, whose size the archive tells. Out: whole [whole_bytes].
  void (*zip_inflate)(const char* name, const uint8_t* bytes, uint64_t byte_count, uint8_t* whole,
                      uint64_t whole_bytes, StippleMediaStatus* status);
  /// CRC-32 of zip entries.
  uint32_t (*zip_checksum)(const uint8_t* bytes, uint64_t byte_count);
};

/// The one function that each of both libraries exports: null for another version.
typedef const StippleMediaTable* (*StippleMediaTableFunction)(uint32_t version);
typedef const StipplePackingTable* (*StipplePackingTableFunction)(uint32_t version);

}  // extern "C"

}  // namespace stipple
