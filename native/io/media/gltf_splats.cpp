// Based on: The Khronos Group, glTF extension KHR_gaussian_splatting, release candidate of 2026.
#include <algorithm>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "data/clouds/splat_cloud.h"
#include "io/bytes/limits.h"
#include "io/media/gltf_accessor.h"
#include "io/media/gltf_model.h"
#include "io/media/gltf_scene.h"
#include "io/media/media_calls.h"
#include "io/splats/gltf_splat_names.h"

namespace stipple::media {

namespace {

constexpr int kMaxDegree = 3;
constexpr size_t kBlock = 1024;

const std::set<std::string> kKnownExtensions = {kGltfSplats, kGltfSpz, "KHR_mesh_quantization",
                                                "KHR_materials_unlit", "KHR_texture_transform"};

/// One use of a splat primitive.
struct Part {
  StippleMediaSplatPart info{};
  const tinygltf::Primitive* primitive = nullptr;
  std::string what;
  int packed_view = -1;  ///< buffer view of an SPZ file
};

class SplatReader {
 public:
  explicit SplatReader(const std::string& path)
      : path_(path),
        scene_(path, kKnownExtensions, GltfScene::Content::kSplats),
        model_(scene_.model()) {}

  void read(const StippleMediaSink& sink) {
    scene_.visitMeshes(Mat4d::Identity(), [this](size_t mesh, const Mat4d& matrix) {
      const auto& primitives = model_.meshes[mesh].primitives;
      for (size_t p = 0; p < primitives.size(); ++p) {
        if (primitives[p].extensions.count(kGltfSplats) != 0) addPart(mesh, p, matrix);
      }
    });
    if (parts_.empty()) {
      fail(ErrorCode::kFormat, path_ +
                                   " holds no splats in its scene: no primitive has the "
                                   "extension " +
                                   kGltfSplats);
    }
    std::vector<StippleMediaSplatPart> infos;
    for (const Part& part : parts_) infos.push_back(part.info);
    give(sink, kMediaSplatParts, infos);
    for (size_t p = 0; p < parts_.size(); ++p) readPart(sink, p);
  }

 private:
  void addPart(size_t mesh, size_t index, const Mat4d& matrix) {
    Part part;
    part.primitive = &model_.meshes[mesh].primitives[index];
    part.what = path_ + ": mesh " + std::to_string(mesh) + ", primitive " + std::to_string(index);
    part.info.mesh = static_cast<uint32_t>(mesh);
    part.info.primitive = static_cast<uint32_t>(index);
    for (int row = 0; row < 4; ++row) {
      for (int column = 0; column < 4; ++column) {
        part.info.matrix[row * 4 + column] = matrix(row, column);
      }
    }
    readKind(part);
    readShape(part);
    bytes_ += bytesOf(part);
    parts_.push_back(std::move(part));
    requireAllowed(bytes_, kInstanceAllowance, scene_.fileBytes(), path_,
                   std::to_string(parts_.size()) + " uses of its splats");
  }

  /// Bytes of what is handed over of a part.
  uint64_t bytesOf(const Part& part) const {
    if (part.info.packing != kMediaSplatsInArrays) {
      return viewBytes(model_, part.packed_view, part.what + ", " + kGltfSpz);
    }
    const size_t floats = 11 + shCoefficientCount(static_cast<int>(part.info.sh_degree)) * 3;
    return part.info.count * floats * sizeof(float);
  }

  [[noreturn]] static void failUnsupported(const Part& part, const std::string& key,
                                           const std::string& seen, const std::string& allowed) {
    fail(ErrorCode::kUnsupported,
         part.what + " has the " + key + " '" + seen.substr(0, 60) + "'; " + allowed);
  }

  static std::string text(const tinygltf::Value& object, const char* key,
                          const std::string& otherwise) {
    return object.IsObject() && object.Has(key) && object.Get(key).IsString()
               ? object.Get(key).Get<std::string>()
               : otherwise;
  }

