// JPEG through libjpeg-turbo, which reports errors by a function that must not return: here it
// throws.
#include <cstdio>

#include <jpeglib.h>

#include <cmath>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "io/media/decoders/decoders.h"

namespace stipple::media {

namespace {

[[noreturn]] void throwError(j_common_ptr common) {
  char reason[JMSG_LENGTH_MAX];
  (*common->err->format_message)(common, reason);
  fail(ErrorCode::kFormat,
       *static_cast<const std::string*>(common->client_data) + " cannot be decoded: " + reason);
}

/// Warnings, of which a cut-off file is one that leaves grey behind.
void judgeMessage(j_common_ptr common, int level) {
  if (level < 0) throwError(common);
}

/// Inks of a CMYK picture, which JPEG stores inverted, as red, green and blue.
unsigned char lightThrough(unsigned char ink, unsigned char black) {
  return static_cast<unsigned char>(std::lround(static_cast<double>(ink) * black / 255.0));
}

class JpegPicture final : public PictureFile {
 public:
  explicit JpegPicture(PictureBytes bytes) : bytes_(std::move(bytes)) {
    decoder_.err = jpeg_std_error(&errors_);
    errors_.error_exit = throwError;
    errors_.emit_message = judgeMessage;
    decoder_.client_data = &bytes_.name;
    jpeg_create_decompress(&decoder_);
    try {
      readHead();
    } catch (...) {
      jpeg_destroy_decompress(&decoder_);
      throw;
    }
  }
  ~JpegPicture() override { jpeg_destroy_decompress(&decoder_); }
  JpegPicture(const JpegPicture&) = delete;
  JpegPicture& operator=(const JpegPicture&) = delete;

  const PictureHead& head() const override { return head_; }

  void read(int first, int end, float* pixels) override {
    jpeg_start_decompress(&decoder_);
    const auto width = static_cast<size_t>(head_.width);
    const bool is_cmyk = decoder_.out_color_space == JCS_CMYK;
    std::vector<unsigned char> row(width * static_cast<size_t>(decoder_.output_components));
    std::vector<unsigned char> rgb(is_cmyk ? width * 3 : 0);
    while (decoder_.output_scanline < decoder_.output_height) {
      unsigned char* at = row.data();
      jpeg_read_scanlines(&decoder_, &at, 1);
      for (size_t x = 0; is_cmyk && x < width; ++x) {
        for (size_t c = 0; c < 3; ++c) {
          rgb[x * 3 + c] = lightThrough(row[x * 4 + c], row[x * 4 + 3]);
        }
      }
      toFloats(is_cmyk ? rgb.data() : row.data(), width, static_cast<int>(head_.channels.size()),
               first, end, pixels);
      pixels += width * static_cast<size_t>(end - first);
    }
    jpeg_finish_decompress(&decoder_);
  }

 private:
  void readHead() {
    jpeg_mem_src(&decoder_, bytes_.data, static_cast<unsigned long>(bytes_.count));
    jpeg_read_header(&decoder_, TRUE);
    if (decoder_.num_components == 1) {
      head_.channels = {"Y"};
    } else {
      head_.channels = {"R", "G", "B"};
      if (decoder_.num_components == 4) {
        decoder_.out_color_space = JCS_CMYK;
      } else {
        decoder_.out_color_space = JCS_RGB;
      }
    }
    head_.width = decoder_.image_width;
    head_.height = decoder_.image_height;
  }

  PictureBytes bytes_;
  PictureHead head_;
  jpeg_decompress_struct decoder_{};
  jpeg_error_mgr errors_{};
};

}  // namespace

std::unique_ptr<PictureFile> openJpeg(PictureBytes bytes) {
  return std::make_unique<JpegPicture>(std::move(bytes));
}

}  // namespace stipple::media
