// WebP pictures whose bytes are data and not colours: lossless, and exact under an alpha of 0.
#include <webp/decode.h>
#include <webp/encode.h>

#include <cstring>
#include <string>

#include "base/error.h"
#include "io/media/media_status.h"
#include "io/media/packing/packing_calls.h"

namespace stipple::media {

namespace {

// libwebp's scale from fast to small. At 75 the entropy coder's search is on: a tenth smaller than
// the fastest on splat data, a fifth of the time of the most thorough.
constexpr float kEffort = 75.0f;
constexpr int kMethod = 4;

void readSize(const char* name, const uint8_t* bytes, uint64_t byte_count, int* width,
              int* height) {
  if (WebPGetInfo(bytes, byte_count, width, height) == 0) {
    fail(ErrorCode::kFormat, std::string(name) + " is not a WebP image, or its header is damaged");
  }
}

/// Frees what libwebp allocated, whatever is thrown.
struct EncoderMemory {
  WebPPicture picture;
  WebPMemoryWriter writer;
  EncoderMemory() {
    WebPPictureInit(&picture);
    WebPMemoryWriterInit(&writer);
  }
  ~EncoderMemory() {
    WebPPictureFree(&picture);
    WebPMemoryWriterClear(&writer);
  }
  EncoderMemory(const EncoderMemory&) = delete;
  EncoderMemory& operator=(const EncoderMemory&) = delete;
};

}  // namespace

void stipple_packing_webp_size(const char* name, const uint8_t* bytes, uint64_t byte_count,
                               uint32_t* width, uint32_t* height, StippleMediaStatus* status) {
  guard(name, status, [&] {
    int w = 0;
    int h = 0;
    readSize(name, bytes, byte_count, &w, &h);
    *width = static_cast<uint32_t>(w);
    *height = static_cast<uint32_t>(h);
  });
}

void stipple_packing_webp_decode(const char* name, const uint8_t* bytes, uint64_t byte_count,
                                 uint8_t* rgba, uint64_t rgba_bytes, StippleMediaStatus* status) {
  guard(name, status, [&] {
    int width = 0;
    int height = 0;
    readSize(name, bytes, byte_count, &width, &height);
    if (WebPDecodeRGBAInto(bytes, byte_count, rgba, rgba_bytes, width * 4) == nullptr) {
      fail(ErrorCode::kFormat, std::string(name) + " (a WebP image of " + std::to_string(width) +
                                   " x " + std::to_string(height) + ", " +
                                   std::to_string(byte_count) + " bytes) is truncated or damaged");
    }
  });
}

void stipple_packing_webp_encode(const char* name, const uint8_t* rgba, uint32_t width,
                                 uint32_t height, const StippleMediaSink* sink,
                                 StippleMediaStatus* status) {
  guard(name, status, [&] {
    WebPConfig config;
    if (WebPConfigInit(&config) == 0) {
      fail(ErrorCode::kUnavailable, "libwebp is of another version than its header");
    }
    config.lossless = 1;
    config.exact = 1;
    config.quality = kEffort;
    config.method = kMethod;
    EncoderMemory memory;
    memory.picture.use_argb = 1;
    memory.picture.width = static_cast<int>(width);
    memory.picture.height = static_cast<int>(height);
    memory.picture.writer = WebPMemoryWrite;
    memory.picture.custom_ptr = &memory.writer;
    if (WebPPictureImportRGBA(&memory.picture, rgba, static_cast<int>(width) * 4) == 0 ||
        WebPEncode(&config, &memory.picture) == 0) {
      const WebPEncodingError error = memory.picture.error_code;
      const bool no_memory =
          error == VP8_ENC_ERROR_OUT_OF_MEMORY || error == VP8_ENC_ERROR_BITSTREAM_OUT_OF_MEMORY;
      fail(no_memory ? ErrorCode::kOutOfMemory : ErrorCode::kUnsupported,
           std::string(name) + " of " + std::to_string(width) + " x " + std::to_string(height) +
               " cannot be made a WebP image (libwebp's error " + std::to_string(error) +
               "); at most 16383 x 16383 is allowed");
    }
    giveBytes(*sink, 0, memory.writer.mem, memory.writer.size);
  });
}

}  // namespace stipple::media
