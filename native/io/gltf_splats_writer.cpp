// Based on: The Khronos Group, glTF extension KHR_gaussian_splatting, release candidate of 2026,
// and glTF 2.0 Specification, section 4 (GLB).
#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "io/gltf_splat_names.h"
#include "io/gltf_splats.h"
#include "io/input_file.h"
#include "io/output_file.h"
#include "math/colour.h"

namespace stipple {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr int kFloat = 5126;
constexpr int kUnsignedShort = 5123;
constexpr int kArrayBuffer = 34962;
constexpr size_t kGrain = 4096;
// Splats per round of writing: 4 MB of the widest attribute.
constexpr size_t kChunk = kGrain * 64;
constexpr size_t kGlbHead = 12;
constexpr size_t kChunkHead = 8;
constexpr char kStage[] = "Writing splats";

/// One attribute and how its bytes are made.
struct Attribute {
  std::string name;
  const char* type;
  int component;
  size_t bytes;  ///< per splat, a multiple of 4
  std::function<void(size_t i, char* out)> fill;
};

void putFloats(const float* values, size_t count, char* out) {
  for (size_t k = 0; k < count; ++k) {
    uint32_t bits = 0;
    std::memcpy(&bits, values + k, 4);
    for (unsigned b = 0; b < 4; ++b) out[k * 4 + b] = static_cast<char>(bits >> (8 * b));
  }
}

uint16_t unitShort(double value) {
  return static_cast<uint16_t>(std::lround(std::clamp(value, 0.0, 1.0) * 65535.0));
}

class Writer {
 public:
  Writer(const SplatCloud& cloud, const std::string& path, Progress* progress)
      : cloud_(cloud), path_(path), progress_(progress) {
    if (cloud.size() == 0) {
      fail(ErrorCode::kUnsupported, path +
                                        " cannot be written: the cloud is empty, and glTF holds "
                                        "at least one splat");
    }
    listAttributes();
    for (const Attribute& attribute : attributes_) data_bytes_ += attribute.bytes * cloud.size();
  }

  void write() {
    if (lowerEnding(path_) == ".glb") {
      writeBinary();
    } else {
      writeText();
    }
  }

 private:
  void addFloats(const std::string& name, const char* type, const std::vector<float>& values,
                 size_t width, size_t stride, size_t offset = 0) {
    attributes_.push_back(
        {name, type, kFloat, width * 4, [&values, width, stride, offset](size_t i, char* out) {
           putFloats(&values[i * stride + offset], width, out);
         }});
  }

  void listAttributes() {
    addFloats("POSITION", "VEC3", cloud_.positions, 3, 3);
    attributes_.push_back({"COLOR_0", "VEC4", kUnsignedShort, 8,
                           [this](size_t i, char* out) { fillColour(i, out); }});
    attributes_.push_back({kGltfRotation, "VEC4", kFloat, 16, [this](size_t i, char* out) {
                             const float* q = &cloud_.rotations[i * 4];
                             const float xyzw[] = {q[1], q[2], q[3], q[0]};
                             putFloats(xyzw, 4, out);
                           }});
    addFloats(kGltfScale, "VEC3", cloud_.scales, 3, 3);
    addFloats(kGltfOpacity, "SCALAR", cloud_.opacities, 1, 1);
    for (int degree = 0; degree <= std::min(cloud_.sh_degree, 3); ++degree) {
      for (int m = 0; m <= 2 * degree; ++m) {
        addFloats(gltfHarmonic(degree, m), "VEC3", cloud_.sh, 3, cloud_.shStride(),
                  static_cast<size_t>(degree * degree + m) * 3);
      }
    }
  }

  /// What renderers without splats show: linear, as glTF demands, 16 bits so that dark ones differ.
  void fillColour(size_t i, char* out) const {
    const float* sh = &cloud_.sh[i * cloud_.shStride()];
    for (size_t c = 0; c < 4; ++c) {
      double value = static_cast<double>(cloud_.opacities[i]);
      if (c < 3) {
        value = 0.5 + static_cast<double>(kShC0) * static_cast<double>(sh[c]);
        if (cloud_.colour_space == ColourSpace::kDisplay) value = srgbToLinear(value);
      }
      const uint16_t code = unitShort(value);
      out[c * 2] = static_cast<char>(code & 0xff);
      out[c * 2 + 1] = static_cast<char>(code >> 8);
    }
  }

  Json bounds(bool upper) const {
    std::array<float, 3> bound;
    for (size_t axis = 0; axis < 3; ++axis) {
      bound[axis] = cloud_.positions[axis];
      for (size_t i = axis; i < cloud_.positions.size(); i += 3) {
        const float value = cloud_.positions[i];
        bound[axis] = upper ? std::max(bound[axis], value) : std::min(bound[axis], value);
      }
    }
    // As double: the same number, where JSON's shortest float would be another double.
    Json list = Json::array();
    for (const float value : bound) list.push_back(static_cast<double>(value));
    return list;
  }

