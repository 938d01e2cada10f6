// Based on: The Khronos Group, glTF extension KHR_gaussian_splatting, release candidate of 2026,
// and glTF 2.0 Specification, section 4 (GLB).
#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cctype>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "io/bytes/input_file.h"
#include "io/bytes/output_file.h"
#include "io/splats/gltf_splat_names.h"
#include "io/splats/gltf_splats.h"
#include "io/splats/splat_check.h"
#include "math/colour.h"

namespace stipple {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr int kFloat = 5126;
constexpr int kUnsignedShort = 5123;
constexpr int kArrayBuffer = 34962;
constexpr size_t kGrain = 4096;
constexpr size_t kGlbHead = 12;
constexpr size_t kChunkHead = 8;
constexpr char kStage[] = "Writing splats";

/// One attribute inside the rows of a view.
struct Attribute {
  std::string name;
  const char* type;
  int component;
  size_t offset;  ///< bytes from the start of a row
};

/// Rows of a buffer view, one per splat: floats of the cloud as they lie, or bytes that are made.
struct View {
  std::vector<Attribute> attributes;
  size_t row_bytes;                  ///< a multiple of 4
  const std::vector<float>* floats;  ///< null: `fill` makes them
  void (*fill)(const SplatCloud& cloud, size_t i, char* out);
};

void putFloats(const float* values, size_t count, char* out) {
  if constexpr (std::endian::native == std::endian::little) {
    std::memcpy(out, values, count * sizeof(float));
    return;
  }
  for (size_t k = 0; k < count; ++k) {
    uint32_t bits = 0;
    std::memcpy(&bits, values + k, 4);
    for (unsigned b = 0; b < 4; ++b) out[k * 4 + b] = static_cast<char>(bits >> (8 * b));
  }
}

/// srgbToLinear of 0..1 from a table: off by less than 4e-8, a four-hundredth of a step of 16 bits.
double fastSrgbToLinear(double value) {
  constexpr size_t kSteps = 4096;
  static const std::vector<double> kTable = [] {
    std::vector<double> table(kSteps + 2);
    for (size_t i = 0; i < table.size(); ++i) table[i] = srgbToLinear(double(i) / kSteps);
    return table;
  }();
  const double place = std::clamp(value, 0.0, 1.0) * kSteps;
  const auto index = static_cast<size_t>(place);
  return kTable[index] + (place - static_cast<double>(index)) * (kTable[index + 1] - kTable[index]);
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
    listViews();
    for (const View& view : views_) data_bytes_ += view.row_bytes * cloud.size();
  }

  void write() {
    if (lowerExtension(path_) == ".glb") {
      writeBinary();
    } else {
      writeText();
    }
  }

 private:
  void addFloats(const std::string& name, const char* type, const std::vector<float>& values) {
    views_.push_back({{{name, type, kFloat, 0}},
                      values.size() / cloud_.size() * sizeof(float),
                      &values,
                      nullptr});
  }

  void listViews() {
    addFloats("POSITION", "VEC3", cloud_.positions);
    views_.push_back({{{"COLOR_0", "VEC4", kUnsignedShort, 0}}, 8, nullptr, fillColour});
    views_.push_back({{{kGltfRotation, "VEC4", kFloat, 0}}, 16, nullptr, fillRotation});
    addFloats(kGltfScale, "VEC3", cloud_.scales);
    addFloats(kGltfOpacity, "SCALAR", cloud_.opacities);
    // All harmonics of a splat side by side, as the cloud has them, so that they are not copied; a
    // row of degree 3 has 192 bytes, and glTF allows 252.
    View harmonics = {{}, cloud_.shStride() * sizeof(float), &cloud_.sh, nullptr};
    for (int degree = 0; degree <= cloud_.sh_degree; ++degree) {
      for (int m = 0; m <= 2 * degree; ++m) {
        harmonics.attributes.push_back({gltfHarmonic(degree, m), "VEC3", kFloat,
                                        static_cast<size_t>(degree * degree + m) * 12});
      }
    }
    views_.push_back(std::move(harmonics));
  }

  /// What renderers without splats show: linear, as glTF demands, 16 bits so that dark ones differ.
  static void fillColour(const SplatCloud& cloud, size_t i, char* out) {
    const float* sh = &cloud.sh[i * cloud.shStride()];
    for (size_t c = 0; c < 4; ++c) {
      double value = static_cast<double>(cloud.opacities[i]);
      if (c < 3) {
        value = 0.5 + static_cast<double>(kShC0) * static_cast<double>(sh[c]);
        if (cloud.colour_space == ColourSpace::kDisplay) value = fastSrgbToLinear(value);
      }
      const uint16_t code = unitShort(value);
      out[c * 2] = static_cast<char>(code & 0xff);
      out[c * 2 + 1] = static_cast<char>(code >> 8);
    }
  }

