#pragma once

#include <cstdint>
#include <string>

#include "data/images/image.h"

namespace stipple {

/// What the header of a picture's file says.
struct ImageHeader {
  uint32_t width = 0;
  uint32_t height = 0;
  uint32_t channels = 0;  ///< 1, 3 or 4, as readImageFile() gives
  uint32_t bits = 0;      ///< of a value
  Transfer transfer = Transfer::kSrgb;
};

/// Decodes no pixels. Errors: as readImageFile().
ImageHeader readImageHeader(const std::string& path);

/// Reads PNG, EXR, JPEG, TIFF... as float. 8- and 16-bit pictures come back as display sRGB
/// (transfer kSrgb), float ones as scene linear; straight alpha is premultiplied.
/// In: header, filled where it is given. Errors: kIo, kFormat, kUnavailable (media library
/// missing).
Image readImageFile(const std::string& path, ImageHeader* header = nullptr);

/// Writes by extension: .exr float32 scene linear premultiplied; .png 8-bit display sRGB straight
/// alpha. The transfer of the image is converted to that of the format unless keep_values is set.
void writeImageFile(const Image& image, const std::string& path, bool keep_values = false);

}  // namespace stipple
