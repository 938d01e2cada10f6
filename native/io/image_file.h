#pragma once

#include <string>

#include "data/image.h"

namespace stipple {

/// Reads PNG, EXR, JPEG, TIFF... as float. 8- and 16-bit pictures come back as display sRGB
/// (transfer kSrgb), float ones as scene linear; straight alpha is premultiplied.
/// Errors: kIo, kFormat, kUnavailable (media library missing).
Image readImageFile(const std::string& path);

/// Writes by ending: .exr float32 scene linear premultiplied; .png 8-bit display sRGB straight
/// alpha. The transfer of the image is converted to that of the format unless keep_values is set.
void writeImageFile(const Image& image, const std::string& path, bool keep_values = false);

}  // namespace stipple
