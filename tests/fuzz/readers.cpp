#include "readers.h"

#include <cmath>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <memory>

#include "asset_readers.h"
#include "base/error.h"
#include "data/views/view_check.h"
#include "data/views/view_resample.h"
#include "io/bytes/npy_array.h"
#include "io/glb_builder.h"
#include "io/image_channels.h"
#include "io/image_file.h"
#include "io/ksplat_builder.h"
#include "io/mesh_file.h"
#include "io/npy_builder.h"
#include "io/random_cloud.h"
#include "io/sog_scene.h"
#include "io/splats/sog_levels.h"
#include "io/splats/splat_file.h"
#include "io/views/camera_file.h"
#include "io/views/colmap_points.h"
#include "io/views/ply_points.h"
#include "io/volume_file.h"
#include "io/webp_image.h"
#include "reader_tools.h"

namespace stipple::fuzz {

namespace {

namespace fs = std::filesystem;

// ---- Splats -------------------------------------------------------------------------------------

void readSplats(const fs::path& path) {
  const SplatCloud cloud = readSplatFile(path.string());
  keepsPromises([&] { validate(cloud, "cloud"); });
}

std::vector<std::string> splatSeeds(const SplatFormat& format, const fs::path& folder) {
  std::vector<std::string> made;
  const std::string extensions = format.extensions;
  const std::string extension = extensions.substr(0, extensions.find(' '));
  if (format.write == nullptr) {
    for (unsigned level = 0; level < 3; ++level) {
      RawKsplat raw;
      raw.level = level;
      raw.degree = level;
      made.push_back(raw.bytes());
    }
    return made;
  }
  for (const int degree : {0, 1, 3}) {
    SplatCloud cloud = randomCloud(5, degree, 1);
    const auto add = [&](const SplatWriteOptions& options) {
      writeSplatFile(cloud, (folder / ("seed" + extension)).string(), options);
      made.push_back(load(folder / ("seed" + extension)));
    };
    add({});
    cloud.antialias = Antialias::kMip;
    add({.ascii = extension == ".ply", .version = extension == ".spz" ? 3 : 0});
    add({.frame = Frame::kRFU});
  }
  if (extension == ".usda") {
    made.push_back(
        "#usda 1.0\n(\n  upAxis = \"Z\"\n  metersPerUnit = 0.5\n)\n"
        "class \"c\" { def ParticleField3DGaussianSplat \"s\" (customData = { string a = \"b\" }) "
        "{\n"
        "  point3h[] positionsh = [(1, 2, 3)]\n  quatf[] orientations = [(1, 0, 0, 0)]\n"
        "  float3[] scales.timeSamples = { 1: [(1, 2, 3)], 2: None }\n  rel r = </c> } }\n"
        "def Xform \"a\" (prepend inherits = </c>) {\n  double3 xformOp:translate = (1, 2, 3)\n"
        "  matrix4d xformOp:transform = ((1,0,0,0),(0,2,0,0),(0,0,1,0),(0,0,0,1))\n"
        "  token[] xformOpOrder = [\"xformOp:translate\", \"!invert!xformOp:transform\"]\n"
        "  variantSet \"v\" = { \"x\" { } } }\n"
        "def \"b\" (references = [</a/s>, </c/s>]) { quatd xformOp:orient = (1, 0, 1, 0) }\n");
  }
  if (extension == ".glb") {
    writeSplatFile(randomCloud(5, 1, 1), (folder / "seed.spz").string(), {.version = 3});
    GlbBuilder file;
    file.addView(load(folder / "seed.spz"));
    made.push_back(
        file.glb("\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],\"meshes\":[{"
                 "\"primitives\":[{\"mode\":0,"
                 "\"attributes\":{},\"extensions\":{\"KHR_gaussian_splatting\":{\"extensions\":"
                 "{\"KHR_gaussian_splatting_compression_spz_2\":{\"bufferView\":0}}}}}]}]"));
  }
  return made;
}

void addSplatReaders(std::vector<Reader>& all) {
  for (const SplatFormat& format : splatFormats()) {
    const std::string extensions = format.extensions;
    const std::string extension = extensions.substr(0, extensions.find(' '));
    // Streamed scenes are many files: below.
    if (extension[0] != '.') continue;
    all.push_back({format.name, nullptr,
                   [extension](const fs::path& folder, const std::string& bytes) {
                     storeFile(folder / ("input" + extension), bytes);
                   },
                   // By the format's own reader, whatever the first bytes say.
                   [extension, &format](const fs::path& folder) {
                     const SplatCloud cloud =
                         format.read((folder / ("input" + extension)).string(), nullptr);
                     keepsPromises([&] { validate(cloud, "cloud"); });
                   },
                   [&format](const fs::path& folder) { return splatSeeds(format, folder); },
                   extension == ".glb" ? JsonPlace::kGlbChunk : JsonPlace::kNowhere});
  }
}

void addSceneReaders(std::vector<Reader>& all) {
  all.push_back({"sog-meta", [](const fs::path& folder) { SogScene::second().store(folder); },
                 storeAs("meta.json"),
                 [](const fs::path& folder) { readSplats(folder / "meta.json"); },
                 [](const fs::path&) {
                   return std::vector<std::string>{SogScene::first().files["meta.json"],
                                                   SogScene::second().files["meta.json"]};
                 },
                 JsonPlace::kWholeFile});
  const auto writeLevels = [](const fs::path& folder) {
    const SplatCloud fine = randomCloud(40, 1, 1), coarse = randomCloud(9, 0, 2);
    writeSogLevels({&fine, &coarse}, &coarse, (folder / "lod-meta.json").string(),
                   {.chunk_splats = 20, .chunk_side = 1e9}, nullptr);
  };
  all.push_back({"sog-levels", writeLevels, storeAs("lod-meta.json"),
                 [](const fs::path& folder) { readSplats(folder / "lod-meta.json"); },
                 [writeLevels](const fs::path& folder) {
                   writeLevels(folder);
                   return std::vector<std::string>{load(folder / "lod-meta.json")};
                 },
                 JsonPlace::kWholeFile});
}

// ---- Meshes -------------------------------------------------------------------------------------

std::string png(const fs::path& folder) {
  Image image;
  image.width = image.height = 2;
  image.channels = 4;
  image.transfer = Transfer::kSrgb;
  image.pixels = {1, 0, 0, 1, 0, 1, 0, 1, 0, 0, 1, 1, 1, 1, 1, 1};
  writeImageFile(image, (folder / "texture.png").string());
  return load(folder / "texture.png");
}

/// Two triangles of four corners; without and with everything that a primitive can have.
std::vector<std::string> meshSeeds(const fs::path& folder) {
  GlbBuilder file;
  file.addFloats({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}, 3);
  file.addFloats({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, 3);
  file.addFloats({0, 0, 1, 0, 1, 1, 0, 1}, 2);
  file.addFloats({1, 0, 0, 1, 0, 1, 0, 1, 0, 0, 1, 1, 1, 1, 1, 1}, 4);
  file.addIndices({0, 1, 2, 0, 2, 3});
  const int indices = file.addView(std::string("\1\0", 2));
  const int values = file.addView(std::string(12, '\0'));
  file.addAccessor(
      "\"bufferView\":0,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\","
      "\"sparse\":{\"count\":1,\"indices\":{\"bufferView\":" +
      std::to_string(indices) +
      ",\"componentType\":5121},\"values\":{\"bufferView\":" + std::to_string(values) + "}}");
  const int picture = file.addView(png(folder));
  const auto scene = [picture](const std::string& primitive) {
    return "\"scenes\":[{\"nodes\":[0]}],\"scene\":0,\"nodes\":[{\"children\":[1],\"scale\":[2,1,1]"
           "},"
           "{\"mesh\":0,\"translation\":[0,0,1],\"rotation\":[0,0,1,0]}],"
           "\"meshes\":[{\"primitives\":[" +
           primitive +
           "]}],\"images\":[{\"mimeType\":\"image/png\",\"bufferView\":" + std::to_string(picture) +
           "}],\"textures\":[{\"source\":0}],"
           "\"materials\":[{\"alphaMode\":\"MASK\",\"alphaCutoff\":0.5,"
           "\"pbrMetallicRoughness\":{\"baseColorFactor\":[1,0.5,0,1]}},{\"alphaMode\":\"BLEND\","
           "\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":0,\"extensions\":"
           "{\"KHR_texture_transform\":{\"offset\":[0.5,0.25],\"scale\":[2,3],\"rotation\":1}}}}}]";
  };
  return {file.glb(scene("{\"attributes\":{\"POSITION\":0},\"mode\":5}")),
          file.glb(scene("{\"attributes\":{\"POSITION\":0,\"NORMAL\":1,\"TEXCOORD_0\":2,"
                         "\"COLOR_0\":3},\"indices\":4,\"material\":0}")),
          file.glb(scene("{\"attributes\":{\"POSITION\":0,\"TEXCOORD_0\":2},\"material\":1,"
                         "\"mode\":6}")),
          file.glb(scene("{\"attributes\":{\"POSITION\":5},\"indices\":4,\"mode\":6}"))};
}

// ---- Images and volumes -------------------------------------------------------------------------

/// Grey, RGB and RGBA, larger than one block of scan lines.
std::vector<std::string> exrSeeds(const fs::path& folder) {
  std::vector<std::string> made;
  for (const uint32_t channels : {1u, 3u, 4u}) {
    Image image;
    image.width = 5;
    image.height = 33;
    image.channels = channels;
    image.transfer = Transfer::kLinear;
    for (size_t i = 0; i < image.pixelCount() * channels; ++i) {
      image.pixels.push_back(0.01f * static_cast<float>(i % 97));
    }
    writeImageFile(image, (folder / "seed.exr").string());
    made.push_back(load(folder / "seed.exr"));
  }
  return made;
}

void readExr(const fs::path& path) {
  const std::vector<ImageChannel> channels = readImageChannels(path.string());
  keepsPromises([&] {
    for (const ImageChannel& channel : channels) {
      if (channel.values.size() != size_t{channel.width} * channel.height) {
        fail(ErrorCode::kInternal, "a channel has another size than it says");
      }
    }
  });
  readImageFile(path.string());
}

std::vector<std::string> webpSeeds(const fs::path&) {
  RgbaBytes image{7, 5, {}};
  for (size_t i = 0; i < image.pixelCount() * 4; ++i) {
    image.bytes.push_back(static_cast<uint8_t>(i * 37));
  }
  const std::vector<uint8_t> bytes = encodeWebp(image, "seed");
  const std::vector<uint8_t> blank =
      encodeWebp({64, 64, std::vector<uint8_t>(64 * 64 * 4, 255)}, "seed");
  return {{bytes.begin(), bytes.end()}, {blank.begin(), blank.end()}};
}

void readWebp(const fs::path& path) {
  const std::string bytes = load(path);
  constexpr uint64_t kMostPixels = 1 << 20;
  const RgbaBytes image = decodeWebp({bytes.begin(), bytes.end()}, kMostPixels, path.string());
  keepsPromises([&] {
    if (image.bytes.size() != image.pixelCount() * 4) {
      fail(ErrorCode::kInternal, "an image has another size than it says");
    }
  });
}

std::vector<std::string> volumeSeeds(const fs::path& folder) {
  std::vector<std::string> made;
  for (const size_t bricks : {size_t{1}, size_t{3}}) {
    SparseVolume volume;
    volume.voxel_size = 0.25;
    volume.origin = {1, 2, 3};
    for (size_t b = 0; b < bricks; ++b) {
      volume.bricks.push_back({static_cast<int32_t>(b) * 128, -8, 8});
    }
    for (size_t v = 0; v < bricks * kBrickVoxelCount; ++v) {
      volume.density.push_back(v % 3 == 0 ? 0.0f : 0.5f + static_cast<float>(v % 7));
      for (int c = 0; c < 3; ++c) volume.colour.push_back(0.1f * static_cast<float>(c + 1));
    }
    writeVolumeFile(volume, (folder / "seed.vdb").string());
    made.push_back(load(folder / "seed.vdb"));
  }
  return made;
}

void readVolume(const fs::path& path) {
  const SparseVolume volume = readVolumeFile(path.string());
  keepsPromises([&] {
    if (volume.density.size() != volume.brickCount() * kBrickVoxelCount ||
        volume.colour.size() != volume.density.size() * 3) {
      fail(ErrorCode::kInternal, "a volume has other arrays than its bricks need");
    }
  });
}

void addMediaReaders(std::vector<Reader>& all) {
  all.push_back({"exr", nullptr, storeAs("input.exr"),
                 [](const fs::path& folder) { readExr(folder / "input.exr"); }, exrSeeds});
  all.push_back({"webp", nullptr, storeAs("input.webp"),
                 [](const fs::path& folder) { readWebp(folder / "input.webp"); }, webpSeeds});
  all.push_back({"volume", nullptr, storeAs("input.vdb"),
                 [](const fs::path& folder) { readVolume(folder / "input.vdb"); }, volumeSeeds});
}

// ---- Cameras ------------------------------------------------------------------------------------

/// The camera without distortion of a lens, as a data set gives it.
void undistorts(const CameraView& view) {
  Camera camera = view.camera;
  if (camera.width == 0)
    camera = resized({.width = 1, .height = 1, .fx = camera.fx, .fy = camera.fy}, 9, 7);
  try {
    camera = undistortedCamera(camera, view.lens);
  } catch (const Error&) {
    return;
  }
  keepsPromises([&] { validate(camera); });
}

void readCameras(const fs::path& path) {
  const std::vector<CameraView> views = readCameraFile(path.string(), Distorted::kKeep);
  // One lens takes a millisecond: what a fuzzer looks for is in the first.
  if (!views.empty() && views.front().lens.isDistorted()) undistorts(views.front());
  keepsPromises([&] {
    for (CameraView view : views) {
      // Files without a size of the pictures give cameras in units of the picture.
      if (view.camera.width == 0 && view.camera.height == 0) {
        view.camera.width = view.camera.height = 1;
      }
      validate(view.camera);
    }
  });
}

/// One input for two files: the length of the first in two bytes, the first, the second.
auto storePair(const char* first, const char* second) {
  return [first, second](const fs::path& folder, const std::string& bytes) {
    size_t length = 0;
    for (size_t b = 0; b < 2 && b < bytes.size(); ++b) {
      length |= static_cast<size_t>(static_cast<unsigned char>(bytes[b])) << (8 * b);
    }
    const std::string both = bytes.size() > 2 ? bytes.substr(2) : "";
    length = std::min(length, both.size());
    storeFile(folder / first, both.substr(0, length));
    storeFile(folder / second, both.substr(length));
  };
}

std::string pair(const std::string& first, const std::string& second) {
  return ByteText().u16(first.size()).text(first).text(second).bytes;
}

std::vector<std::string> colmapSeeds(const fs::path&) {
  const auto f64 = [](ByteText& to, std::initializer_list<double> values) {
    for (const double value : values) to.u64(std::bit_cast<uint64_t>(value));
  };
  ByteText cameras;
  cameras.u64(2).u32(7).u32(0).u64(640).u64(480);
  f64(cameras, {500.0, 320.25, 240.5});
  cameras.u32(3).u32(4).u64(100).u64(50);
  f64(cameras, {80.0, 90.0, 51.0, 24.0, 0.0, 0.0, 0.0, 0.0});
  ByteText images;
  images.u64(2).u32(11);
  f64(images, {1.0, 1.0, 0.0, 0.0, 1.0, 2.0, 3.0});
  images.u32(3).text("b.png").u8(0).u64(1);
  f64(images, {1.5, 2.5});
  images.u64(UINT64_MAX).u32(12);
  f64(images, {1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0});
  images.u32(7).text("a.png").u8(0).u64(0);
  return {pair(cameras.bytes, images.bytes)};
}

std::vector<std::string> colmapTextSeeds(const fs::path&) {
  return {
      pair("# Camera list\n7 SIMPLE_PINHOLE 640 480 500 320.25 240.5\n"
           "3 OPENCV 100 50 80 90 51 24 0 0 0 0\r\n",
           "# Images\n11 1 1 0 0 1 2 3 3 b c.png\n1.5 2.5 -1\n12 1 0 0 0 0 0 4 7 a.png\n\n")};
}

void readPoints(const PointSet& points) {
  keepsPromises([&] { validatePoints(points, "points"); });
}

std::vector<std::string> colmapPointSeeds(const fs::path&) {
  ByteText bytes;
  bytes.u64(2);
  for (const uint64_t id : {5u, 9u}) {
    bytes.u64(id);
    for (const double value : {1.0, -2.0, 3.5}) bytes.u64(std::bit_cast<uint64_t>(value));
    bytes.u8(255).u8(0).u8(128).u64(std::bit_cast<uint64_t>(0.25)).u64(1).u32(1).u32(7);
  }
  return {bytes.bytes};
}

std::vector<std::string> colmapPointTextSeeds(const fs::path&) {
  return {"# 3D points\n5 1 -2 3.5 255 0 128 0.25 1 7\n9 0 0 2 0 0 0 1e-3\r\n"};
}

std::vector<std::string> plyPointSeeds(const fs::path&) {
  const std::string properties =
      "element vertex 1\nproperty float x\nproperty float y\nproperty float z\nproperty uchar "
      "red\nproperty uchar green\nproperty uchar blue\nend_header\n";
  return {"ply\nformat ascii 1.0\n" + properties + "1 2 3 4 5 6\n",
          "ply\nformat binary_little_endian 1.0\n" + properties + std::string(15, '\x01'),
          "ply\nformat ascii 1.0\nelement vertex 2\nproperty double x\nproperty double y\n"
          "property double z\nend_header\n1 2 3\n4 5 6\n"};
}

std::vector<std::string> transformsSeeds(const fs::path&) {
  const std::string frames =
      "\"frames\":[{\"file_path\":\"a.png\",\"transform_matrix\":"
      "[[1,0,0,1],[0,0,-1,2],[0,1,0,3],[0,0,0,1]]},{\"file_path\":\"b\",\"cx\":9,"
      "\"transform_matrix\":[[2,0,0,1],[0,2,0,2],[0,0,2,3],[0,0,0,1]]}]}";
  return {
      "{\"fl_x\":500,\"fl_y\":510,\"cx\":300.5,\"cy\":250,\"w\":640,\"h\":480,\"k1\":0.0,"
      "\"camera_model\":\"OPENCV\"," +
          frames,
      "{\"camera_angle_x\":1.2,\"time\":0.25,\"timestamp\":2,\"timestep_index\":7," + frames,
      "{\"fl_x\":50,\"w\":64,\"h\":48,\"camera_model\":\"OPENCV\",\"k1\":-0.1,\"k3\":0.01,\"k5\":0."
      "1,\"p2\":"
      "0.001,\"ply_file_path\":\"p.ply\",\"test_filenames\":[\"b\"]," +
          frames,
      "{\"fl_x\":50,\"w\":64,\"h\":48,\"is_fisheye\":true,\"k1\":0.1,\"k4\":0.2," + frames,
      "{\"camera_model\":\"ORTHOGRAPHIC\",\"ortho_scale\":3,\"w\":8,\"h\":8," + frames};
}

std::vector<std::string> npySeeds(const fs::path&) {
  return {npyFile(npyHeader("<f8", false, "(2, 3)"), doubles({1, 2, 3, 4, 5, 6})),
          npyFile(npyHeader("<f4", true, "(2, 2)"), floats({1, 2, 3, 4}), 2)};
}

void readNpy(const fs::path& path) {
  const NpyArray array = readNpyArray(path.string());
  keepsPromises([&] {
    uint64_t count = 1;
    for (const uint64_t side : array.shape) count *= side;
    if (count != array.values.size()) fail(ErrorCode::kInternal, "its shape is of other numbers");
  });
}

std::vector<Reader> makeReaders() {
  std::vector<Reader> all;
  addSplatReaders(all);
  addSceneReaders(all);
  addMediaReaders(all);
  all.push_back({"mesh", nullptr, storeAs("input.glb"),
                 [](const fs::path& folder) {
                   const TriMesh mesh = readMeshFile((folder / "input.glb").string());
                   keepsPromises([&] { validateArrays(mesh); });
                 },
                 meshSeeds, JsonPlace::kGlbChunk});
  const char* asset = "input.stipple.safetensors";
  all.push_back({"surface", nullptr, storeAs(asset),
                 [asset](const fs::path& folder) { readSurface(folder / asset); }, surfaceSeeds,
                 JsonPlace::kSafetensorsHeader});
  all.push_back({"hierarchy", nullptr, storeAs(asset),
                 [asset](const fs::path& folder) { readHierarchy(folder / asset); }, hierarchySeeds,
                 JsonPlace::kSafetensorsHeader});
  all.push_back({"motion", nullptr, storeAs(asset),
                 [asset](const fs::path& folder) { readMotion(folder / asset); }, motionSeeds,
                 JsonPlace::kSafetensorsHeader});
  all.push_back({"latent", nullptr, storeAs(asset),
                 [asset](const fs::path& folder) { readLatent(folder / asset); }, latentSeeds,
                 JsonPlace::kSafetensorsHeader});
  all.push_back({"scaffold", nullptr, storeAs(asset),
                 [asset](const fs::path& folder) { readScaffold(folder / asset); }, scaffoldSeeds,
                 JsonPlace::kSafetensorsHeader});
  all.push_back({"relay", nullptr, storeAs(asset),
                 [asset](const fs::path& folder) { readRelay(folder / asset); }, relaySeeds,
                 JsonPlace::kSafetensorsHeader});
  all.push_back({"transforms", nullptr, storeAs("transforms.json"),
                 [](const fs::path& folder) { readCameras(folder / "transforms.json"); },
                 transformsSeeds, JsonPlace::kWholeFile});
  all.push_back({"npy", nullptr, storeAs("input.npy"),
                 [](const fs::path& folder) { readNpy(folder / "input.npy"); }, npySeeds});
  all.push_back({"pose-bounds", nullptr, storeAs("poses_bounds.npy"),
                 [](const fs::path& folder) { readCameras(folder); },
                 [](const fs::path&) { return std::vector{poseBoundsFile(2, 20, 30, 25)}; }});
  all.push_back({"colmap", nullptr, storePair("cameras.bin", "images.bin"),
                 [](const fs::path& folder) { readCameras(folder); }, colmapSeeds});
  all.push_back({"colmap-points", nullptr, storeAs("points3D.bin"),
                 [](const fs::path& folder) { readPoints(readColmapPoints(folder.string())); },
                 colmapPointSeeds});
  all.push_back({"colmap-points-text", nullptr, storeAs("points3D.txt"),
                 [](const fs::path& folder) { readPoints(readColmapPoints(folder.string())); },
                 colmapPointTextSeeds});
  all.push_back(
      {"ply-points", nullptr, storeAs("points.ply"),
       [](const fs::path& folder) { readPoints(readPlyPoints((folder / "points.ply").string())); },
       plyPointSeeds});
  all.push_back({"colmap-text", nullptr, storePair("cameras.txt", "images.txt"),
                 [](const fs::path& folder) { readCameras(folder); }, colmapTextSeeds});
  return all;
}

}  // namespace

void storeFile(const fs::path& path, const std::string& bytes) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file << bytes;
  file.close();
  if (!file) fail(ErrorCode::kIo, path.string() + " cannot be written");
}

const std::vector<Reader>& readers() {
  static const std::vector<Reader> kReaders = makeReaders();
  return kReaders;
}

}  // namespace stipple::fuzz
