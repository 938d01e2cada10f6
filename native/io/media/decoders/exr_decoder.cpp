// OpenEXR: the first part of a file as a picture.
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfInputPart.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStdIO.h>

#include <algorithm>
#include <array>
#include <exception>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "base/error.h"
#include "io/media/decoders/decoders.h"
#include "io/media/decoders/exr_layout.h"
#include "io/media/media_calls.h"

namespace stipple::media {

namespace {

class ExrPicture final : public PictureFile {
 public:
  explicit ExrPicture(const std::string& path) try
      : path_(path),
        bytes_(path),
        file_(bytes_.stream),
        channels_(exrChannels(file_.header(0), path)) {
    head_ = exrWindows(file_.header(0), path);
    head_.is_floating_point = true;
    head_.value_bytes = 2;
    bool is_integer = true;
    for (const ExrChannel& channel : channels_) {
      if (channel.name == "A") head_.alpha_channel = static_cast<int>(head_.channels.size());
      head_.channels.push_back(channel.name);
      if (channel.type != Imf::HALF) head_.value_bytes = 4;
      is_integer = is_integer && channel.type == Imf::UINT;
    }
    if (is_integer) fail(ErrorCode::kUnsupported, path + " holds whole numbers and no picture");
  } catch (const Error&) {
    throw;
  } catch (const std::exception& error) {
    fail(ErrorCode::kFormat, path + " is not an image that can be read: " + error.what());
  }

  const PictureHead& head() const override { return head_; }

  void read(int first, int end, float* pixels) override {
    const Imath::Box2i& data = file_.header(0).dataWindow();
    const auto count = static_cast<size_t>(end - first);
    const size_t pixel_bytes = count * sizeof(float);
    const size_t row_bytes = pixel_bytes * static_cast<size_t>(head_.width);
    Imf::FrameBuffer buffer;
    for (size_t c = 0; c < count; ++c) {
      // Where pixel (0, 0) would be, which may lie outside.
      char* const base = reinterpret_cast<char*>(pixels + c) -
                         static_cast<ptrdiff_t>(pixel_bytes) * data.min.x -
                         static_cast<ptrdiff_t>(row_bytes) * data.min.y;
      buffer.insert(channels_[static_cast<size_t>(first) + c].name,
                    Imf::Slice(Imf::FLOAT, base, pixel_bytes, row_bytes));
    }
    try {
      Imf::InputPart part(file_, 0);
      part.setFrameBuffer(buffer);
      part.readPixels(data.min.y, data.max.y);
    } catch (const std::exception& error) {
      fail(ErrorCode::kFormat, path_ + " cannot be decoded: " + error.what());
    }
  }

 private:
  std::string path_;
  ExrStream bytes_;
  Imf::MultiPartInputFile file_;
  std::vector<ExrChannel> channels_;
  PictureHead head_;
};

std::vector<const char*> namesFor(uint32_t channels) {
  if (channels == 1) return {"Y"};
  const std::array<const char*, 4> names = {"R", "G", "B", "A"};
  return {names.begin(), names.begin() + channels};
}

}  // namespace

std::unique_ptr<PictureFile> openExr(const std::string& path) {
  return std::make_unique<ExrPicture>(path);
}

void writeExr(const char* path, const StippleMediaImage& image, const float* pixels) {
  Imf::Header header(static_cast<int>(image.width), static_cast<int>(image.height));
  header.compression() = Imf::ZIP_COMPRESSION;
  Imf::FrameBuffer buffer;
  const size_t pixel_bytes = image.channels * sizeof(float);
  size_t channel = 0;
  for (const char* name : namesFor(image.channels)) {
    header.channels().insert(name, Imf::Channel(Imf::FLOAT));
    // OpenEXR takes memory that may be written and reads it.
    char* const base = reinterpret_cast<char*>(const_cast<float*>(pixels + channel++));
    buffer.insert(name, Imf::Slice(Imf::FLOAT, base, pixel_bytes, pixel_bytes * image.width));
  }
  // Into memory first: a full disk is found by finishFile.
  Imf::StdOSStream bytes;
  {
    Imf::OutputFile output(bytes, header);
    output.setFrameBuffer(buffer);
    output.writePixels(static_cast<int>(image.height));
  }
  const std::string text = bytes.str();
  std::ofstream file(std::filesystem::path(path), std::ios::binary | std::ios::trunc);
  file.write(text.data(), static_cast<std::streamsize>(text.size()));
  finishFile(file, path);
}

}  // namespace stipple::media