  void readKind(Part& part) const {
    const tinygltf::Value& extension = part.primitive->extensions.at(kGltfSplats);
    if (part.primitive->mode != TINYGLTF_MODE_POINTS) {
      fail(ErrorCode::kFormat, part.what + " has mode " + std::to_string(part.primitive->mode) +
                                   "; splats are points, mode 0");
    }
    readPacking(part, extension);
    // The draft of SPZ is older than both words, and its files may be without.
    const bool is_packed = part.info.packing != kMediaSplatsInArrays;
    const std::string kernel = text(extension, "kernel", is_packed ? kGltfKernel : "");
    if (kernel != kGltfKernel) failUnsupported(part, "kernel", kernel, "'ellipse' is supported");
    const std::string space = text(extension, "colorSpace", is_packed ? kColourSpaceDisplay : "");
    if (space != kColourSpaceDisplay && space != kColourSpaceLinear) {
      failUnsupported(
          part, "colorSpace", space,
          std::string(kColourSpaceDisplay) + " and " + kColourSpaceLinear + " are supported");
    }
    const std::string projection = text(extension, "projection", kGltfProjection);
    if (projection != kGltfProjection) {
      failUnsupported(part, "projection", projection, "'perspective' is supported");
    }
    // Which way to sort is how to draw, not what the splats are.
    part.info.colour_space = static_cast<uint32_t>(
        space == kColourSpaceLinear ? ColourSpace::kLinear : ColourSpace::kDisplay);
    const tinygltf::Value& extras = part.primitive->extras;
    part.info.antialias = static_cast<uint32_t>(
        text(extras, kGltfAntialiasKey, "") == kGltfMip ? Antialias::kMip : Antialias::kClassic);
    const std::string frame = text(extras, kGltfFrameKey, frameName(kGltfFrame));
    part.info.frame = static_cast<uint32_t>(frameFromName(frame).value_or(Frame::kUnknown));
    if (part.info.frame == 0) {
      failUnsupported(part, "frame", frame, "three letters such as LUF or RDF are known");
    }
  }

  void readPacking(Part& part, const tinygltf::Value& extension) const {
    if (!extension.IsObject() || !extension.Has("extensions")) return;
    const tinygltf::Value& inner = extension.Get("extensions");
    if (!inner.IsObject()) return;
    for (const std::string& name : inner.Keys()) {
      if (name != kGltfSpz) {
        failUnsupported(part, "compression", name,
                        std::string("splats as accessors and ") + kGltfSpz + " are supported");
      }
      const tinygltf::Value& spz = inner.Get(name);
      if (!spz.IsObject() || !spz.Has("bufferView") || !spz.Get("bufferView").IsInt()) {
        fail(ErrorCode::kFormat, part.what + ": " + kGltfSpz + " has no 'bufferView'");
      }
      part.packed_view = spz.Get("bufferView").Get<int>();
      part.info.packing = kMediaSplatsInSpz;
    }
  }

  static int find(const Part& part, const std::string& name) {
    const auto found = part.primitive->attributes.find(name);
    return found == part.primitive->attributes.end() ? -1 : found->second;
  }

  /// The accessor of an attribute that must be there, with one element per splat, all with data.
  int require(const Part& part, const std::string& name, size_t width) const {
    const int accessor = find(part, name);
    const std::string what = part.what + ", " + name;
    if (accessor < 0) fail(ErrorCode::kFormat, part.what + " has no attribute " + name);
    requireAccessor(model_, accessor, width, what);
    if (model_.accessors[static_cast<size_t>(accessor)].bufferView < 0) {
      fail(ErrorCode::kFormat, what + " has no buffer view; splats need data");
    }
    const uint64_t count = accessorCount(model_, accessor, what);
    if (count != part.info.count) {
      fail(ErrorCode::kFormat, what + " has " + std::to_string(count) + " elements; " +
                                   std::to_string(part.info.count) + " splats need one each");
    }
    return accessor;
  }

