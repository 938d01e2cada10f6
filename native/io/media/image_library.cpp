// Pictures through OpenImageIO. It would multiply and divide by alpha on its own, at 8 bits with
// loss; it is told to leave the values alone, and the caller converts.
#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "io/media/media_calls.h"
#include "io/media/picture_file.h"

namespace stipple::media {

namespace {

PictureHead headOf(const OIIO::ImageSpec& spec) {
  PictureHead head;
  head.width = spec.width;
  head.height = spec.height;
  head.x = spec.x - spec.full_x;
  head.y = spec.y - spec.full_y;
  head.full_width = spec.full_width;
  head.full_height = spec.full_height;
  head.depth = spec.depth;
  head.channels.assign(spec.channelnames.begin(), spec.channelnames.end());
  head.alpha_channel = spec.alpha_channel;
  head.is_floating_point = spec.format.is_floating_point();
  // Readers that kept straight alpha, as told, say so; others (WebP in version 2.4) multiply.
  head.has_straight_alpha = spec.get_int_attribute("oiio:UnassociatedAlpha", 0) != 0;
  head.value_bytes = static_cast<uint32_t>(spec.format.size());
  return head;
}

class LibraryPicture final : public PictureFile {
 public:
  LibraryPicture(std::unique_ptr<OIIO::ImageInput> input, std::string name,
                 std::unique_ptr<OIIO::Filesystem::IOMemReader> memory = nullptr)
      : memory_(std::move(memory)),
        input_(std::move(input)),
        name_(std::move(name)),
        head_(headOf(input_->spec())) {}

  const PictureHead& head() const override { return head_; }

  void read(int first, int end, float* pixels) override {
    if (!input_->read_image(0, 0, first, end, OIIO::TypeDesc::FLOAT, pixels)) {
      fail(ErrorCode::kFormat, name_ + " cannot be decoded: " + input_->geterror());
    }
  }

 private:
  std::unique_ptr<OIIO::Filesystem::IOMemReader> memory_;
  std::unique_ptr<OIIO::ImageInput> input_;
  std::string name_;
  PictureHead head_;
};

OIIO::ImageSpec keepAlpha() {
  OIIO::ImageSpec config;
  config.attribute("oiio:UnassociatedAlpha", 1);
  return config;
}

/// The name under which OpenImageIO finds the reader of these bytes.
const char* nameForBytes(const std::vector<unsigned char>& bytes) {
  const auto starts = [&bytes](const char* magic, size_t length) {
    return bytes.size() >= length && std::memcmp(bytes.data(), magic, length) == 0;
  };
  if (starts("\x89PNG", 4)) return "texture.png";
  if (starts("\xff\xd8", 2)) return "texture.jpg";
  if (starts("RIFF", 4)) return "texture.webp";
  if (starts("BM", 2)) return "texture.bmp";
  if (starts("GIF8", 4)) return "texture.gif";
  return nullptr;
}

void write(const char* path, const OIIO::ImageSpec& spec, OIIO::TypeDesc type, const void* pixels) {
  const std::unique_ptr<OIIO::ImageOutput> output = OIIO::ImageOutput::create(path);
  if (!output) {
    fail(ErrorCode::kUnsupported, std::string(path) + " cannot be written: " + OIIO::geterror());
  }
  // Into memory first: on a full disk OpenImageIO ends a PNG file early and says nothing.
  OIIO::Filesystem::IOVecOutput bytes;
  if (!output->set_ioproxy(&bytes) || !output->open(path, spec) ||
      !output->write_image(type, pixels) || !output->close()) {
    fail(ErrorCode::kIo, std::string(path) + " cannot be written: " + output->geterror());
  }
  std::ofstream file(std::filesystem::path(path), std::ios::binary | std::ios::trunc);
  file.write(reinterpret_cast<const char*>(bytes.buffer().data()),
             static_cast<std::streamsize>(bytes.buffer().size()));
  finishFile(file, path);
}

OIIO::ImageSpec specFor(const StippleMediaImage& image, OIIO::TypeDesc type) {
  OIIO::ImageSpec spec(static_cast<int>(image.width), static_cast<int>(image.height),
                       static_cast<int>(image.channels), type);
  if (image.channels == 1) spec.channelnames = {"Y"};
  return spec;
}

}  // namespace

std::unique_ptr<PictureFile> openPicture(const std::string& path) {
  const OIIO::ImageSpec config = keepAlpha();
  auto input = OIIO::ImageInput::open(path, &config);
  if (!input) {
    fail(ErrorCode::kFormat, path + " is not an image that can be read: " + OIIO::geterror());
  }
  return std::make_unique<LibraryPicture>(std::move(input), path);
}

std::unique_ptr<PictureFile> openPicture(const std::vector<unsigned char>& bytes,
                                         const std::string& name) {
  const char* file_name = nameForBytes(bytes);
  if (file_name == nullptr) {
    fail(ErrorCode::kUnsupported, name + " is not a PNG, JPEG, WebP, BMP or GIF image");
  }
  auto memory = std::make_unique<OIIO::Filesystem::IOMemReader>(bytes.data(), bytes.size());
  OIIO::ImageSpec config = keepAlpha();
  // The readers look for the bytes in the configuration, not in open's own argument.
  void* proxy = memory.get();
  config.attribute("oiio:ioproxy", OIIO::TypeDesc::PTR, &proxy);
  auto input = OIIO::ImageInput::open(file_name, &config, memory.get());
  if (!input) fail(ErrorCode::kFormat, name + " cannot be decoded: " + OIIO::geterror());
  return std::make_unique<LibraryPicture>(std::move(input), name, std::move(memory));
}

void writePng(const char* path, const StippleMediaImage& image, const uint8_t* pixels) {
  OIIO::ImageSpec spec = specFor(image, OIIO::TypeDesc::UINT8);
  spec.attribute("oiio:UnassociatedAlpha", 1);
  spec.attribute("oiio:ColorSpace", "sRGB");
  write(path, spec, OIIO::TypeDesc::UINT8, pixels);
}

void writeExr(const char* path, const StippleMediaImage& image, const float* pixels) {
  OIIO::ImageSpec spec = specFor(image, OIIO::TypeDesc::FLOAT);
  spec.attribute("compression", "zip");
  write(path, spec, OIIO::TypeDesc::FLOAT, pixels);
}

}  // namespace stipple::media