  std::string json(const std::string& uri) const {
    Json root;
    root["asset"] = {{"version", "2.0"}, {"generator", "stipple"}};
    root["extensionsUsed"] = {kGltfSplats};
    root["scene"] = 0;
    root["scenes"] = Json::array({{{"nodes", {0}}}});
    root["nodes"] = Json::array({{{"mesh", 0}}});
    Json primitive;
    primitive["mode"] = 0;
    Json views = Json::array();
    Json accessors = Json::array();
    uint64_t offset = 0;
    for (const Attribute& attribute : attributes_) {
      primitive["attributes"][attribute.name] = views.size();
      const uint64_t bytes = attribute.bytes * cloud_.size();
      Json accessor = {{"bufferView", views.size()},
                       {"componentType", attribute.component},
                       {"count", cloud_.size()},
                       {"type", attribute.type}};
      if (attribute.component == kUnsignedShort) accessor["normalized"] = true;
      if (attribute.name == "POSITION") {
        accessor["min"] = bounds(false);
        accessor["max"] = bounds(true);
      }
      accessors.push_back(accessor);
      views.push_back(
          {{"buffer", 0}, {"byteOffset", offset}, {"byteLength", bytes}, {"target", kArrayBuffer}});
      offset += bytes;
    }
    primitive["extensions"][kGltfSplats] = {
        {"kernel", kGltfKernel},
        {"colorSpace",
         cloud_.colour_space == ColourSpace::kLinear ? kColourSpaceLinear : kColourSpaceDisplay}};
    if (cloud_.antialias == Antialias::kMip) primitive["extras"][kGltfAntialiasKey] = kGltfMip;
    if (cloud_.frame != Frame::kUnknown && cloud_.frame != kGltfFrame) {
      primitive["extras"][kGltfFrameKey] = frameName(cloud_.frame);
    }
    root["meshes"] = Json::array({{{"primitives", Json::array({primitive})}}});
    root["accessors"] = accessors;
    root["bufferViews"] = views;
    Json buffer;
    if (!uri.empty()) buffer["uri"] = uri;
    buffer["byteLength"] = data_bytes_;
    root["buffers"] = Json::array({buffer});
    return root.dump();
  }

  void writeData(OutputFile& file) {
    std::vector<char> bytes;
    for (size_t a = 0; a < attributes_.size(); ++a) {
      const Attribute& attribute = attributes_[a];
      for (size_t chunk = 0; chunk < cloud_.size(); chunk += kChunk) {
        const size_t rows = std::min(kChunk, cloud_.size() - chunk);
        bytes.resize(rows * attribute.bytes);
        parallelFor(rows, kGrain, [&](size_t begin, size_t end) {
          for (size_t i = begin; i < end; ++i) {
            attribute.fill(chunk + i, &bytes[i * attribute.bytes]);
          }
        });
        file.write(bytes.data(), bytes.size());
        advance(progress_,
                (static_cast<double>(a) +
                 static_cast<double>(chunk + rows) / static_cast<double>(cloud_.size())) /
                    static_cast<double>(attributes_.size()),
                kStage);
      }
    }
  }

  static void putNumber(std::string& bytes, uint64_t value) {
    for (unsigned b = 0; b < 4; ++b) bytes.push_back(static_cast<char>(value >> (8 * b)));
  }

  void writeBinary() {
    std::string text = json("");
    while (text.size() % 4 != 0) text.push_back(' ');
    const uint64_t total = kGlbHead + kChunkHead + text.size() + kChunkHead + data_bytes_;
    if (total > UINT32_MAX) {
      fail(ErrorCode::kUnsupported, path_ + " would have " + std::to_string(total) +
                                        " bytes; a .glb holds less than 4 GiB, a .gltf more");
    }
    OutputFile file(path_);
    std::string head = "glTF";
    putNumber(head, 2);
    putNumber(head, total);
    putNumber(head, text.size());
    head += "JSON" + text;
    putNumber(head, data_bytes_);
    head += std::string("BIN\0", 4);
    file.write(head.data(), head.size());
    writeData(file);
    file.commit();
  }

  void writeText() {
    const fs::path data_path = fs::path(path_).replace_extension(".bin");
    const std::string text = json(percentEncoded(data_path.filename().string()));
    OutputFile data(data_path.string());
    OutputFile file(path_);
    writeData(data);
    file.write(text.data(), text.size());
    file.handOver();
    data.commit();
    file.commit();
  }

  /// A file name as a URI.
  static std::string percentEncoded(const std::string& name) {
    std::string uri;
    for (const char letter : name) {
      const auto byte = static_cast<unsigned char>(letter);
      if (std::isalnum(byte) != 0 || std::string("-._~").find(letter) != std::string::npos) {
        uri.push_back(letter);
        continue;
      }
      constexpr char kDigits[] = "0123456789ABCDEF";
      uri += {'%', kDigits[byte >> 4], kDigits[byte & 15]};
    }
    return uri;
  }

  const SplatCloud& cloud_;
  std::string path_;
  Progress* progress_;
  std::vector<Attribute> attributes_;
  uint64_t data_bytes_ = 0;
};

}  // namespace

void writeGltfSplats(const SplatCloud& cloud, const std::string& path, const SplatWriteOptions&,
                     Progress* progress) {
  Writer(cloud, path, progress).write();
}

}  // namespace stipple
