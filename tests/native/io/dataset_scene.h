#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "byte_text.h"
#include "io/image_file.h"
#include "io/views/dataset.h"
#include "scratch_folder.h"

namespace stipple {

/// Data sets put together in a folder, file by file.
class DatasetScene : public ScratchFolder {
 protected:
  void makeFolder(const std::string& name) const {
    std::filesystem::create_directories(folder_ / name);
  }

  static Image image(uint32_t width, uint32_t height, uint32_t channels,
                     const std::function<float(uint32_t x, uint32_t y, uint32_t c)>& value,
                     Transfer transfer = Transfer::kSrgb) {
    Image made;
    made.width = width;
    made.height = height;
    made.channels = channels;
    made.transfer = transfer;
    for (uint32_t y = 0; y < height; ++y) {
      for (uint32_t x = 0; x < width; ++x) {
        for (uint32_t c = 0; c < channels; ++c) made.pixels.push_back(value(x, y, c));
      }
    }
    return made;
  }
  void storeImage(const std::string& name, const Image& image) const {
    std::filesystem::create_directories(std::filesystem::path(path(name)).parent_path());
    writeImageFile(image, path(name));
  }
  /// A picture of one display value.
  void storeGrey(const std::string& name, float value, uint32_t width = 4,
                 uint32_t height = 2) const {
    storeImage(name, image(width, height, 3, [value](auto, auto, auto) { return value; }));
  }

  /// A COLMAP model as text: one camera line, and an image with the identity pose for each name.
  void storeColmap(const std::string& camera, const std::vector<std::string>& names,
                   const std::string& folder = "sparse/0") const {
    makeFolder(folder);
    store(folder + "/cameras.txt", "1 " + camera + "\n");
    std::string images;
    for (size_t i = 0; i < names.size(); ++i) {
      images += std::to_string(i + 1) + " 1 0 0 0 0 0 0 1 " + names[i] + "\n\n";
    }
    store(folder + "/images.txt", images);
  }

  /// A frame of transforms.json, with more keys before its matrix.
  static std::string frame(const std::string& file, const std::string& keys = "") {
    return "{\"file_path\": \"" + file + "\", " + keys +
           "\"transform_matrix\": [[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]}";
  }
  void storeTransforms(const std::string& keys, const std::string& frames,
                       const std::string& name = "transforms.json") const {
    store(name, "{" + keys + "\"frames\": [" + frames + "]}");
  }

  /// Grey TIFF of 16 bits without compression.
  void storeTiff16(const std::string& name, uint32_t width, uint32_t height,
                   const std::vector<uint16_t>& values) const {
    ByteText file;
    file.text("II").u16(42).u32(8).u16(9);
    const auto tag = [&file](unsigned number, unsigned type, uint32_t value) {
      file.u16(number).u16(type).u32(1).u32(value);
    };
    constexpr uint32_t kDataOffset = 8 + 2 + 9 * 12 + 4;
    tag(256, 4, width);
    tag(257, 4, height);
    tag(258, 3, 16);
    tag(259, 3, 1);
    tag(262, 3, 1);
    tag(273, 4, kDataOffset);
    tag(277, 3, 1);
    tag(278, 4, height);
    tag(279, 4, width * height * 2);
    file.u32(0);
    for (const uint16_t value : values) file.u16(value);
    store(name, file.bytes);
  }

  std::string folder() const { return folder_.string(); }
};

}  // namespace stipple
