// PNG through libpng, which reports errors by a function that must not return: here it throws.
#include <png.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "io/media/decoders/decoders.h"
#include "io/media/media_calls.h"

namespace stipple::media {

namespace {

[[noreturn]] void throwError(png_structp png, png_const_charp reason) {
  const auto* name = static_cast<const std::string*>(png_get_error_ptr(png));
  fail(ErrorCode::kFormat, *name + " cannot be decoded: " + reason);
}

void ignoreWarning(png_structp, png_const_charp) {}

class PngPicture final : public PictureFile {
 public:
  explicit PngPicture(PictureBytes bytes)
      : bytes_(std::move(bytes)),
        png_(png_create_read_struct(PNG_LIBPNG_VER_STRING, &bytes_.name, throwError,
                                    ignoreWarning)) {
    if (png_ == nullptr) throw std::bad_alloc();
    try {
      readHead();
    } catch (...) {
      png_destroy_read_struct(&png_, &info_, nullptr);
      throw;
    }
  }
  ~PngPicture() override { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngPicture(const PngPicture&) = delete;
  PngPicture& operator=(const PngPicture&) = delete;

  const PictureHead& head() const override { return head_; }

  void read(int first, int end, float* pixels) override {
    const size_t row_bytes = png_get_rowbytes(png_, info_);
    const auto height = static_cast<size_t>(head_.height);
    std::vector<unsigned char> values(row_bytes * height);
    std::vector<png_bytep> rows(height);
    for (size_t y = 0; y < height; ++y) rows[y] = values.data() + y * row_bytes;
    png_read_image(png_, rows.data());
    const auto channels = static_cast<int>(head_.channels.size());
    const size_t pixel_count = static_cast<size_t>(head_.width) * height;
    if (head_.value_bytes == 1) {
      toFloats(values.data(), pixel_count, channels, first, end, pixels);
      return;
    }
    constexpr float kStep = 1.0f / 65535.0f;
    for (size_t i = 0; i < pixel_count; ++i) {
      for (int c = first; c < end; ++c) {
        uint16_t value = 0;
        std::memcpy(&value,
                    &values[(i * static_cast<size_t>(channels) + static_cast<size_t>(c)) * 2], 2);
        *pixels++ = static_cast<float>(value) * kStep;
      }
    }
  }

 private:
  static void take(png_structp png, png_bytep out, size_t count) {
    auto* self = static_cast<PngPicture*>(png_get_io_ptr(png));
    if (count > self->bytes_.count - self->at_) png_error(png, "it ends too early");
    std::memcpy(out, self->bytes_.data + self->at_, count);
    self->at_ += count;
  }

  void readHead() {
    info_ = png_create_info_struct(png_);
    if (info_ == nullptr) throw std::bad_alloc();
    png_set_read_fn(png_, this, take);
    // As large as pictures may be; the caller holds what its area takes against the file.
    png_set_user_limits(png_, 0x7fffffff, 0x7fffffff);
    png_read_info(png_, info_);
    const int depth = png_get_bit_depth(png_, info_);
    const int colour = png_get_color_type(png_, info_);
    if (colour == PNG_COLOR_TYPE_PALETTE) png_set_palette_to_rgb(png_);
    if (colour == PNG_COLOR_TYPE_GRAY && depth < 8) png_set_expand_gray_1_2_4_to_8(png_);
    if (png_get_valid(png_, info_, PNG_INFO_tRNS) != 0) png_set_tRNS_to_alpha(png_);
    if (depth == 16 && std::endian::native == std::endian::little) png_set_swap(png_);
    png_set_interlace_handling(png_);
    png_read_update_info(png_, info_);
    head_.width = png_get_image_width(png_, info_);
    head_.height = png_get_image_height(png_, info_);
    head_.value_bytes = png_get_bit_depth(png_, info_) == 16 ? 2 : 1;
    const int channels = png_get_channels(png_, info_);
    head_.channels =
        channels <= 2 ? std::vector<std::string>{"Y"} : std::vector<std::string>{"R", "G", "B"};
    if (channels == 2 || channels == 4) {
      head_.alpha_channel = channels - 1;
      head_.channels.push_back("A");
      head_.has_straight_alpha = true;
    }
  }

  PictureBytes bytes_;
  size_t at_ = 0;
  PictureHead head_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
};

/// What libpng writes to: all of it is in memory before a file is made.
class PngWriter {
 public:
  explicit PngWriter(std::string name)
      : name_(std::move(name)),
        png_(png_create_write_struct(PNG_LIBPNG_VER_STRING, &name_, throwError, ignoreWarning)),
        info_(png_ != nullptr ? png_create_info_struct(png_) : nullptr) {
    if (info_ == nullptr) {
      png_destroy_write_struct(&png_, &info_);
      throw std::bad_alloc();
    }
  }
  ~PngWriter() { png_destroy_write_struct(&png_, &info_); }
  PngWriter(const PngWriter&) = delete;
  PngWriter& operator=(const PngWriter&) = delete;

  const std::vector<unsigned char>& write(const StippleMediaImage& image, const uint8_t* pixels) {
    png_set_write_fn(png_, this, keep, nullptr);
    png_set_IHDR(png_, info_, image.width, image.height, 8,
                 image.channels == 1   ? PNG_COLOR_TYPE_GRAY
                 : image.channels == 3 ? PNG_COLOR_TYPE_RGB
                                       : PNG_COLOR_TYPE_RGB_ALPHA,
                 PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_set_sRGB(png_, info_, PNG_sRGB_INTENT_ABSOLUTE);
    png_write_info(png_, info_);
    const size_t row_bytes = size_t{image.width} * image.channels;
    for (size_t y = 0; y < image.height; ++y) png_write_row(png_, pixels + y * row_bytes);
    png_write_end(png_, info_);
    return bytes_;
  }

 private:
  static void keep(png_structp png, png_bytep data, size_t count) {
    auto& bytes = static_cast<PngWriter*>(png_get_io_ptr(png))->bytes_;
    bytes.insert(bytes.end(), data, data + count);
  }

  std::string name_;
  std::vector<unsigned char> bytes_;
  png_structp png_;
  png_infop info_;
};

}  // namespace

std::unique_ptr<PictureFile> openPng(PictureBytes bytes) {
  return std::make_unique<PngPicture>(std::move(bytes));
}

void writePng(const char* path, const StippleMediaImage& image, const uint8_t* pixels) {
  PngWriter writer(path);
  const std::vector<unsigned char>& bytes = writer.write(image, pixels);
  std::ofstream file(std::filesystem::path(path), std::ios::binary | std::ios::trunc);
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  finishFile(file, path);
}

}  // namespace stipple::media