  static void fillRotation(const SplatCloud& cloud, size_t i, char* out) {
    const float* q = &cloud.rotations[i * 4];
    const float xyzw[] = {q[1], q[2], q[3], q[0]};
    putFloats(xyzw, 4, out);
  }

  /// Smallest and largest position, in one pass through memory.
  void addBounds(Json& accessor) const {
    std::array<float, 3> low = {cloud_.positions[0], cloud_.positions[1], cloud_.positions[2]};
    std::array<float, 3> high = low;
    for (size_t i = 0; i < cloud_.positions.size(); i += 3) {
      for (size_t axis = 0; axis < 3; ++axis) {
        low[axis] = std::min(low[axis], cloud_.positions[i + axis]);
        high[axis] = std::max(high[axis], cloud_.positions[i + axis]);
      }
    }
    // As double: the same number, where JSON's shortest float would be another double.
    for (const auto& [key, bound] : {std::pair{"min", low}, std::pair{"max", high}}) {
      for (const float value : bound) accessor[key].push_back(static_cast<double>(value));
    }
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
    for (const View& view : views_) {
      for (const Attribute& attribute : view.attributes) {
        primitive["attributes"][attribute.name] = accessors.size();
        Json accessor = {{"bufferView", views.size()},
                         {"byteOffset", attribute.offset},
                         {"componentType", attribute.component},
                         {"count", cloud_.size()},
                         {"type", attribute.type}};
        if (attribute.component == kUnsignedShort) accessor["normalized"] = true;
        if (attribute.name == "POSITION") {
          addBounds(accessor);
        }
        accessors.push_back(accessor);
      }
      const uint64_t bytes = view.row_bytes * cloud_.size();
      Json json_view = {{"buffer", 0}, {"byteOffset", offset}, {"byteLength", bytes}};
      if (view.attributes.size() > 1) json_view["byteStride"] = view.row_bytes;
      json_view["target"] = kArrayBuffer;
      views.push_back(json_view);
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

  /// All views, the rows of one task at a time. In: offset, where the first view begins.
  void writeData(OutputFile& file, uint64_t offset) {
    constexpr bool kAsTheyLie = std::endian::native == std::endian::little;
    RowCheck check(cloud_, "cloud");
    std::atomic<size_t> done{0};
    parallelFor(cloud_.size(), kGrain, [&](size_t begin, size_t end) {
      if (!check.look(begin, end)) return;
      std::vector<char> bytes;
      uint64_t place = offset;
      for (const View& view : views_) {
        const size_t count = (end - begin) * view.row_bytes;
        const size_t floats = view.row_bytes / sizeof(float);
        const uint64_t at = place + begin * uint64_t{view.row_bytes};
        if (view.floats != nullptr && kAsTheyLie) {
          file.writeAt(at, view.floats->data() + begin * floats, count);
        } else {
          bytes.resize(count);
          for (size_t i = begin; i < end; ++i) {
            char* row = &bytes[(i - begin) * view.row_bytes];
            if (view.floats != nullptr) {
              putFloats(view.floats->data() + i * floats, floats, row);
            } else {
              view.fill(cloud_, i, row);
            }
          }
          file.writeAt(at, bytes.data(), count);
        }
        place += view.row_bytes * cloud_.size();
      }
      const size_t rows = done.fetch_add(end - begin) + (end - begin);
      advance(progress_, static_cast<double>(rows) / static_cast<double>(cloud_.size()), kStage);
    });
    check.require();
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
    file.writeAt(0, head.data(), head.size());
    writeData(file, head.size());
    file.commit();
  }

  void writeText() {
    const fs::path data_path = fs::path(path_).replace_extension(".bin");
    const std::string text = json(percentEncoded(data_path.filename().string()));
    OutputFile data(data_path.string());
    OutputFile file(path_);
    writeData(data, 0);
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
  std::vector<View> views_;
  uint64_t data_bytes_ = 0;
};

}  // namespace

void writeGltfSplats(const SplatCloud& cloud, const std::string& path, const SplatWriteOptions&,
                     Progress* progress) {
  Writer(cloud, path, progress).write();
}

double estimateGltfSplats(uint64_t count, int degree, const SplatWriteOptions&) {
  constexpr double kJsonBytes = 2000;
  // Position, rotation, scale, opacity and colour of degree 0, and four 16-bit numbers of the points'
  // linear colours: what renderers show that do not know splats.
  constexpr double kPlainBytes = (3 + 4 + 3 + 1 + 3) * sizeof(float) + 4 * sizeof(uint16_t);
  return kJsonBytes +
         static_cast<double>(count) * (kPlainBytes + higherHarmonics(degree) * sizeof(float));
}

}  // namespace stipple
