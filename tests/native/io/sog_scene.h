#pragma once

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "io/webp_image.h"

namespace stipple {

/// A SOG scene put together by hand, pixel by pixel: pictures of one row of splats, and meta.json
/// as text.
struct SogScene {
  using Pixel = std::vector<uint8_t>;  ///< four bytes

  std::map<std::string, std::string> files;

  static std::string webp(const std::vector<Pixel>& pixels, uint32_t width = 0) {
    RgbaBytes image;
    image.width = width != 0 ? width : static_cast<uint32_t>(pixels.size());
    image.height = static_cast<uint32_t>(pixels.size()) / image.width;
    for (const Pixel& pixel : pixels) {
      image.bytes.insert(image.bytes.end(), pixel.begin(), pixel.end());
    }
    const std::vector<uint8_t> bytes = encodeWebp(image, "test");
    return {bytes.begin(), bytes.end()};
  }

  /// 256 numbers of a list in JSON: from, from + step, ...
  static std::string codebook(double from, double step) {
    std::string text = "[";
    for (int i = 0; i < 256; ++i) {
      if (i > 0) text.push_back(',');
      text += std::to_string(from + step * i);
    }
    return text + "]";
  }

  void store(const std::filesystem::path& folder) const {
    std::filesystem::create_directories(folder);
    for (const auto& [name, bytes] : files) {
      std::ofstream(folder / name, std::ios::binary) << bytes;
    }
  }

  /// Two splats of degree 1 in version 2. Scales are exp((b - 128) / 16), colours b / 64 - 2,
  /// harmonics (b - 128) / 100.
  static SogScene second() {
    SogScene scene;
    scene.files["means_l.webp"] = webp({{0x00, 0xff, 0x34, 255}, {0xff, 0xff, 0x12, 255}});
    scene.files["means_u.webp"] = webp({{0x00, 0xff, 0x12, 255}, {0xff, 0x7f, 0x34, 255}});
    scene.files["scales.webp"] = webp({{128, 144, 112, 255}, {0, 255, 128, 255}});
    scene.files["quats.webp"] = webp({{255, 0, 128, 252}, {51, 102, 204, 254}});
    scene.files["sh0.webp"] = webp({{0, 64, 255, 51}, {128, 192, 1, 255}});
    std::vector<Pixel> palette(192 * 2, Pixel{128, 128, 128, 255});
    palette[3] = {0, 1, 2, 255};  // vector 1, coefficients 1 to 3
    palette[4] = {3, 4, 5, 255};
    palette[5] = {6, 7, 8, 255};
    palette[192 + 2] = {255, 254, 253, 255};  // vector 64, coefficient 3
    scene.files["shN_centroids.webp"] = webp(palette, 192);
    scene.files["shN_labels.webp"] = webp({{1, 0, 0, 255}, {64, 0, 0, 255}});
    scene.files["meta.json"] =
        "{\"version\":2,\"count\":2,\"means\":{\"mins\":[-1,0,-2],\"maxs\":[1,2,3],"
        "\"files\":[\"means_l.webp\",\"means_u.webp\"]},\"scales\":{\"codebook\":" +
        codebook(-8.0, 0.0625) +
        ",\"files\":[\"scales.webp\"]},\"quats\":{\"files\":[\"quats.webp\"]}," +
        "\"sh0\":{\"codebook\":" + codebook(-2.0, 0.015625) +
        ",\"files\":[\"sh0.webp\"]},\"shN\":{\"count\":65,\"bands\":1,\"codebook\":" +
        codebook(-1.28, 0.01) + ",\"files\":[\"shN_centroids.webp\",\"shN_labels.webp\"]}}";
    return scene;
  }

  /// The same pictures as version 1 reads them.
  static SogScene first() {
    SogScene scene = second();
    scene.files["meta.json"] =
        "{\"means\":{\"shape\":[2,3],\"mins\":[-1,0,-2],\"maxs\":[1,2,3],"
        "\"files\":[\"means_l.webp\",\"means_u.webp\"]},"
        "\"scales\":{\"shape\":[2,3],\"mins\":[-5,-4,-3],\"maxs\":[0,1,2],"
        "\"files\":[\"scales.webp\"]},"
        "\"quats\":{\"shape\":[2,4],\"encoding\":\"quaternion_packed\",\"files\":[\"quats.webp\"]},"
        "\"sh0\":{\"shape\":[2,1,4],\"mins\":[-2,-1,0,-5],\"maxs\":[2,1,1,10],"
        "\"files\":[\"sh0.webp\"]},"
        "\"shN\":{\"shape\":[2,3],\"mins\":-1,\"maxs\":2,\"quantization\":8,"
        "\"files\":[\"shN_centroids.webp\",\"shN_labels.webp\"]}}";
    return scene;
  }

  void replace(const std::string& from, const std::string& to) {
    std::string& text = files["meta.json"];
    text.replace(text.find(from), from.size(), to);
  }
};

/// A zip archive byte by byte. Deflated entries are deflate's uncompressed blocks.
struct ZipBytes {
  std::string bytes;
  std::string directory;
  uint16_t count = 0;

  static std::string number(uint64_t value, size_t width) {
    std::string text;
    for (size_t b = 0; b < width; ++b, value >>= 8) text.push_back(static_cast<char>(value));
    return text;
  }

  static uint32_t checksum(const std::string& data) {
    uint32_t crc = 0xffffffff;
    for (const char letter : data) {
      crc ^= static_cast<unsigned char>(letter);
      for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1) != 0 ? 0xedb88320u : 0u);
    }
    return ~crc;
  }

  /// In: whole, the size that the archive claims, where it lies.
  ZipBytes& add(const std::string& name, const std::string& data, bool deflated = false,
                uint64_t whole = UINT64_MAX) {
    std::string stored = data;
    if (deflated) {
      stored.clear();
      for (size_t at = 0; at < data.size() || at == 0; at += 65535) {
        const std::string block = data.substr(at, 65535);
        stored += (at + 65535 >= data.size() ? '\1' : '\0') + number(block.size(), 2) +
                  number(~block.size(), 2) + block;
      }
    }
    const std::string common = number(20, 2) + number(0, 2) + number(deflated ? 8 : 0, 2) +
                               number(0, 4) + number(checksum(data), 4) + number(stored.size(), 4) +
                               number(whole != UINT64_MAX ? whole : data.size(), 4) +
                               number(name.size(), 2) + number(0, 2);
    // Ten zero bytes: comment length, disk and attributes.
    directory += number(0x02014b50, 4) + number(20, 2) + common + number(0, 10) +
                 number(bytes.size(), 4) + name;
    bytes += number(0x04034b50, 4) + common + name + stored;
    ++count;
    return *this;
  }

  std::string text(const std::string& comment = "") const {
    return bytes + directory + number(0x06054b50, 4) + number(0, 4) + number(count, 2) +
           number(count, 2) + number(directory.size(), 4) + number(bytes.size(), 4) +
           number(comment.size(), 2) + comment;
  }
};

}  // namespace stipple