  void readShape(Part& part) const {
    const int position = find(part, "POSITION");
    if (part.info.packing != kMediaSplatsInArrays) {
      part.info.count = position < 0 ? std::numeric_limits<uint64_t>::max()
                                     : accessorCount(model_, position, part.what + ", POSITION");
      return;
    }
    if (position < 0) fail(ErrorCode::kFormat, part.what + " has no attribute POSITION");
    part.info.count = accessorCount(model_, position, part.what + ", POSITION");
    require(part, "POSITION", 3);
    require(part, kGltfRotation, 4);
    require(part, kGltfScale, 3);
    require(part, kGltfOpacity, 1);
    require(part, gltfHarmonic(0, 0), 3);
    int degree = 0;
    while (degree < kMaxDegree && find(part, gltfHarmonic(degree + 1, 0)) >= 0) ++degree;
    part.info.sh_degree = static_cast<uint32_t>(degree);
    for (int d = 1; d <= degree; ++d) {
      for (int m = 0; m <= 2 * d; ++m) require(part, gltfHarmonic(d, m), 3);
    }
  }

  void readPart(const StippleMediaSink& sink, size_t index) const {
    const Part& part = parts_[index];
    if (part.info.packing != kMediaSplatsInArrays) {
      give(sink, kMediaSplatPositions + static_cast<uint32_t>(index) * 5,
           readView(model_, part.packed_view, part.what + ", " + kGltfSpz));
      return;
    }
    const auto array = [&](StippleMediaSplatArray which, size_t width) {
      const size_t floats = static_cast<size_t>(part.info.count) * width;
      return static_cast<float*>(
          allocate(sink, which + static_cast<uint32_t>(index) * 5, floats * sizeof(float)));
    };
    struct Column {
      FloatSource source;
      float* out;
      size_t stride;
    };
    std::vector<Column> columns;
    const auto take = [&](const std::string& name, size_t width, float* out, size_t stride) {
      FloatSource source(model_, find(part, name), width, part.what + ", " + name);
      const bool follows = !columns.empty() && columns.back().stride == stride &&
                           out == columns.back().out + columns.back().source.width();
      if (follows && columns.back().source.join(source)) return;
      columns.push_back({std::move(source), out, stride});
    };
    take("POSITION", 3, array(kMediaSplatPositions, 3), 3);
    take(kGltfRotation, 4, array(kMediaSplatRotations, 4), 4);
    take(kGltfScale, 3, array(kMediaSplatScales, 3), 3);
    take(kGltfOpacity, 1, array(kMediaSplatOpacities, 1), 1);
    const int degree = static_cast<int>(part.info.sh_degree);
    const size_t stride = shCoefficientCount(degree) * 3;
    float* sh = array(kMediaSplatSh, stride);
    for (int d = 0; d <= degree; ++d) {
      for (int m = 0; m <= 2 * d; ++m) {
        take(gltfHarmonic(d, m), 3, sh + (d * d + m) * 3, stride);
      }
    }
    // Block by block, so that the harmonics of a splat meet in the cache.
    parallelFor(static_cast<size_t>(part.info.count), kBlock, [&](size_t begin, size_t end) {
      for (const Column& column : columns) {
        column.source.readDense(begin, end, column.out + begin * column.stride, column.stride);
      }
    });
    for (const Column& column : columns) column.source.readSparse(column.out, column.stride);
  }

  std::string path_;
  GltfScene scene_;
  const GltfModel& model_;
  std::vector<Part> parts_;
  uint64_t bytes_ = 0;  ///< of all parts
};

}  // namespace

void stipple_media_gltf_splats_read(const char* path, const StippleMediaSink* sink,
                                    StippleMediaStatus* status) {
  guard(path, status, [&] { SplatReader(path).read(*sink); });
}

}  // namespace stipple::media
