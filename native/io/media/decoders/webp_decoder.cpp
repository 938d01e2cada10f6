// WebP as a picture, its alpha straight. Packed splats are read by packing/webp_images.cpp.
#include <webp/decode.h>

#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "io/media/decoders/decoders.h"

namespace stipple::media {

namespace {

class WebpPicture final : public PictureFile {
 public:
  explicit WebpPicture(PictureBytes bytes) : bytes_(std::move(bytes)) {
    WebPBitstreamFeatures features{};
    if (WebPGetFeatures(bytes_.data, bytes_.count, &features) != VP8_STATUS_OK) {
      fail(ErrorCode::kFormat, bytes_.name + " cannot be decoded: its head is damaged");
    }
    if (features.has_animation != 0) {
      fail(ErrorCode::kUnsupported, bytes_.name + " is an animation; a single picture is read");
    }
    head_.width = features.width;
    head_.height = features.height;
    head_.channels = {"R", "G", "B"};
    if (features.has_alpha != 0) {
      head_.channels.push_back("A");
      head_.alpha_channel = 3;
      head_.has_straight_alpha = true;
    }
  }

  const PictureHead& head() const override { return head_; }

  void read(int first, int end, float* pixels) override {
    const auto channels = static_cast<int>(head_.channels.size());
    const size_t pixel_count = static_cast<size_t>(head_.width * head_.height);
    std::vector<unsigned char> values(pixel_count * static_cast<size_t>(channels));
    const int stride = static_cast<int>(head_.width) * channels;
    const bool is_read =
        channels == 4
            ? WebPDecodeRGBAInto(bytes_.data, bytes_.count, values.data(), values.size(), stride)
            : WebPDecodeRGBInto(bytes_.data, bytes_.count, values.data(), values.size(), stride);
    if (!is_read) fail(ErrorCode::kFormat, bytes_.name + " cannot be decoded: it is damaged");
    toFloats(values.data(), pixel_count, channels, first, end, pixels);
  }

 private:
  PictureBytes bytes_;
  PictureHead head_;
};

}  // namespace

std::unique_ptr<PictureFile> openWebp(PictureBytes bytes) {
  return std::make_unique<WebpPicture>(std::move(bytes));
}

}  // namespace stipple::media
