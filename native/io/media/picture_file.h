#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "io/media_table.h"

namespace stipple::media {

/// What the head of a picture says. Its data may be a window of the picture, or reach beyond it.
struct PictureHead {
  int64_t width = 0, height = 0;            ///< of the data
  int64_t x = 0, y = 0;                     ///< of the data's first pixel, from the picture's
  int64_t full_width = 0, full_height = 0;  ///< of the picture; 0 as the data
  int64_t depth = 1;
  std::vector<std::string> channels;
  int alpha_channel = -1;
  bool is_floating_point = false;
  bool has_straight_alpha = false;
  uint32_t value_bytes = 1;
};

/// A picture that is open. There are two ways to read and write pictures, and a build has one of
/// them: OpenImageIO (image_library.cpp), or the decoders of each format (decoders).
class PictureFile {
 public:
  virtual ~PictureFile() = default;
  virtual const PictureHead& head() const = 0;
  /// Reads the channels [first, end) of all data to pixels [height, width, end - first]: integers
  /// as 0..1, alpha as it is in the file. Errors: kFormat.
  virtual void read(int first, int end, float* pixels) = 0;
};

/// Errors: kFormat, or kUnsupported for a format that this build does not read.
std::unique_ptr<PictureFile> openPicture(const std::string& path);
/// As above, of bytes that outlive the result. In: name, what messages call it.
std::unique_ptr<PictureFile> openPicture(const std::vector<unsigned char>& bytes,
                                         const std::string& name);

/// Writes [height, width, channels] to a file. Errors: kIo.
void writePng(const char* path, const StippleMediaImage& image, const uint8_t* pixels);
void writeExr(const char* path, const StippleMediaImage& image, const float* pixels);

}  // namespace stipple::media
